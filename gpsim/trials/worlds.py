"""What a concealed world is, as plain data: its system, its effects, how large things are in it, and what came of it.

Nothing here knows a law. The equations of motion are written as inverse mass matrix times generalised force, solved by
Cramer's rule; the simulators that will be diagnosed are written differently, on purpose.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np

from gpsim.channels import FloatArray

Values = Mapping[str, float]
"""Parameters of an effect: name -> value in SI units."""
Parameters = Mapping[str, float | FloatArray]
Stratum = Literal[
    "single", "pair", "triple", "none", "unknown", "words", "curves", "rough", "machines", "whole", "afloat",
    "plans"
]  # fmt: skip
STRATA: tuple[Stratum, ...] = ("single", "pair", "triple", "none", "unknown", "words")
Velocities = Literal["measured", "differentiated"] | None
FROM: dict[str, int] = {
    "words": 50_000, "curves": 75_000, "rough": 100_000, "robots": 200_000, "machines": 300_000, "whole": 400_000,
    "plans": 500_000, "afloat": 600_000,
}  # fmt: skip
"""Behind which number the worlds of a kind begin, so that those of the other kinds of a seed stay what they are.

Before them all are the decks of plain ones, which never come that far.
"""


def numbered(number: int) -> tuple[str, int]:
    """Of which kind of worlds a trial is, `plain` before those of FROM, and which of them, from 1."""
    kind = next((kind for kind, first in reversed(FROM.items()) if number > first), "plain")
    return kind, number - FROM.get(kind, 0)


@dataclass(frozen=True)
class Rough:
    """What is wrong with a recording besides noise; zero or absent where it is right.

    quantum: channel -> step of its encoder. jitter: standard deviation [s] of the stamps; drift: seconds that the
    recording's clock gains in a second. dropped, repeated, swapped: share of the rows that are missing, that say what
    the row before said, in which markers are swapped; leap: channel -> how far a swapped marker is away. late:
    channel -> s by which its topic lags behind the others.
    """

    quantum: Values = field(default_factory=dict)
    jitter: float = 0.0
    drift: float = 0.0
    dropped: float = 0.0
    repeated: float = 0.0
    swapped: float = 0.0
    leap: Values = field(default_factory=dict)
    late: Values = field(default_factory=dict)

    @property
    def defects(self) -> tuple[str, ...]:
        """What is wrong, in words."""
        order = ("quantum", "jitter", "drift", "dropped", "repeated", "swapped", "late")
        return tuple({"quantum": "quantised"}.get(name, name) for name in order if getattr(self, name))


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
    out_of_catalogue: bool = False
    strength: str = ""

    def acts(self, state: FloatArray, t: FloatArray, names: tuple[str, ...]) -> FloatArray:
        """(B,) 1 where and when it acts, else 0; state (B, S) has the columns `names`, t (B,) s."""
        mask = np.ones(len(t))
        for name, (low, high) in self.region.items():
            values = state[:, names.index(name)]
            mask = mask * ((values >= low) & (values <= high))
        return np.asarray(mask if self.since is None else mask * (t >= self.since), dtype=np.float64)

    @property
    def identity(self) -> tuple[str, str]:
        """What it is and where it acts."""
        return self.family, self.on

    @property
    def name(self) -> str:
        """The same in words."""
        return f"{self.family} on {self.on}"

    @property
    def gated(self) -> bool:
        """Whether it is limited in space or time."""
        return bool(self.region) or self.since is not None


@dataclass(frozen=True, kw_only=True)
class World:
    """A concealed world. Its randomness comes from (seed, number, attempt) alone."""

    seed: int
    number: int
    attempt: int
    stratum: Stratum
    long: bool = False
    system: str
    parameters: Values = field(default_factory=dict)  # the base simulator's
    integrator: str = "rk4"
    dt: float  # s
    engine: Literal["rk4", "mujoco"] = "rk4"
    effects: tuple[TrueEffect, ...] = ()
    episodes: int
    steps: int
    clock: Literal["session", "episode"] = "episode"
    excitation: str
    posture: str = ""  # upright, hanging (cart-pole)
    noise_level: str = "normal"
    noise: Values  # standard deviation by channel
    noise_known: bool
    velocities: Velocities
    smoothing: str = ""  # of differentiated velocities: central, savgol
    wrapped: bool = False  # yaw is written modulo 2 pi
    held_out: int | None = None  # episodes from this number on
    rough: Rough | None = None  # what is wrong with its log; of the strata `rough`, `machines`, `whole`
    machine: Machine | None = None  # of the stratum `machines`
    session: int = 0  # which of a machine's recordings this is

    @property
    def main(self) -> tuple[TrueEffect, ...]:
        """Effects of the catalogue."""
        return tuple(e for e in self.effects if not e.out_of_catalogue)

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
        driven = {name: getattr(own, name) for name in ("excitation", "posture", "episodes", "steps")}
        return replace(self, session=session, effects=effects, **driven)

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
        "outside": effect.out_of_catalogue,
        "strength": effect.strength,
    }


def world_json(world: World) -> dict[str, Any]:
    """Plain data: the world without its effects, which an answer lists apart."""
    rare = {"rough", "machine"}
    left_out = {"effects", "session", *(name for name in rare if getattr(world, name) is None)}
    return {k: _plain(v) for k, v in vars(world).items() if k not in left_out}


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {k: _plain(v) for k, v in value.items()}
    if isinstance(value, tuple):
        return [_plain(v) for v in value]
    return _plain(vars(value)) if isinstance(value, Rough | Machine | Session) else value


def world_from_json(data: Mapping[str, Any], effects: list[Mapping[str, Any]]) -> World:
    """The inverse of `world_json` and `effect_json`."""
    made = tuple(
        TrueEffect(
            e["family"], e["on"], e["parameters"], {k: (v[0], v[1]) for k, v in e["region"].items()},
            e["since"], e["outside"], e["strength"],
        )
        for e in effects
    )  # fmt: skip
    parts: dict[str, Any] = {"rough": Rough(**data["rough"])} if "rough" in data else {}
    if "machine" in data:
        sessions = tuple(Session(**s) for s in data["machine"]["sessions"])
        parts["machine"] = Machine(**{**data["machine"], "sessions": sessions})
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


@dataclass(frozen=True)
class System:
    """One system. parameters: name -> range of the base's value; steps: possible dt [s]; sensors: a decent one's noise.

    coordinates: the position channels, each followed by its velocity; empty for a vehicle. rates: what integration
    turns into the next state.
    """

    name: str
    state: Mapping[str, str]
    action: Mapping[str, str]
    coordinates: tuple[str, ...]
    rates: tuple[str, ...]
    parameters: Mapping[str, tuple[float, float]]
    steps: tuple[float, ...]
    sensors: Values

    @property
    def vehicle(self) -> bool:
        """Whether it moves in the plane and only its pose is measured."""
        return not self.coordinates

    @property
    def names(self) -> tuple[str, ...]:
        """State channels in column order."""
        return tuple(self.state)


SYSTEMS: Mapping[str, System] = {
    system.name: system
    for system in (
        System(
            "cartpole", {"x": "m", "x_dot": "m/s", "theta": "rad", "theta_dot": "rad/s"}, {"force": "N"},
            ("x", "theta"), ("x_acc", "theta_acc"),
            {"gravity": (9.8, 9.81), "cart_mass": (0.7, 1.5), "pole_mass": (0.1, 0.3), "pole_half_length": (0.3, 0.6)},
            (0.02, 0.02, 0.01), {"x": 0.0005, "x_dot": 0.005, "theta": 0.001, "theta_dot": 0.01},
        ),
        System(
            "slider", {"q": "m", "q_dot": "m/s"}, {"force": "N"}, ("q",), ("q_acc",), {"mass": (1.0, 4.0)},
            (0.02, 0.01), {"q": 0.0005, "q_dot": 0.005},
        ),
        System(
            "pendulum", {"theta": "rad", "theta_dot": "rad/s"}, {"torque": "N m"}, ("theta",), ("theta_acc",),
            {"gravity": (9.8, 9.81), "mass": (0.5, 1.5), "length": (0.3, 0.7)},
            (0.02, 0.02, 0.05), {"theta": 0.001, "theta_dot": 0.01},
        ),
        System(
            "unicycle", {"x": "m", "y": "m", "yaw": "rad"}, {"v_cmd": "m/s", "w_cmd": "rad/s"}, (),
            ("v", "v_lateral", "w"), {}, (0.1, 0.02), {"x": 0.002, "y": 0.002, "yaw": 0.004},
        ),
    )
}  # fmt: skip


def dynamics(system: str, p: Parameters, s: FloatArray, u: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Inverse mass matrix (B, C, C) and generalised forces (B, C) of state s (B, S) under the action u (B, A)."""
    if system == "slider":
        return np.broadcast_to(1.0 / np.asarray(p["mass"]), (len(s),)).reshape(-1, 1, 1), u.copy()
    if system == "pendulum":
        weight = p["mass"] * p["length"]
        inverse = np.broadcast_to(1.0 / np.asarray(weight * p["length"]), (len(s),)).reshape(-1, 1, 1)
        return inverse, (u[:, 0] - weight * p["gravity"] * np.sin(s[:, 0]))[:, None]
    lever = p["pole_mass"] * p["pole_half_length"]
    sin, cos = np.sin(s[:, 2]), np.cos(s[:, 2])
    across = lever * cos
    # A uniform rod of length 2 l about its end: m l^2 + m (2 l)^2 / 12.
    turning = lever * p["pole_half_length"] * (1.0 + 1.0 / 3.0)
    total = p["cart_mass"] + p["pole_mass"]
    determinant = total * turning - across**2
    inverse = np.empty((len(s), 2, 2))
    inverse[:, 0, 0], inverse[:, 1, 1] = turning / determinant, total / determinant
    inverse[:, 0, 1] = inverse[:, 1, 0] = -across / determinant
    forces = np.empty((len(s), 2))
    forces[:, 0] = u[:, 0] + lever * s[:, 3] ** 2 * sin
    forces[:, 1] = lever * p["gravity"] * sin
    return inverse, forces


