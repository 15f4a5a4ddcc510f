"""Fitting explanations to a recording without noise, and telling what they lose against the truth; and what is kept.

The yardstick of every rule for equivalents: what loses less than 3 nats over the whole recording, with the noise that
is stated, could not be told from the truth by anybody. Only this and what rests on it fits with the diagnosis's engine,
after the reveal. What is dear to find out about a trial is kept in OUT/equivalents/NAME.json, for what it follows from.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from gpsim.channels import FloatArray
from gpsim.corrected import EffectsPlant
from gpsim.diagnosis import score
from gpsim.diagnosis.fitting import Candidate, Fit, Hypothesis, Noise, Problem, fit
from gpsim.diagnosis.setup import Question, candidates, prepare, spread_out
from gpsim.effects import Gate, closed
from gpsim.files import plain, write_json, written_whole
from gpsim.mjcf import in_its_columns, open_simulator
from gpsim.recordings import HeldOut, Recording, read_recording
from gpsim.simulators import Simulator, make_simulator
from gpsim.trials.blinding import Answer
from gpsim.trials.concealing import even_recording
from gpsim.trials.driving import sound
from gpsim.trials.truth import run
from gpsim.trials.worlds import TrueEffect, World

LOST = 3.0  # nats
UNEXPLAINED = 0.2  # share of the misfit that the engine's error may leave of a truth
NUMERICAL = 1000.0  # nats of it
ROUNDS, TOLERANCE = 20, 0.02  # of a truth whose rollouts are judged
Identity = tuple[str, str]
Claims = tuple[Identity, ...]
Json = Mapping[str, Any]


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


class Fits:
    """Fits of explanations to some windows of a recording without noise.

    how: rounds and tolerance of a fit. offers: what may be an effect; by default what a diagnosis of the prepared
    recording would try.
    """

    def __init__(
        self, recording: Recording, simulator: Simulator, windows: int, how: tuple[int, float],
        offers: Sequence[Candidate] | None = None,
    ) -> None:  # fmt: skip
        question = prepare(recording, simulator, simulator.defaults(recording.parameters))
        problem: Problem = question.everything
        self.problem = problem.on(spread_out(problem.windows, windows, problem.run.settings.windows.fewest))
        ones = np.ones(len(problem.floor))
        self.noise = Noise(problem.floor, ones, np.asarray(self.problem.root_weights, dtype=float))
        self.offers = offers or candidates(question.recording, problem.simulator, problem.parameters)
        self.count = max(float(self.problem.windows.valid[:, 1:].sum()), 1.0)
        self.whole = max(recording.transition_count / self.count, 1.0)
        self._how = how

    def known(self, effects: Sequence[TrueEffect]) -> bool:
        """Whether a diagnosis would try all of them."""
        return {(e.family, e.on) for e in effects} <= {c.identity for c in self.offers}

    def of(self, effects: Sequence[TrueEffect]) -> Fit:
        """Of effects, begun at their values."""
        return self.fitted(as_hypothesis(effects, self.offers))

    def fitted(self, hypothesis: Hypothesis, starts: FloatArray | None = None) -> Fit:
        """Of a hypothesis; from start states (W, S), where they are known."""
        rounds, tolerance = self._how
        return fit(self.problem, hypothesis, starts, rounds, self.noise, tolerance)

    def misfit(self, found: Fit) -> float:
        """Half the sum of squares in standard deviations of the noise."""
        return float(0.5 * (self._scaled(found) ** 2).sum())

    def squares(self, found: Fit) -> FloatArray:
        """(C,) sums of squares in standard deviations of the noise."""
        scaled = self._scaled(found)
        return np.asarray((scaled**2).sum(axis=tuple(range(scaled.ndim - 1))))

    def explains(self, own: float) -> bool:
        """Whether a truth of that misfit explains its own recording; of one that does not nothing can be said."""
        nothing = self.misfit(self.fitted(Hypothesis(scheme="fine")))
        return own < UNEXPLAINED * nothing or self.whole * own < NUMERICAL

    def _scaled(self, found: Fit) -> FloatArray:
        seen = self.problem.observed
        return np.asarray(found.residuals[..., seen] / self.problem.floor[seen])


def on_offer(effects: Sequence[TrueEffect], offers: Sequence[Candidate]) -> bool:
    """Whether all of them are: a dead zone in a speed that was differentiated shows in no reading, and is not."""
    return {_wanted(effect) for effect in effects} <= {(c.identity, c.variant) for c in offers}


def _wanted(effect: TrueEffect) -> tuple[Identity, str]:
    return (effect.family, effect.on), "coefficient" if "coefficient" in effect.values else ""


def as_hypothesis(effects: Sequence[TrueEffect], offers: Sequence[Candidate]) -> Hypothesis:
    """Effects of the catalogue with their true values and gates, finely integrated; offers hold their places."""
    out = Hypothesis(scheme="fine")
    for effect in effects:
        candidate = next(c for c in offers if (c.identity, c.variant) == _wanted(effect))
        values = [effect.values[p.name] for p in candidate.declared]
        term = replace(candidate.term(values), gate=Gate(effect.region, effect.since))
        # The truth may lie where the catalogue would not search.
        wide = [
            replace(p, low=min(p.low, v), high=max(p.high, v))
            for p, v in zip(candidate.declared, values, strict=True)
        ]
        out = out.plus(term, tuple(wide))
    return out


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


def without_noise(world: World) -> Recording:
    """The recording of a world as perfect sensors would have made it."""
    truth = run(world, world.effects)
    return even_recording(world, truth.clean, truth, np.asarray(sound(world, truth.sampled)))


def cleaned(recording: Recording, answer: Answer) -> Recording:
    """The recording with its readings replaced by clean ones, and the world's own noise as known."""
    pairs = zip(recording.episodes, answer.clean, strict=True)
    noise = {n: sd for n, sd in answer.world.noise.items() if n in recording.state.names}
    episodes = tuple(replace(e, states=states) for e, states in pairs)
    return replace(recording, episodes=episodes, noise=noise, held_out=None)


