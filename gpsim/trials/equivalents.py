"""Equivalents of a world's effects; of a rough one's those of the same world without nuisances and without a rough log.

Beside them stands PySINDy's answer, where it applies and is installed. Both are dear, and follow from the answer and
the recording alone: another answer, recording or version of the rule is listed anew.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from gpsim.diagnosis.fitting import Fit, Hypothesis, Shooting
from gpsim.diagnosis.ladder import Law, Offers, laws_of
from gpsim.diagnosis.settings import NOTHING_KNOWN, Settings
from gpsim.diagnosis.setup import candidates
from gpsim.effects import Gate
from gpsim.recordings import Recording, read_recording
from gpsim.simulators import make_simulator
from gpsim.trials import sindy
from gpsim.trials.blinding import PUBLIC, Answer
from gpsim.trials.fits import (
    LOST,
    Claims,
    Fits,
    Rival,
    as_hypothesis,
    cleaned,
    digests_of,
    kept_path,
    main_world,
    on_offer,
    read_kept,
    rivals_from,
    without_noise,
    write_kept,
)
from gpsim.trials.worlds import TrueEffect, effect_json, world_json

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
    path, public = kept_path(out, name), out / PUBLIC / name
    identity = {"version": EQUIVALENTS_VERSION, **digests_of(outcome)}
    found = read_kept(path)
    kept = found if identity.items() <= found.items() else identity
    new: dict[str, Any] = {}
    if "rivals" not in kept:
        started = time.monotonic()
        listed = rough_rivals(answer) if "rough" in answer.content else rivals(answer, read_recording(public))
        new["rivals"] = [
            {
                "claims": list(map(list, r.claims)), "nats_lost": r.loss, "richer": r.richer,
                "equivalent": r.equivalent,
            }
            for r in listed
        ]  # fmt: skip
        new["seconds"] = round(time.monotonic() - started, 2)
    if kept.get("sindy") is None:  # it may have been installed since
        new["sindy"] = None
        if sindy.installed() and sindy.applies(answer.content):
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # it warns of thresholds that eliminate all terms, an answer
                new["sindy"] = list(map(list, sindy.name(read_recording(public))))
    kept = kept | new
    if kept != found:
        write_kept(path, kept)
    said = kept["sindy"]
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
        inside = [e for e in effects if not e.outside]
        if not on_offer(inside, self._fits.offers):  # nobody asks for it: no rival can be held against it
            return []
        found: list[Fit] = []
        for dropped in effects:
            parent = self._fits.of([e for e in inside if e is not dropped])
            own = None if dropped.outside else (dropped.family, dropped.on)
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
