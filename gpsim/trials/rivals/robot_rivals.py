"""Equivalents of a robot's world: of what was said instead of the truth, whether it explains the truth as well.

The yardstick is the other worlds' (`equivalents`): fitted to the noise-free readings with the world's own noise, an
explanation with no more parameters that loses less than 3 nats over the whole recording could not be told from the
truth by anybody. A robot has a hundred candidates and minutes a list, so only what a diagnosis said is judged: its
leader and its alternatives, from its own values.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from gpsim.channels import FloatArray
from gpsim.diagnosis.fitting import Fit, Hypothesis, Problem, fit
from gpsim.diagnosis.setup import candidates, prepare, spread_out
from gpsim.mjcf import in_its_columns, open_simulator
from gpsim.recordings import Recording, read_recording
from gpsim.simulators import Simulator
from gpsim.trials.blinding import PUBLIC, Answer
from gpsim.trials.rivals.equivalents import NUMERICAL, UNEXPLAINED, Claims, Rival, as_hypothesis
from gpsim.trials.rivals.kept import as_true, in_short, kept_or_made, place_of, said_of
from gpsim.trials.worlds import TrueEffect

VERSION = 1  # of the rule: raise it whenever another list may come of it
WINDOWS, ITERATIONS, TOLERANCE = 80, 30, 0.01
Json = Mapping[str, Any]


def robot_rivals(out: Path, name: str, answer: Answer, outcome: Json, report: Json | None) -> list[Rival]:
    """What was said and is not the truth, each judged; kept in OUT/equivalents/NAME.json for the same answer."""
    truth = claims_of(answer.content["effects"])
    said = {claims_of(effects): effects for effects in said_of(report)}
    others = [effects for claims, effects in said.items() if claims and claims != truth]
    if not others or not answer.world.effects:
        return []
    follows_from = {
        "robot_version": VERSION,
        "answer_sha256": outcome["answer_sha256"],
        "recording": outcome["recording"],
        "said": [in_short(e) for effects in others for e in effects],
    }

    def make() -> dict[str, Any]:
        judge = Judge(answer, out / PUBLIC / name)
        return {
            "rivals": [
                {"claims": list(map(list, r.claims)), "nats_lost": r.loss, "richer": r.richer}
                for r in map(judge.judged, others)
            ]
        }

    kept = kept_or_made(out, name, follows_from, make)
    return sorted(map(_rival, kept["rivals"]), key=lambda r: r.loss)


def clean_recording(answer: Answer, public: Path) -> tuple[Recording, Simulator]:
    """The recording as perfect sensors would have made it, with the world's own noise as known; and its simulator."""
    recording = read_recording(public)
    simulator = open_simulator(str(public / str(recording.model)))
    clean = replace(
        recording,
        episodes=tuple(replace(e, states=s) for e, s in zip(recording.episodes, answer.clean, strict=True)),
        noise={n: sd for n, sd in answer.world.noise.items() if n in recording.state.names},
        held_out=None,
    )
    return in_its_columns(clean, simulator), simulator


class Judge:
    """Fits explanations to the noise-free readings of a robot's world and tells what they lose against the truth."""

    def __init__(self, answer: Answer, public: Path) -> None:
        world = answer.world
        clean, simulator = clean_recording(answer, public)
        question = prepare(clean, simulator, simulator.defaults())
        problem = question.everything
        self._problem: Problem = problem.on(
            spread_out(problem.windows, WINDOWS, problem.run.settings.prepare.fewest)
        )
        self._offers = candidates(question.recording, self._problem.simulator, self._problem.parameters)
        used = max(float(self._problem.windows.valid[:, 1:].sum()), 1.0)
        self._whole = max(clean.transition_count / used, 1.0)
        self._truth, self._size = world.effects, sum(len(e.values) for e in world.effects)
        self._own: float | None = None

    def judged(self, effects: Sequence[Json]) -> Rival:
        """An explanation as a report has it. Where the engine cannot explain the truth itself it loses everything."""
        claims, said = claims_of(effects), [as_true(e) for e in effects]
        richer = sum(len(e.values) for e in said) > self._size
        own = self._misfit_of_truth()
        hypothesis = self._hypothesis(said)
        if own is None or hypothesis is None:
            return Rival(claims, math.inf, richer)
        return Rival(claims, round(self._whole * (self._misfit(self._fitted(hypothesis)) - own), 3), richer)

    def _misfit_of_truth(self) -> float | None:
        """The truth's own: the engine's numerical error. None where that is too large for anything to be said."""
        if self._own is None:
            truth = self._hypothesis(self._truth)
            self._own = math.inf if truth is None else self._misfit(self._fitted(truth))
            nothing = self._misfit(self._fitted(Hypothesis(scheme="fine")))
            if self._own > UNEXPLAINED * nothing and self._whole * self._own > NUMERICAL:
                self._own = math.inf
        return None if math.isinf(self._own) else self._own

    def _hypothesis(self, effects: Sequence[TrueEffect]) -> Hypothesis | None:
        known = {c.identity for c in self._offers}
        if any((e.family, e.on) not in known for e in effects):
            return None
        return as_hypothesis(effects, self._offers)

    def _fitted(self, hypothesis: Hypothesis) -> Fit:
        starts: FloatArray = self._problem.windows.measured[:, 0]
        return fit(self._problem, hypothesis, starts, iterations=ITERATIONS, tolerance=TOLERANCE)

    def _misfit(self, found: Fit) -> float:
        """Half the sum of squares in standard deviations of the world's noise."""
        seen = self._problem.observed
        return float(0.5 * ((found.residuals[..., seen] / self._problem.floor[seen]) ** 2).sum())


def claims_of(effects: Sequence[Json]) -> Claims:
    """Families and places; several places are joined."""
    return tuple(sorted((str(e["family"]), place_of(e["on"])) for e in effects))


def _rival(kept: Json) -> Rival:
    loss = math.inf if kept["nats_lost"] is None else float(kept["nats_lost"])
    return Rival(tuple((f, on) for f, on in kept["claims"]), loss, bool(kept["richer"]))