def opened_model(folder: Path) -> tuple[Recording, Simulator]:
    """A robot's recording, in the columns of its simulator, and that one."""
    recording = read_recording(folder)
    simulator = open_simulator(str(folder / str(recording.model)))
    return in_its_columns(recording, simulator), simulator


def opened(answer: Answer, folder: Path) -> tuple[Recording, Recording, Simulator]:
    """A recording without noise and as it was published, and the simulator that is believed, in whose columns they are.

    Of a machine whose equations are known without noise: with the yardstick as its noise.
    """
    recording = read_recording(folder)
    if recording.model is None:
        world = main_world(answer)
        yardstick = replace(without_noise(world), noise=dict(world.noise), held_out=None)
        return yardstick, recording, make_simulator(answer.world.system)
    read, simulator = opened_model(folder)
    return in_its_columns(cleaned(recording, answer), simulator), read, simulator


def rollouts_over_truth(
    recording: Recording, simulator: Simulator, held_out: Sequence[str], truth: Sequence[TrueEffect],
    said: Sequence[TrueEffect],
) -> dict[str, float]:  # fmt: skip
    """Channel -> error of what was said over that of the true model refitted; empty where nothing can be compared.

    Both are simulated by the same code from what was measured, as `gpsim diagnose --score` does it, and judged a second
    on. recording: as it was published; held_out: names of the episodes that nothing was learnt from; said: with its
    values.
    """
    learnt, held = (
        tuple(e for e in recording.episodes if (e.name in held_out) == wanted) for wanted in (False, True)
    )
    if not learnt or not held:
        return {}
    known = replace(recording, episodes=learnt, held_out=HeldOut(share=0.0))
    question = prepare(known, simulator, simulator.defaults(recording.parameters))
    problem = question.everything
    offers = candidates(question.recording, problem.simulator, problem.parameters)
    if not {(e.family, e.on) for e in (*truth, *said)} <= {c.identity for c in offers}:
        return {}
    found = fit(problem, as_hypothesis(truth, offers), rounds=ROUNDS, tolerance=TOLERANCE)
    judged = replace(recording, episodes=held, held_out=None)
    own, other = (
        score(judged, _plant(question, h, recording.dt), None, np.random.default_rng(0)).rollout
        for h in (found.hypothesis, as_hypothesis(said, offers))
    )
    return {
        name: other[name].after / own[name].after if math.isfinite(other[name].after) else math.inf
        for name in own
        if name in other and own[name].after > 0
    }


def _plant(question: Question, hypothesis: Hypothesis, dt: float) -> EffectsPlant:
    """What is driven: the simulator with these effects."""
    system, problem = closed(question.whole), question.everything
    steps = math.ceil(problem.substeps / question.thinned) if system is None else system.steps_of(dt)
    return EffectsPlant(
        question.whole, dict(problem.parameters), hypothesis.terms, hypothesis.scheme, steps, dt
    )


def kept_path(out: Path, name: str) -> Path:
    """Where it is kept."""
    return out / "equivalents" / f"{name}.json"


def read_kept(path: Path) -> dict[str, Any]:
    """What is kept; nothing where it is missing or damaged."""
    try:
        content: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    except (FileNotFoundError, ValueError):
        return {}
    return content


def write_kept(path: Path, content: Json) -> None:
    """Keep it, whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with written_whole(path) as made:
        write_json(made, plain(content))


def digests_of(outcome: Json) -> dict[str, Any]:
    """The answer and the recording of a diagnosis."""
    return {key: outcome[key] for key in ("answer_sha256", "recording")}


def kept_or_made(
    out: Path, name: str, follows_from: Json, make: Callable[[], dict[str, Any]]
) -> dict[str, Any]:
    """What is kept of a trial, made anew where it follows from something else."""
    path, identity = kept_path(out, name), plain(follows_from)
    kept = read_kept(path)
    if any(kept.get(key) != value for key, value in identity.items()):
        write_kept(path, identity | make())
        kept = read_kept(path)
    return kept


def rivals_from(kept: Json) -> list[Rival]:
    """The rivals that are kept."""
    lost = ((r, math.inf if r["nats_lost"] is None else float(r["nats_lost"])) for r in kept["rivals"])
    return [Rival(tuple((f, on) for f, on in r["claims"]), loss, bool(r["richer"])) for r, loss in lost]


def ratios_from(kept: Json) -> dict[str, float]:
    """The ratios of rollouts that are kept; JSON has no infinity."""
    return {name: math.inf if ratio is None else float(ratio) for name, ratio in kept["rollouts"].items()}
