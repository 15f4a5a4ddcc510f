"""Which effects of a machine could be seen, and whether what was said instead of one explains as much.

The yardstick is that of rough worlds: the machine with its own effects alone, noise-free, with the noise of the
sensors, their steps and what the nuisances leave. Every fit starts at the truth. An effect could be seen where the
truth without it, all others fitted anew, loses 3 nats or more. What was said stands for an effect where the truth with
the one in the other's place, fitted anew, loses less; one after the other, so that two may have changed places.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from gpsim.channels import FloatArray
from gpsim.diagnosis.fitting import Fit
from gpsim.recordings import Recording, read_recording
from gpsim.simulators import Simulator, make_simulator
from gpsim.trials.blinding import PUBLIC, Answer, recording_folders
from gpsim.trials.rivals.fits import (
    LOST,
    Fits,
    Identity,
    clean_recording,
    main_world,
    opened_model,
    rollouts_over_truth,
    without_noise,
)
from gpsim.trials.rivals.kept import (
    Json,
    as_true,
    digests_of,
    in_short,
    kept_or_made,
    ratios_from,
    said_of,
)
from gpsim.trials.worlds import TrueEffect, World, effect_json

VERSION = 2  # of the rules: raise it whenever something else may come of them
WINDOWS, HOW = 80, (20, 0.02)  # iterations and tolerance of a fit
MOST_TRIED = 4  # claims that are no effect of the truth, which are tried in the others' places


@dataclass(frozen=True)
class Seen:
    """Of one effect of the truth, what it loses when it is left out and the others are fitted anew.

    nats: of the whole recording; share: of the misfit of the bare simulator; beyond: what is off then, root mean square
    in standard deviations of the sensors' noise, in the channel where that is most.
    """

    nats: float
    share: float
    beyond: float


@dataclass(frozen=True)
class Standing:
    """stands: a claim -> the effect of the truth that it stands for; effects: the truth with those in their places."""

    stands: dict[Identity, Identity]
    effects: tuple[TrueEffect, ...]


class MachineJudge:
    """Fits explanations to the noise-free windows.

    recording: the clean one, with the yardstick as its noise; sensors: channel -> its noise alone.
    """

    def __init__(
        self,
        recording: Recording,
        simulator: Simulator,
        truth: Sequence[TrueEffect],
        sensors: Mapping[str, float],
    ) -> None:
        self._fits, self._effects = Fits(recording, simulator, WINDOWS, HOW), tuple(truth)
        observed, floor = self._fits.problem.observed, self._fits.problem.floor
        names = np.array(simulator.state.names)[observed]
        self._louder = floor[observed] / np.array([sensors[name] for name in names])
        self._own = self._fits.squares(self._fits.of(truth))
        self._none = float(self._fits.squares(self._fits.of(())).sum())

    @cached_property
    def seen(self) -> tuple[Seen, ...]:
        """Of every effect of the truth."""
        return tuple(self._seen([e for e in self._effects if e is not effect]) for effect in self._effects)

    def standing(self, said: Sequence[TrueEffect]) -> Standing:
        """Which claims that are no effect of the truth stand for one that could be seen and was not told."""
        own, claims = {_identity(e) for e in self._effects}, {_identity(e) for e in said}
        strange = [e for e in said if self._fits.known([e]) and _identity(e) not in own and not e.gated]
        pairs = zip(self._effects, self.seen, strict=True)
        untold = {_identity(e) for e, seen in pairs if seen.nats >= LOST} - claims
        standing = Standing({}, self._effects)
        for claim in strange[:MOST_TRIED]:
            standing = self._with(claim, standing, untold - set(standing.stands.values()))
        return standing

    def _with(self, claim: TrueEffect, standing: Standing, untold: set[Identity]) -> Standing:
        """The same with the claim in the place of the first effect for which it stands, if there is one."""
        for effect in [e for e in standing.effects if _identity(e) in untold]:
            if len(claim.values) > len(effect.values):  # a richer one holds the truth as a special case
                continue
            tried = [claim if e is effect else e for e in standing.effects]
            found = self._fits.of(tried)
            if self._lost(found) < LOST:
                pairs = zip(tried, found.hypothesis.terms, strict=True)
                stands = {**standing.stands, _identity(claim): _identity(effect)}
                return Standing(stands, tuple(replace(e, values=dict(t.values)) for e, t in pairs))
        return standing

    def equivalent(self, said: Sequence[TrueEffect]) -> bool:
        """Whether a whole explanation with no more parameters loses nothing."""
        if not said or not self._fits.known(said) or any(e.gated for e in said):
            return False
        poorer = sum(len(e.values) for e in said) <= sum(len(e.values) for e in self._effects)
        return poorer and self._lost(self._fits.of(said)) < LOST

    def _seen(self, rest: Sequence[TrueEffect]) -> Seen:
        squares = self._fits.squares(self._fits.of(rest))
        more: FloatArray = np.maximum(squares - self._own, 0.0)
        missing = max(self._none - float(self._own.sum()), 1e-12)
        return Seen(
            round(self._fits.whole * 0.5 * float((squares - self._own).sum()), 3),
            round(min(float(more.sum()) / missing, 1.0), 6),
            round(float(np.sqrt((more * self._louder**2).max() / self._fits.count)), 4),
        )

    def _lost(self, found: Fit) -> float:
        """Nats of the whole recording, against the truth."""
        return self._fits.whole * 0.5 * float((self._fits.squares(found) - self._own).sum())


def _identity(effect: TrueEffect) -> Identity:
    return effect.family, effect.on


@dataclass(frozen=True)
class MachineListing:
    """seen: of every own effect of the machine, in the answer's order; stands: claim -> the effect that it stands for.

    values: the true values of all effects, or, where one stands for another, those that go with it; equivalent: of the
    leader and of every alternative, whether it loses nothing as a whole; rollouts: channel -> error over the truth's.
    """

    seen: tuple[Seen, ...]
    stands: Mapping[Identity, Identity]
    values: tuple[Json, ...]
    equivalent: tuple[bool, ...]
    rollouts: Mapping[str, float]


def machine_listing(
    out: Path, name: str, answer: Answer, outcome: Json, report: Json | None
) -> MachineListing:
    """The listing of a revealed diagnosis, from OUT/equivalents or made now and kept there."""
    said = said_of(report)
    told = [list(map(in_short, effects)) for effects in said]
    follows_from = {"machine_version": VERSION, **digests_of(outcome), "said": told}
    kept = kept_or_made(out, name, follows_from, lambda: _made(out / PUBLIC / name, answer, report, said))
    return MachineListing(
        tuple(Seen(**s) for s in kept["seen"]),
        {(a, b): (c, d) for (a, b), (c, d) in kept["stands"]},
        tuple(kept["values"]),
        tuple(kept["equivalent"]),
        ratios_from(kept),
    )


def _made(
    public: Path, answer: Answer, report: Json | None, said: Sequence[Sequence[Json]]
) -> dict[str, Any]:
    started, world = time.monotonic(), answer.world
    clean, recording, simulator = _opened(answer, recording_folders(public)[0])
    judge = MachineJudge(clean, simulator, world.main, _sensors(world))
    explanations = [list(map(as_true, effects)) for effects in said]
    leader = explanations[0] if explanations else []
    standing = judge.standing(leader)
    held = [] if report is None else [str(n) for n in report["fit"]["held_out"]]
    rollouts = rollouts_over_truth(recording, simulator, held, world.main, leader)
    return {
        "seen": [asdict(s) for s in judge.seen],
        "stands": [[list(claim), list(effect)] for claim, effect in standing.stands.items()],
        "values": [effect_json(e) for e in standing.effects],
        "equivalent": [judge.equivalent(effects) for effects in explanations],
        "rollouts": rollouts,
        "seconds": round(time.monotonic() - started, 2),
    }


def _opened(answer: Answer, folder: Path) -> tuple[Recording, Recording, Simulator]:
    """The recording without noise and as it was published, and the simulator that is believed."""
    published = read_recording(folder)
    if published.model is None:
        world = main_world(answer)
        yardstick = replace(without_noise(world), noise=dict(world.noise), held_out=None)
        return yardstick, published, make_simulator(answer.world.system)
    return clean_recording(answer, folder)[0], *opened_model(folder)


def _sensors(world: World) -> dict[str, float]:
    """Channel -> noise of its sensor, and of the steps in which it counts."""
    steps = world.rough.quantum if world.rough else {}
    return {n: float(np.hypot(sd, steps.get(n, 0.0) / np.sqrt(12.0))) for n, sd in world.noise.items()}
