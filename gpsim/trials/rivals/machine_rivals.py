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
from gpsim.diagnosis.fitting import Fit, Hypothesis, Problem, fit
from gpsim.diagnosis.setup import candidates, prepare, spread_out
from gpsim.mjcf import in_its_columns
from gpsim.recordings import Recording, read_recording
from gpsim.simulators import Simulator, make_simulator
from gpsim.trials.blinding import PUBLIC, Answer, even_recording, recording_folders
from gpsim.trials.rivals.equivalents import LOST, as_hypothesis, main_world
from gpsim.trials.rivals.held_out_rollouts import rollouts_over_truth
from gpsim.trials.rivals.kept import as_true, in_short, kept_or_made, said_of
from gpsim.trials.rivals.robot_rivals import clean_recording
from gpsim.trials.truth import run
from gpsim.trials.worlds import TrueEffect, World, effect_json, sound

WINDOWS, ITERATIONS, TOLERANCE = 80, 20, 0.02
MOST_TRIED = 4  # claims that are no effect of the truth, which are tried in the others' places
Identity = tuple[str, str]


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
        question = prepare(recording, simulator, simulator.defaults(recording.parameters))
        problem: Problem = question.everything
        self._problem = problem.on(spread_out(problem.windows, WINDOWS, problem.run.settings.prepare.fewest))
        self._offers = candidates(question.recording, problem.simulator, problem.parameters)
        used = max(float(self._problem.windows.valid[:, 1:].sum()), 1.0)
        self._whole = max(recording.transition_count / used, 1.0)
        self._effects = tuple(truth)
        names = np.array(simulator.state.names)[problem.observed]
        self._louder = problem.floor[problem.observed] / np.array([sensors[name] for name in names])
        self._own = self._squares(self._fitted(truth))
        self._none = float(self._squares(self._fitted(())).sum())

    @cached_property
    def seen(self) -> tuple[Seen, ...]:
        """Of every effect of the truth."""
        return tuple(self._seen([e for e in self._effects if e is not effect]) for effect in self._effects)

    def standing(self, said: Sequence[TrueEffect]) -> Standing:
        """Which claims that are no effect of the truth stand for one that could be seen and was not told."""
        known, claims = {c.identity for c in self._offers}, {_identity(e) for e in said}
        own = {_identity(e) for e in self._effects}
        strange = [e for e in said if _identity(e) in known - own and not e.gated]
        untold = {
            _identity(e)
            for e, seen in zip(self._effects, self.seen, strict=True)
            if seen.nats >= LOST and _identity(e) not in claims
        }
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
            found = self._fitted(tried)
            if self._lost(found) < LOST:
                stands = {**standing.stands, _identity(claim): _identity(effect)}
                return Standing(stands, _fitted_values(tried, found))
        return standing

    def equivalent(self, said: Sequence[TrueEffect]) -> bool:
        """Whether a whole explanation with no more parameters loses nothing."""
        known = {c.identity for c in self._offers}
        if not said or any(_identity(e) not in known or e.gated for e in said):
            return False
        poorer = sum(len(e.values) for e in said) <= sum(len(e.values) for e in self._effects)
        return poorer and self._lost(self._fitted(said)) < LOST

    def _seen(self, rest: Sequence[TrueEffect]) -> Seen:
        squares = self._squares(self._fitted(rest))
        more = np.maximum(squares - self._own, 0.0)
        missing = max(self._none - float(self._own.sum()), 1e-12)
        count = max(float(self._problem.windows.valid[:, 1:].sum()), 1.0)
        return Seen(
            round(self._whole * 0.5 * float((squares - self._own).sum()), 3),
            round(min(float(more.sum()) / missing, 1.0), 6),
            round(float(np.sqrt((more * self._louder**2).max() / count)), 4),
        )

    def _lost(self, found: Fit) -> float:
        """Nats of the whole recording, against the truth."""
        return self._whole * 0.5 * float((self._squares(found) - self._own).sum())

    def _fitted(self, effects: Sequence[TrueEffect]) -> Fit:
        starts: FloatArray = self._problem.windows.measured[:, 0]
        hypothesis: Hypothesis = as_hypothesis(effects, self._offers)
        return fit(self._problem, hypothesis, starts, iterations=ITERATIONS, tolerance=TOLERANCE)

    def _squares(self, found: Fit) -> FloatArray:
        """(C,) sums of squares in standard deviations of the yardstick."""
        seen = self._problem.observed
        scaled = found.residuals[..., seen] / self._problem.floor[seen]
        return np.asarray((scaled**2).sum(axis=tuple(range(scaled.ndim - 1))))


def _identity(effect: TrueEffect) -> Identity:
    return effect.family, effect.on


def _fitted_values(effects: Sequence[TrueEffect], found: Fit) -> tuple[TrueEffect, ...]:
    """The effects with the values that they were fitted to."""
    terms = found.hypothesis.terms
    return tuple(replace(e, values=dict(t.values)) for e, t in zip(effects, terms, strict=True))


VERSION = 2  # of the rules: raise it whenever something else may come of them
Json = Mapping[str, Any]


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
    follows_from = {
        "machine_version": VERSION,
        "answer_sha256": outcome["answer_sha256"],
        "recording": outcome["recording"],
        "said": [list(map(in_short, effects)) for effects in said],
    }
    kept = kept_or_made(out, name, follows_from, lambda: _made(out / PUBLIC / name, answer, report, said))
    return MachineListing(
        tuple(Seen(**s) for s in kept["seen"]),
        {(a, b): (c, d) for (a, b), (c, d) in kept["stands"]},
        tuple(kept["values"]),
        tuple(kept["equivalent"]),
        {k: float("inf") if v is None else v for k, v in kept["rollouts"].items()},
    )


def _made(
    public: Path, answer: Answer, report: Json | None, said: Sequence[Sequence[Json]]
) -> dict[str, Any]:
    started, world, folder = time.monotonic(), answer.world, recording_folders(public)[0]
    clean, recording, simulator = _opened(answer, folder)
    judge = MachineJudge(clean, simulator, world.main, _sensors(world))
    explanations = [list(map(as_true, effects)) for effects in said]
    leader = explanations[0] if explanations else []
    standing = judge.standing(leader)
    rollouts: dict[str, float] = {}
    if report is not None:
        held = [str(n) for n in report["fit"]["held_out"]]
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
        return _yardstick(answer), published, make_simulator(answer.world.system)
    clean, simulator = clean_recording(answer, folder)
    return clean, in_its_columns(published, simulator), simulator


def _yardstick(answer: Answer) -> Recording:
    """The noise-free recording of the machine with its own effects alone, and noise that stands for all else."""
    world = main_world(answer)
    truth = run(world, world.effects)
    recording = even_recording(world, truth.clean, truth, np.asarray(sound(world, truth.sampled)))
    return replace(recording, noise=dict(world.noise), held_out=None)


def _sensors(world: World) -> dict[str, float]:
    """Channel -> noise of its sensor, and of the steps in which it counts."""
    steps = world.rough.quantum if world.rough else {}
    return {n: float(np.hypot(sd, steps.get(n, 0.0) / np.sqrt(12.0))) for n, sd in world.noise.items()}
