"""Whether what was said of a robot instead of the truth explains it as well; of a whole robot, what it is worth.

A robot has a hundred candidates and minutes a list, so only what a diagnosis said is judged: its leader and its
alternatives, from its own values.

Inertial parameters of neighbouring bodies do the same to the joints in many motions (base parameters: Gautier 1991). So
bodies of whole robots that were changed are judged by the torques that they ask for along the true motion, too: in
place of the true changes others are right that ask for the same.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from gpsim.trials.blinding import PUBLIC, Answer
from gpsim.trials.rivals.fits import Claims, Fits, Rival, clean_recording, opened_model, rollouts_over_truth
from gpsim.trials.rivals.kept import (
    Json,
    as_true,
    digests_of,
    in_short,
    kept_or_made,
    place_of,
    ratios_from,
    rivals_from,
    said_of,
)
from gpsim.trials.robots import body_torques, joint_torques, motion_of, run_whole, sound
from gpsim.trials.worlds import TrueEffect, World

VERSION, WHOLE_VERSION, AFLOAT_VERSION = (
    1,
    1,
    1,
)  # of the rules: raise one whenever something else may come of them
WINDOWS, HOW = 80, (30, 0.01)  # iterations and tolerance of a fit


def robot_rivals(out: Path, name: str, answer: Answer, outcome: Json, report: Json | None) -> list[Rival]:
    """What was said and is not the truth, each judged; kept in OUT/equivalents/NAME.json for the same answer."""
    truth = claims_of(answer.content["effects"])
    said = {claims_of(effects): effects for effects in said_of(report)}
    others = [effects for claims, effects in said.items() if claims and claims != truth]
    if not others or not answer.world.effects:
        return []
    told = [in_short(e) for effects in others for e in effects]

    def make() -> dict[str, Any]:
        judged = map(Judge(answer, out / PUBLIC / name).judged, others)
        pairs = [
            {"claims": list(map(list, r.claims)), "nats_lost": r.loss, "richer": r.richer} for r in judged
        ]
        return {"rivals": pairs}

    follows_from = {"robot_version": VERSION, **digests_of(outcome), "said": told}
    return sorted(rivals_from(kept_or_made(out, name, follows_from, make)), key=lambda r: r.loss)


class Judge:
    """Fits explanations to the noise-free readings of a robot's world and tells what they lose against the truth."""

    def __init__(self, answer: Answer, public: Path) -> None:
        self._fits = Fits(*clean_recording(answer, public), WINDOWS, HOW)
        self._truth = answer.world.effects

    def judged(self, effects: Sequence[Json]) -> Rival:
        """An explanation as a report has it. Where the engine cannot explain the truth itself it loses everything."""
        claims, said = claims_of(effects), [as_true(e) for e in effects]
        richer = sum(len(e.values) for e in said) > sum(len(e.values) for e in self._truth)
        if self._own is None or not self._fits.known(said):
            return Rival(claims, math.inf, richer)
        lost = self._fits.misfit(self._fits.of(said)) - self._own
        return Rival(claims, round(self._fits.whole * lost, 3), richer)

    @cached_property
    def _own(self) -> float | None:
        """The truth's own misfit: the engine's numerical error. None where it is too large for anything to be said."""
        if not self._fits.known(self._truth):
            return None
        own = self._fits.misfit(self._fits.of(self._truth))
        return own if self._fits.explains(own) else None


def claims_of(effects: Sequence[Json]) -> Claims:
    """Families and places; several places are joined."""
    return tuple(sorted((str(e["family"]), place_of(e["on"])) for e in effects))


@dataclass(frozen=True)
class WholeListing:
    """rollouts: channel -> error over the refitted truth's; bodies_off: the torque that the changed bodies ask for.

    That is off by so much of what the true changes ask for, root mean square over the joints, each in its own torque.
    """

    rollouts: Mapping[str, float]
    bodies_off: float


def whole_listing(out: Path, name: str, answer: Answer, outcome: Json, report: Json | None) -> WholeListing:
    """The listing of a revealed diagnosis, from OUT/equivalents or made now and kept there."""
    said = [] if report is None else list(report["effects"])

    def make() -> dict[str, Any]:
        rollouts = _rollouts(out / PUBLIC / name, answer.world, report)
        return {"rollouts": rollouts, "bodies_off": bodies_off(answer.world, list(map(as_true, said)))}

    told = list(map(in_short, said))
    follows_from = {"whole_version": WHOLE_VERSION, **digests_of(outcome), "said": told}
    kept = kept_or_made(out, name, follows_from, make)
    return WholeListing(ratios_from(kept), float(kept["bodies_off"]))


def afloat_rollouts(
    out: Path, name: str, answer: Answer, outcome: Json, report: Json | None
) -> dict[str, float]:
    """Of what floats or stands, channel -> error of held-out rollouts over the refitted truth's; kept as above."""
    told = [] if report is None else list(map(in_short, report["effects"]))
    follows_from = {"afloat_version": AFLOAT_VERSION, **digests_of(outcome), "said": told}
    kept = kept_or_made(
        out, name, follows_from, lambda: {"rollouts": _rollouts(out / PUBLIC / name, answer.world, report)}
    )
    return ratios_from(kept)


def _rollouts(public: Path, world: World, report: Json | None) -> dict[str, float]:
    if report is None:
        return {}
    held = [str(n) for n in report["fit"]["held_out"]]
    return rollouts_over_truth(
        *opened_model(public), held, world.effects, list(map(as_true, report["effects"]))
    )


def bodies_off(world: World, said: Sequence[TrueEffect]) -> float:
    """How far the torques are off that the bodies ask for: 0 where nothing is missing, 1 where nothing was said."""
    truth = run_whole(world)
    motion = motion_of(world, truth, np.asarray(sound(world, truth)))
    scale = np.maximum(joint_torques(world, motion), 1e-12)
    wanted, found = (body_torques(world.system, effects, motion) / scale for effects in (world.effects, said))
    return float(np.sqrt(((found - wanted) ** 2).sum() / max(float((wanted**2).sum()), 1e-300)))
