"""How the sensors, clocks and topics of a real log differ from perfect ones, as plain data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

from gpsim.channels import FloatArray


@dataclass(frozen=True)
class Rough:
    """What is wrong with a recording besides noise; zero or absent where it is right.

    quantum: channel -> step of its encoder. jitter: standard deviation [s] of the stamps; drift: seconds that the
    recording's clock gains in a second. dropped, repeated, swapped: share of the rows that are missing, that say what
    the row before said, in which markers are swapped; leap: channel -> how far a swapped marker is away. late:
    channel -> s by which its topic lags behind the others.
    """

    quantum: Mapping[str, float] = field(default_factory=dict)
    jitter: float = 0.0
    drift: float = 0.0
    dropped: float = 0.0
    repeated: float = 0.0
    swapped: float = 0.0
    leap: Mapping[str, float] = field(default_factory=dict)
    late: Mapping[str, float] = field(default_factory=dict)

    @property
    def defects(self) -> tuple[str, ...]:
        """What is wrong, in words."""
        found = {
            "quantised": self.quantum,
            "jitter": self.jitter,
            "drift": self.drift,
            "dropped": self.dropped,
            "repeated": self.repeated,
            "swapped": self.swapped,
            "late": self.late,
        }
        return tuple(name for name, there in found.items() if there)


def rough_json(rough: Rough) -> dict[str, Any]:
    """Plain data."""
    return {k: dict(v) if isinstance(v, Mapping) else v for k, v in vars(rough).items()}


Values = Mapping[str, float]


@dataclass(frozen=True)
class Session:
    """One recording of a machine.

    changes: name of an effect -> its values in this recording, where they are not the machine's own. zeros: channel ->
    what its sensor adds, where that changes nothing of the motion; clock: s that its clock shows at its start.
    """

    excitation: str
    posture: str
    episodes: int
    steps: int
    clock: float = 0.0
    zeros: Values = field(default_factory=dict)
    changes: Mapping[str, Values] = field(default_factory=dict)


@dataclass(frozen=True)
class Machine:
    """What kind of machine a world is. positions_only: no velocity is in its recordings; sessions: the recordings."""

    kind: str
    positions_only: bool
    sessions: tuple[Session, ...]


def machine_json(machine: Machine) -> dict[str, Any]:
    """Plain data."""
    plain = [
        {k: _plain(v) if isinstance(v, Mapping) else v for k, v in vars(s).items()} for s in machine.sessions
    ]
    return {"kind": machine.kind, "positions_only": machine.positions_only, "sessions": plain}


def machine_from_json(data: Mapping[str, Any]) -> Machine:
    """The inverse of `machine_json`."""
    return Machine(data["kind"], data["positions_only"], tuple(Session(**s) for s in data["sessions"]))


def _plain(values: Mapping[str, Any]) -> dict[str, Any]:
    return {k: dict(v) if isinstance(v, Mapping) else float(v) for k, v in values.items()}


"""Parameters of an effect: name -> value in SI units."""
Stratum = Literal[
    "single", "pair", "triple", "none", "unknown", "words", "curves", "rough", "machines", "whole", "afloat",
    "plans"
]  # fmt: skip
STRATA: tuple[Stratum, ...] = ("single", "pair", "triple", "none", "unknown", "words")


@dataclass(frozen=True)
class TrueEffect:
    """One effect of the truth: a family of the catalogue, or a kind of physics outside it.

    values: the parameters under the catalogue's names, in SI units. region: intervals of channels in which it acts;
    since: the moment [s] of the recording's clock at which it began. strength: subtle, medium or plain.
    """

    family: str
    on: str
    values: Values
    region: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    since: float | None = None
    outside: bool = False
    strength: str = ""

    def acts(self, state: FloatArray, t: FloatArray, names: tuple[str, ...]) -> FloatArray:
        """(B,) 1 where and when it acts, else 0; state (B, S) has the columns `names`, t (B,) s."""
        mask = np.ones(len(t))
        for name, (low, high) in self.region.items():
            values = state[:, names.index(name)]
            mask = mask * ((values >= low) & (values <= high))
        return np.asarray(mask if self.since is None else mask * (t >= self.since), dtype=np.float64)

    @property
    def name(self) -> str:
        """What it is and where it acts."""
        return f"{self.family} on {self.on}"

    @property
    def gated(self) -> bool:
        """Whether it is limited in space or time."""
        return bool(self.region) or self.since is not None


@dataclass(frozen=True)
class World:
    """A concealed world. Its randomness comes from (seed, number, attempt) alone."""

    seed: int
    number: int
    attempt: int
    stratum: Stratum
    long: bool
    system: str
    parameters: Mapping[str, float]  # the base simulator's
    integrator: str
    dt: float  # s
    engine: Literal["rk4", "mujoco"]
    effects: tuple[TrueEffect, ...]
    episodes: int
    steps: int
    clock: Literal["session", "episode"]
    excitation: str
    posture: str  # upright, hanging (cart-pole); else ""
    noise_level: str
    noise: Mapping[str, float]  # standard deviation by channel
    noise_known: bool
    velocities: Literal["measured", "differentiated"] | None
    smoothing: str  # of differentiated velocities: central, savgol
    wrapped: bool  # yaw is written modulo 2 pi
    held_out: int | None  # episodes from this number on
    rough: Rough | None = None  # what is wrong with its log; of the strata `rough`, `machines`, `whole`
    machine: Machine | None = None  # of the stratum `machines`
    session: int = 0  # which of a machine's recordings this is

    @property
    def main(self) -> tuple[TrueEffect, ...]:
        """Effects of the catalogue."""
        return tuple(e for e in self.effects if not e.outside)

    @property
    def late(self) -> tuple[TrueEffect, ...]:
        """The topics that lag behind, said as sensors that do."""
        lags = self.rough.late if self.rough else {}
        return tuple(TrueEffect("sensor_delay", on, {"delay": lag}) for on, lag in lags.items())

    def generator(self, purpose: int) -> np.random.Generator:
        """A stream of its own for every purpose, and for every recording of a machine."""
        own = [self.session] if self.session else []
        return np.random.default_rng([self.seed, self.number, self.attempt, purpose, *own])

    def recorded_as(self, session: int) -> World:
        """A machine's world as one of its recordings has it: driven in its way, with what differs in it."""
        if self.machine is None or not session:
            return self
        own = self.machine.sessions[session]
        effects = tuple(replace(e, values=own.changes.get(e.name, e.values)) for e in self.effects)
        return replace(
            self,
            session=session,
            effects=effects,
            excitation=own.excitation,
            posture=own.posture,
            episodes=own.episodes,
            steps=own.steps,
        )

    @property
    def offsets(self) -> FloatArray:
        """(E,) wall time [s] at which each episode began; a second lies between two."""
        return np.asarray(np.arange(self.episodes) * (self.steps * self.dt + 1.0), dtype=np.float64)

    @property
    def clock_offsets(self) -> FloatArray:
        """(E,) what the recording's clock says then."""
        return np.asarray(self.offsets if self.clock == "session" else np.zeros(self.episodes))