def load_on_track(p: Parameters, s: FloatArray, acceleration: FloatArray) -> FloatArray:
    """(B,) N: the track's force on the cart, from the vertical acceleration of the pole's centre of mass."""
    half, m = p["pole_half_length"], p["pole_mass"]
    rise = -half * (acceleration[:, 1] * np.sin(s[:, 2]) + s[:, 3] ** 2 * np.cos(s[:, 2]))
    return np.asarray(p["cart_mass"] * p["gravity"] + m * (p["gravity"] + rise))


LEVELS = ("subtle", "medium", "plain")


@dataclass(frozen=True)
class Dial:
    """Draws numbers whose size follows one strength in [0, 1]."""

    rng: np.random.Generator
    strength: float

    @property
    def level(self) -> str:
        """The strength in words."""
        return LEVELS[min(int(3 * self.strength), 2)]

    def size(self, low: float, high: float) -> float:
        """Between low (subtle) and high (plain), evenly in the logarithm."""
        return float(rounded(low * (high / low) ** self.strength))

    def any(self, low: float, high: float) -> float:
        """Between low and high whatever the strength."""
        return float(rounded(self.rng.uniform(low, high)))

    def sign(self) -> float:
        """-1 or 1."""
        return 1.0 if self.rng.random() < 0.5 else -1.0

    def ratio(self, low: float, high: float) -> float:
        """A factor above or below 1, off by between low and high."""
        off = self.size(low, high)
        return float(rounded(1.0 + off if self.rng.random() < 0.5 else 1.0 - off))


