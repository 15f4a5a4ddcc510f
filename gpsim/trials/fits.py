"""Fitting explanations to a recording without noise, and telling what they lose against the truth; and what is kept.

The yardstick of every rule for equivalents: what loses less than 3 nats over the whole recording, with the noise that
is stated, could not be told from the truth by anybody. Only this and what rests on it fits with the diagnosis's engine,
after the reveal. What is dear to find out about a trial is kept in OUT/equivalents/NAME.json, for what it follows from.

At the end: the equivalents of a world's effects; of a rough one's those of the same world without nuisances and without
a rough log. Beside them stands PySINDy's answer, where it applies and is installed.
"""

from __future__ import annotations

import json
import math
import time
import warnings
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from gpsim.channels import FloatArray
from gpsim.corrected import EffectsPlant
from gpsim.diagnosis import score
from gpsim.diagnosis.fitting import Candidate, Fit, Hypothesis, Noise, Problem, Shooting, fit
from gpsim.diagnosis.ladder import Law, Offers, laws_of
from gpsim.diagnosis.settings import NOTHING_KNOWN, Settings
from gpsim.diagnosis.setup import PreparedProblem, candidates, prepare, spread_out
from gpsim.effects import Gate, closed
from gpsim.files import plain, write_json, written_whole
from gpsim.mjcf import in_its_columns, open_simulator
from gpsim.recordings import HeldOut, Recording, read_recording
from gpsim.simulators import Simulator, make_simulator
from gpsim.trials import sindy
from gpsim.trials.blinding import PUBLIC, Answer
from gpsim.trials.concealing import even_recording
from gpsim.trials.driving import sound
from gpsim.trials.truth import run
from gpsim.trials.worlds import TrueEffect, World, effect_json, world_json

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
        return {e.identity for e in effects} <= {c.identity for c in self.offers}

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
    return effect.identity, "coefficient" if "coefficient" in effect.values else ""


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
    if not {e.identity for e in (*truth, *said)} <= {c.identity for c in offers}:
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


def _plant(question: PreparedProblem, hypothesis: Hypothesis, dt: float) -> EffectsPlant:
    """What is driven: the simulator with these effects."""
    system, problem = closed(question.whole), question.everything
    steps = math.ceil(problem.substeps / question.thinned) if system is None else system.steps_of(dt)
    return EffectsPlant(
        question.whole, dict(problem.parameters), hypothesis.terms, hypothesis.scheme, steps, dt
    )


def write_kept(path: Path, content: Json) -> None:
    """Keep what is dear to find out about a trial, whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with written_whole(path) as made:
        write_json(made, plain(content))


def digests_of(outcome: Json) -> dict[str, Any]:
    """The answer and the recording of a diagnosis."""
    return {key: outcome[key] for key in ("answer_sha256", "recording")}


def memoized(out: Path, name: str, follows_from: Json, make: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    """What is kept of a trial, made anew where it follows from something else."""
    path, identity, kept = out / "equivalents" / f"{name}.json", plain(follows_from), {}
    with suppress(FileNotFoundError, ValueError):  # damaged is as good as missing
        kept = json.loads(path.read_text(encoding="utf-8"))
    if any(kept.get(key) != value for key, value in identity.items()):
        write_kept(path, identity | make())
        kept = json.loads(path.read_text(encoding="utf-8"))
    return kept


def rival_json(rival: Rival) -> dict[str, Any]:
    """Plain data."""
    return {"claims": list(map(list, rival.claims)), "nats_lost": rival.loss, "richer": rival.richer}


def rivals_from(kept: Json) -> list[Rival]:
    """The rivals that are kept."""
    lost = ((r, math.inf if r["nats_lost"] is None else float(r["nats_lost"])) for r in kept["rivals"])
    return [Rival(tuple((f, on) for f, on in r["claims"]), loss, bool(r["richer"])) for r, loss in lost]


def ratios_from(kept: Json) -> dict[str, float]:
    """The ratios of rollouts that are kept; JSON has no infinity."""
    return {name: math.inf if ratio is None else float(ratio) for name, ratio in kept["rollouts"].items()}


# Kept lists of equivalents hold for one version. Raise it whenever `rivals` may list something else (the rule or its
# constants, the catalogue, the fitting engine have changed) and when `sindy.name` may say something else.
EQUIVALENTS_VERSION = 7
WINDOWS, FITTED = 60, 10
PROMISING = 0.02  # share of a parent's misfit that a replacement must explain by lines
EXPANDED = 6  # equivalents that get rivals of their own


@dataclass(frozen=True)
class Listing:
    """Every rival that was fitted, the best first, and PySINDy's claims where it applies and is installed."""

    rivals: list[Rival]
    sindy: Claims | None


def cached_listing(out: Path, name: str, answer: Answer, outcome: Mapping[str, Any]) -> Listing:
    """The listing of a revealed trial, from OUT/equivalents or made now and kept there.

    outcome: of its diagnosis, whose digests of answer and recording were verified.
    """
    path, public = out / "equivalents" / f"{name}.json", out / PUBLIC / name

    def make() -> dict[str, Any]:
        started = time.monotonic()
        found = rough_rivals(answer) if "rough" in answer.content else rivals(answer, read_recording(public))
        told = [{**rival_json(r), "equivalent": r.equivalent} for r in found]
        return {"rivals": told, "seconds": round(time.monotonic() - started, 2), "sindy": None}

    kept = memoized(out, name, {"version": EQUIVALENTS_VERSION, **digests_of(outcome)}, make)
    # It may have been installed since.
    if kept.get("sindy") is None and sindy.installed() and sindy.applies(answer.content):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # it warns of thresholds that eliminate all terms, an answer
            kept["sindy"] = list(map(list, sindy.name(read_recording(public))))
        write_kept(path, kept)
    said = kept.get("sindy")
    return Listing(rivals_from(kept), None if said is None else tuple((family, on) for family, on in said))