def effect_json(effect: TrueEffect) -> dict[str, Any]:
    """Plain data."""
    return {
        "family": effect.family,
        "on": effect.on,
        "parameters": {k: float(v) for k, v in effect.values.items()},
        "region": {k: [float(low), float(high)] for k, (low, high) in effect.region.items()},
        "since": effect.since,
        "outside": effect.outside,
        "strength": effect.strength,
    }


def world_json(world: World) -> dict[str, Any]:
    """Plain data: the world without its effects, which an answer lists apart."""
    skip = {"effects", "rough", "machine", "session"}
    plain = {k: v for k, v in vars(world).items() if k not in skip}
    out = {k: dict(v) if isinstance(v, Mapping) else v for k, v in plain.items()}
    out |= {} if world.rough is None else {"rough": rough_json(world.rough)}
    return out if world.machine is None else out | {"machine": machine_json(world.machine)}


def world_from_json(data: Mapping[str, Any], effects: list[Mapping[str, Any]]) -> World:
    """The inverse of `world_json` and `effect_json`."""
    made = tuple(
        TrueEffect(
            e["family"],
            e["on"],
            e["parameters"],
            {k: (v[0], v[1]) for k, v in e["region"].items()},
            e["since"],
            e["outside"],
            e["strength"],
        )
        for e in effects
    )
    parts: dict[str, Any] = {"rough": Rough(**data["rough"])} if "rough" in data else {}
    if "machine" in data:
        parts["machine"] = machine_from_json(data["machine"])
    return World(**{**data, **parts}, effects=made)


@dataclass(frozen=True)
class Run:
    """What truly happened, and what was read.

    fine: (K n + 1, E, S) true states every h s; commands: (K, E, A); clean: (K + 1, E, S) readings without noise;
    measured: with it; hidden: (K + 1, E, H) hidden states of the body at the samples. clock, wall: (E,) s, what the
    recording's clock and a clock on the wall said at the episodes' starts. free: (K + 1, E) 0 from where a robot met
    itself or its limits.
    """

    fine: FloatArray
    h: float
    commands: FloatArray
    clean: FloatArray
    measured: FloatArray
    hidden: FloatArray
    clock: FloatArray
    wall: FloatArray
    free: FloatArray

    @property
    def per_sample(self) -> int:
        """Fine steps between two samples."""
        return (len(self.fine) - 1) // len(self.commands)

    @property
    def sampled(self) -> FloatArray:
        """(K + 1, E, S) true states at the samples."""
        return np.asarray(self.fine[:: self.per_sample])