@dataclass(frozen=True)
class Scales:
    """How large things are in a run of the base system under the world's excitation."""

    world: World
    pilot: Run

    @cached_property
    def names(self) -> tuple[str, ...]:
        """State channels in column order."""
        return SYSTEMS[self.world.system].names

    @cached_property
    def actions(self) -> tuple[str, ...]:
        """Commands in column order."""
        return tuple(SYSTEMS[self.world.system].action)

    @cached_property
    def _columns(self) -> FloatArray:
        states = self.pilot.clean[:-1]
        return states.reshape(-1, states.shape[2])

    def column(self, name: str) -> FloatArray:
        """(N,) all values of a state channel."""
        return np.asarray(self._columns[:, self.names.index(name)])

    def reach(self, name: str) -> float:
        """Standard deviation of a channel; of a vehicle's positions, which wander, that of all episodes together."""
        return float(np.std(self.column(name)))

    def speed(self, coordinate: str) -> float:
        """Root mean square velocity of a coordinate."""
        return float(np.sqrt(np.mean(self._columns[:, self.names.index(coordinate) + 1] ** 2)))

    def command(self, name: str) -> FloatArray:
        """(N,) all values of a command."""
        return self.pilot.commands[..., self.actions.index(name)].ravel()

    def action(self, name: str) -> float:
        """What 95 % of the commands stay below."""
        return float(np.quantile(np.abs(self.command(name)), 0.95))

    def force(self, coordinate: str) -> float:
        """Root mean square of the generalised force that would move the coordinate alone as it moved."""
        system = SYSTEMS[self.world.system]
        actions = self.pilot.commands.reshape(-1, len(system.action))
        inverse, force = dynamics(system.name, self.world.parameters, self._columns, actions)
        acceleration = (inverse * force[:, None, :]).sum(axis=2)
        c = system.coordinates.index(coordinate)
        return float(np.sqrt(np.mean((acceleration[:, c] / inverse[:, c, c]) ** 2)))

    def inertia(self, coordinate: str) -> float:
        """What a force on a coordinate alone has to move; of a cart-pole with the pole up, where that is least."""
        system = SYSTEMS[self.world.system]
        rest = np.zeros((1, len(system.state)))
        inverse, _ = dynamics(system.name, self.world.parameters, rest, np.zeros((1, 1)))
        c = system.coordinates.index(coordinate)
        return 1.0 / float(inverse[0, c, c])

    @property
    def duration(self) -> float:
        """The last moment [s] of the recording's clock."""
        return float(self.world.clock_offsets[-1] + self.world.steps * self.world.dt)

    @property
    def wall(self) -> float:
        """All episodes together [s]."""
        return float(self.world.offsets[-1] + self.world.steps * self.world.dt)


def rounded(value: float) -> float:
    """Four significant digits, so that the answers can be read."""
    return float(f"{value:.4g}")


def log_even(rng: np.random.Generator, low: float, high: float) -> float:
    """Between, evenly in the logarithm."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def waves(s: Scales, on: str, d: Dial, low: float, high: float) -> dict[str, float]:
    """A wave number with `low` to `high` periods over two standard deviations either side, and a phase."""
    return {
        "wave_number": rounded(2 * np.pi * d.any(low, high) / (4 * s.reach(on))),
        "phase": d.any(0, 2 * np.pi),
    }