def rough_rivals(answer: Answer) -> list[Rival]:
    """All that were fitted, the best first.

    The yardstick is the noise of the sensors, their steps and what the nuisances leave of a rollout: what changes less
    than that cannot be told.
    """
    world = main_world(answer)
    recording = without_noise(world)
    content = {"world": world_json(world), "effects": [effect_json(e) for e in world.effects]}
    clean = [episode.states for episode in recording.episodes]
    return rivals(Answer(content, clean, answer.own, answer.episode), recording)


def rivals(answer: Answer, recording: Recording) -> list[Rival]:
    """All that were fitted, the best first. `recording` is the public one; its readings are replaced by clean ones."""
    world = answer.world
    if not world.effects:
        return []
    clean = replace(cleaned(recording, answer), noise=dict(world.noise))
    simulator = make_simulator(world.system)
    offers = candidates(clean, simulator, simulator.defaults(clean.parameters))
    best: dict[Claims, Rival] = {}
    for rival in _Judge(Fits(clean, simulator, WINDOWS, (14, 0.05), offers)).rivals(world.effects):
        if rival.claims not in best or rival.loss < best[rival.claims].loss:
            best[rival.claims] = rival
    return sorted(best.values(), key=lambda r: r.loss)


class _Judge:
    """Fits hypotheses to the clean windows and tells what they lose."""

    def __init__(self, fits: Fits) -> None:
        self._fits = fits
        self._laws = laws_of(fits.problem.simulator, fits.offers, Settings().laws, NOTHING_KNOWN)

    def rivals(self, effects: Sequence[TrueEffect]) -> list[Rival]:
        """Every rival that was fitted."""
        inside = [e for e in effects if not e.out_of_catalogue]
        if not on_offer(inside, self._fits.offers):  # nobody asks for it: no rival can be held against it
            return []
        found: list[Fit] = []
        for dropped in effects:
            parent = self._fits.of([e for e in inside if e is not dropped])
            own = None if dropped.out_of_catalogue else dropped.identity
            found += [parent, *self._replacements(parent, own, Gate(dropped.region, dropped.since))]
        size = sum(len(e.values) for e in effects)
        if len(inside) < len(effects):
            return self._judged(found, 0.0, size)
        truth = as_hypothesis(inside, self._fits.offers)
        fitted = self._fits.fitted(truth)
        if not self._fits.explains(self._fits.misfit(fitted)):
            return []
        found += self._near(fitted)
        equal = self._as_good(found, self._least(truth, fitted, found), size)
        for rival in [f for f in equal if f.hypothesis.terms][:EXPANDED]:
            more: list[Fit] = []
            for i, term in enumerate(rival.hypothesis.terms):
                parent = self._fits.fitted(rival.hypothesis.without(i))
                more += [parent, *self._replacements(parent, term.identity, term.gate)]
            more += self._near(rival)
            found += [f for f in more if f.hypothesis.claims != truth.claims]
        return self._judged(found, self._least(truth, fitted, found), size)

    def _near(self, at: Fit) -> list[Fit]:
        """One term after another replaced, from where the fit stands: its start states and all its other terms."""
        out = []
        for i, term in enumerate(at.hypothesis.terms):
            parent = self._fits.fitted(at.hypothesis.without(i), at.starts)
            out += self._replacements(parent, term.identity, term.gate)
        return out

    def _judged(self, found: Sequence[Fit], least: float, size: int) -> list[Rival]:
        return [
            Rival(
                tuple(sorted(term.identity for term in f.hypothesis.terms)),
                round(self._fits.whole * (self._fits.misfit(f) - least), 3),
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
        misfit = self._fits.misfit
        for rival, f in zip(self._judged(found, least, size), found, strict=True):
            better = rival.claims not in best or misfit(f) < misfit(best[rival.claims])
            if rival.loss < LOST and better:
                best[rival.claims] = f
        return sorted(best.values(), key=misfit)

    def _least(self, truth: Hypothesis, fitted: Fit, found: Sequence[Fit]) -> float:
        """The truth's own misfit: the engine's numerical error. A rival that beats it shows where its fit got stuck."""
        misfit = self._fits.misfit
        own, best = misfit(fitted), min(found, key=misfit)
        if own - misfit(best) < LOST / self._fits.whole:
            return own
        return min(own, misfit(self._fits.fitted(truth, best.starts)))

    def _replacements(self, parent: Fit, own: tuple[str, str] | None, gate: Gate) -> list[Fit]:
        """The parent with one more of what is not there yet, behind the gate of the effect that is gone, too."""
        taken = parent.hypothesis.claims | ({own} if own else frozenset())
        absent = [law for law in self._laws if law.candidate.identity not in taken]
        if gate:
            absent = [replace(law, gate=gate) for law in absent if _gated(law, gate)]
        shooting = Shooting(self._fits.problem, self._fits.noise)
        found = sorted(Offers(shooting, parent).of(absent), key=lambda o: -o.gain)
        needed = PROMISING * self._fits.misfit(parent)
        return [
            self._fits.fitted(
                parent.hypothesis.plus(o.law.term(o.values), o.law.candidate.declared), parent.starts
            )
            for o in found[:FITTED]
            if o.gain > needed
        ]


def _gated(law: Law, gate: Gate) -> bool:
    """Whether a law may stand behind a gate.

    Coulomb friction in a region of its own coordinate is a patch by another name, and nobody says it so.
    """
    family, on = law.candidate.family, law.candidate.place.on
    return law.candidate.gateable and not (family == "coulomb_friction" and on in gate.region)
