"""Equivalents of a rough world's main effects: those of the same world without nuisances and without a rough log."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gpsim.channels import FloatArray
from gpsim.diagnosis.fitting import Candidate, Directions, Fit, Hypothesis, Problem, fit, screened
from gpsim.diagnosis.setup import candidates, prepare, spread_out
from gpsim.effects import Gate
from gpsim.recordings import Recording
from gpsim.simulators import make_simulator
from gpsim.trials.blinding import Answer, even_recording
from gpsim.trials.rivals.local_search import continued, replaced_near
from gpsim.trials.truth import run
from gpsim.trials.worlds import TrueEffect, World, effect_json, sound, world_json


def rough_rivals(answer: Answer) -> list[Rival]:
    """All that were fitted, the best first.

    The yardstick is the noise of the sensors, their steps and what the nuisances leave of a rollout: what changes less
    than that cannot be told.
    """
    world = main_world(answer)
    truth = run(world, world.effects)
    recording = even_recording(world, truth.clean, truth, np.asarray(sound(world, truth.sampled)))
    clean = [episode.states for episode in recording.episodes]
    content = {"world": world_json(world), "effects": [effect_json(e) for e in world.effects]}
    return rivals(Answer(content, clean, answer.own, answer.episode), recording)


def main_world(answer: Answer) -> World:
    """The world with its main effects alone, an even log, and noise that stands for all that was taken away."""
    world = answer.world
    steps = world.rough.quantum if world.rough else {}
    left = answer.content["machine" if world.machine else "rough"]["left"]
    noise = {
        n: float(np.sqrt(sd**2 + steps.get(n, 0.0) ** 2 / 12.0 + left.get(n, 0.0) ** 2))
        for n, sd in world.noise.items()
    }
    return replace(world, effects=world.main, rough=None, noise=noise)


# Kept lists of equivalents hold for one version. Raise it whenever `rivals` may list something else (the rule or its
# constants, the catalogue, the fitting engine have changed) and when `sindy.name` may say something else.
EQUIVALENTS_VERSION = 6
LOST = 3.0  # nats
WINDOWS, FITTED = 60, 10
PROMISING = 0.02  # share of a parent's misfit that a replacement must explain by the linear estimate
UNEXPLAINED = 0.2  # share of the misfit that the engine's error may leave of a truth
NUMERICAL = 1000.0  # nats of it
EXPANDED = 6  # equivalents that get rivals of their own
Claims = tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Rival:
    """Families and places, and the nats of expected log likelihood that they lose against the truth."""

    claims: Claims
    loss: float
    richer: bool

    @property
    def equivalent(self) -> bool:
        """Whether no recording of the kind could tell it from the truth.

        One that gains does so on the engine's numerical error, which is all that is left between the two.
        """
        return self.loss < LOST and not self.richer


def rivals(answer: Answer, recording: Recording) -> list[Rival]:
    """All that were fitted, the best first. `recording` is the public one; its readings are replaced by clean ones."""
    world = answer.world
    if not world.effects:
        return []
    clean = replace(
        recording,
        episodes=tuple(replace(e, states=s) for e, s in zip(recording.episodes, answer.clean, strict=True)),
        noise=dict(world.noise),
        held_out=None,
    )
    simulator = make_simulator(world.system)
    parameters = simulator.defaults(clean.parameters)
    problem = prepare(clean, simulator, parameters).everything
    problem = problem.on(spread_out(problem.windows, WINDOWS, problem.run.settings.prepare.fewest))
    judge = _Judge(problem, candidates(clean, simulator, parameters), clean.transition_count)
    best: dict[Claims, Rival] = {}
    for rival in judge.rivals(world.effects):
        if rival.claims not in best or rival.loss < best[rival.claims].loss:
            best[rival.claims] = rival
    return sorted(best.values(), key=lambda r: r.loss)


class _Judge:
    """Fits hypotheses to the clean windows and tells what they lose."""

    def __init__(self, problem: Problem, offers: Sequence[Candidate], transitions: int) -> None:
        self._problem, self._offers = problem, offers
        self._whole = max(transitions / max(float(problem.windows.valid[:, 1:].sum()), 1.0), 1.0)

    def rivals(self, effects: Sequence[TrueEffect]) -> list[Rival]:
        """Every rival that was fitted."""
        inside = [e for e in effects if not e.outside]
        found: list[Fit] = []
        for dropped in effects:
            parent = self._fitted(self._hypothesis([e for e in inside if e is not dropped]))
            own = None if dropped.outside else (dropped.family, dropped.on)
            found += [parent, *self._replacements(parent, own, Gate(dropped.region, dropped.since))]
        size = sum(len(e.values) for e in effects)
        if len(inside) < len(effects):
            return self._judged(found, 0.0, size)
        truth = self._hypothesis(inside)
        fitted = self._fitted(truth)
        if not self._explains(fitted):
            return []
        found += self._near(fitted)
        least = self._least(truth, fitted, found)
        equal = [f for f in self._as_good(found, least, size) if f.hypothesis.terms]
        for rival in equal[:EXPANDED]:
            for i, term in enumerate(rival.hypothesis.terms):
                parent = self._fitted(rival.hypothesis.without(i))
                others = self._replacements(parent, term.identity, term.gate)
                found += [f for f in (parent, *others) if f.hypothesis.claims != truth.claims]
            found += [f for f in self._near(rival) if f.hypothesis.claims != truth.claims]
        return self._judged(found, self._least(truth, fitted, found), size)

    def _near(self, at: Fit) -> list[Fit]:
        found = replaced_near(self._problem, self._offers, at) + continued(self._problem, self._offers, at)
        return [f for f in found if not any(_a_patch(t.family, t.on, t.gate) for t in f.hypothesis.terms)]

    def _hypothesis(self, effects: Sequence[TrueEffect]) -> Hypothesis:
        return as_hypothesis(effects, self._offers)

    def _explains(self, truth: Fit) -> bool:
        """Whether the answer explains its own recording; of one that does not nothing can be said."""
        left, all_ = self._misfit(truth), self._misfit(self._fitted(Hypothesis(scheme="fine")))
        return left < UNEXPLAINED * all_ or self._whole * left < NUMERICAL

    def _judged(self, found: Sequence[Fit], least: float, size: int) -> list[Rival]:
        return [
            Rival(
                _claims(f.hypothesis),
                round(self._whole * (self._misfit(f) - least), 3),
                len(f.hypothesis.parameters) > size,
            )
            for f in found
        ]

    def _as_good(self, found: Sequence[Fit], least: float, size: int) -> list[Fit]:
        """Those that lose nothing, one for each set of claims, the best first.

        Richer ones, too: without another term one of them may be as simple as the truth (an asymmetry of two pushes is
        a gain and a bias).
        """
        best: dict[Claims, Fit] = {}
        for rival, f in zip(self._judged(found, least, size), found, strict=True):
            if rival.loss < LOST and (
                rival.claims not in best or self._misfit(f) < self._misfit(best[rival.claims])
            ):
                best[rival.claims] = f
        return sorted(best.values(), key=self._misfit)

    def _least(self, truth: Hypothesis, fitted: Fit, found: Sequence[Fit]) -> float:
        """The truth's own misfit: the engine's numerical error. A rival that beats it shows where its fit got stuck."""
        own, best = self._misfit(fitted), min(found, key=self._misfit)
        if own - self._misfit(best) < LOST / self._whole:
            return own
        return min(own, self._misfit(fit(self._problem, truth, best.starts, iterations=30, tolerance=0.01)))

    def _replacements(self, parent: Fit, own: tuple[str, str] | None, gate: Gate) -> list[Fit]:
        """The parent with one more of what is not there yet, behind the gate of the effect that is gone, too."""
        taken = parent.hypothesis.claims | ({own} if own else frozenset())
        offers = [c for c in self._offers if c.identity not in taken and not c.only_gated]
        directions = Directions(self._problem, parent)
        ranking = screened(directions, offers)
        needed = PROMISING * 0.5 * float((directions.rest**2).sum())
        out = []
        for worth, candidate, start in ranking[:FITTED]:
            term = candidate.term(start)
            if worth > needed:
                out.append(self._fitted(parent.hypothesis.plus(term, candidate.declared)))
            if gate and candidate.gateable and not _a_patch(candidate.family, candidate.place.on, gate):
                gated = replace(term, gate=gate)
                out.append(self._fitted(parent.hypothesis.plus(gated, candidate.declared)))
        return out

    def _fitted(self, hypothesis: Hypothesis) -> Fit:
        starts: FloatArray = self._problem.windows.measured[:, 0]
        return fit(self._problem, hypothesis, starts, iterations=14, tolerance=0.05)

    def _misfit(self, found: Fit) -> float:
        """Half the sum of squares in standard deviations of the world's noise."""
        seen = self._problem.observed
        return float(0.5 * ((found.residuals[..., seen] / self._problem.floor[seen]) ** 2).sum())


def as_hypothesis(effects: Sequence[TrueEffect], offers: Sequence[Candidate]) -> Hypothesis:
    """Effects of the catalogue with their true values and gates, finely integrated; offers hold their places."""
    out = Hypothesis(scheme="fine")
    for effect in effects:
        variant = "coefficient" if "coefficient" in effect.values else ""
        candidate = next(
            c for c in offers if c.identity == (effect.family, effect.on) and c.variant == variant
        )
        values = [effect.values[p.name] for p in candidate.declared]
        term = replace(candidate.term(values), gate=Gate(effect.region, effect.since))
        # The truth may lie where the catalogue would not search.
        wide = [
            replace(p, low=min(p.low, v), high=max(p.high, v))
            for p, v in zip(candidate.declared, values, strict=True)
        ]
        out = out.plus(term, tuple(wide))
    return out


def _a_patch(family: str, on: str, gate: Gate) -> bool:
    """Coulomb friction in a region of its own coordinate is a patch by another name, and nobody says it so."""
    return family == "coulomb_friction" and on in gate.region


def _claims(hypothesis: Hypothesis) -> Claims:
    return tuple(sorted(term.identity for term in hypothesis.terms))
