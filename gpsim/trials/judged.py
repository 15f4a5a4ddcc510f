"""Whether what was said of a machine or a robot explains it as well as the truth, and which effects could be seen.

The yardstick of a machine is that of rough worlds: the machine with its own effects alone, noise-free, with the noise
of the sensors, their steps and what the nuisances leave. Every fit starts at the truth. An effect could be seen where
the truth without it, all others fitted anew, loses 3 nats or more. What was said stands for an effect where the truth
with the one in the other's place, fitted anew, loses less; one after the other, so that two may have changed places.

A robot has a hundred candidates and minutes a list, so only what a diagnosis said is judged: its leader and its
alternatives, from its own values. Inertial parameters of neighbouring bodies do the same to the joints in many motions
(base parameters: Gautier 1991). So bodies of whole robots that were changed are judged by the torques that they ask for
along the true motion, too: in place of the true changes others are right that ask for the same.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from gpsim.channels import FloatArray
from gpsim.diagnosis.fitting import Fit
from gpsim.recordings import Recording
from gpsim.simulators import Simulator
from gpsim.trials.blinding import PUBLIC, Answer, recording_folders
from gpsim.trials.fits import (
    LOST,
    Claims,
    Fits,
    Identity,
    Json,
    Rival,
    digests_of,
    memoized,
    opened,
    opened_model,
    ratios_from,
    rival_json,
    rivals_from,
    rollouts_over_truth,
)
from gpsim.trials.robots import body_torques, joint_torques, motion_of, run_whole, sound
from gpsim.trials.worlds import TrueEffect, World, effect_json

# Of the rules: raise one whenever something else may come of them.
MACHINE_VERSION, ROBOT_VERSION, WHOLE_VERSION, AFLOAT_VERSION = 2, 1, 1, 1
WINDOWS, MACHINE_FIT, ROBOT_FIT = 80, (20, 0.02), (30, 0.01)  # iterations and tolerance of a fit
MOST_TRIED = 4  # claims that are no effect of the truth, which are tried in the others' places


def place_of(on: Any) -> str:
    """Several places are joined."""
    return on if isinstance(on, str) else ",".join(map(str, on))


def _as_true(effect: Json) -> TrueEffect:
    """An effect as a report has it, as the truth says it."""
    region = {k: (float(low), float(high)) for k, (low, high) in effect["region"].items()}
    values = {n: float(p["value"]) for n, p in effect["parameters"].items()}
    return TrueEffect(str(effect["family"]), place_of(effect["on"]), values, region, effect["since"])


def _in_short(effects: Sequence[Json]) -> list[Any]:
    """Family, place and values of effects that were said."""
    return [[e["family"], e["on"], {n: p["value"] for n, p in e["parameters"].items()}] for e in effects]


def _said_of(report: Json | None) -> list[list[Json]]:
    """The effects of the leader and of every alternative."""
    if report is None:
        return []
    return [list(report["effects"]), *(list(a["effects"]) for a in report["alternatives"])]


def _rollouts(
    recording: Recording, simulator: Simulator, truth: Sequence[TrueEffect], report: Json
) -> dict[str, float]:
    held, said = map(str, report["fit"]["held_out"]), map(_as_true, report["effects"])
    return rollouts_over_truth(recording, simulator, list(held), truth, list(said))


@dataclass(frozen=True)
class Seen:
    """Of one effect of the truth, what it loses when it is left out and the others are fitted anew.

    nats: of the whole recording; share: of the misfit of the bare simulator; beyond: what is off then, root mean square
    in standard deviations of the sensors' noise, in the channel where that is most.
    """

    nats: float
    share: float
    beyond: float


class Standing(NamedTuple):
    """stands: a claim -> the effect of the truth that it stands for; effects: the truth with those in their places."""

    stands: dict[Identity, Identity]
    effects: tuple[TrueEffect, ...]


class MachineJudge:
    """Fits explanations to the noise-free windows.

    recording: the clean one, with the yardstick as its noise; sensors: channel -> its noise alone.
    """

    def __init__(
        self, recording: Recording, simulator: Simulator, truth: Sequence[TrueEffect], sensors: Mapping[str, float]
    ) -> None:  # fmt: skip
        self._fits, self._effects = Fits(recording, simulator, WINDOWS, MACHINE_FIT), tuple(truth)
        observed, floor = self._fits.problem.observed, self._fits.problem.floor
        names = np.array(simulator.state.names)[observed]
        self._louder = floor[observed] / np.array([sensors[name] for name in names])
        self._own = self._fits.squares(self._fits.of(truth))
        self._none = float(self._fits.squares(self._fits.of(())).sum())

    @cached_property
    def seen(self) -> tuple[Seen, ...]:
        """Of every effect of the truth."""
        return tuple(self._seen([e for e in self._effects if e is not effect]) for effect in self._effects)

    def _seen(self, rest: Sequence[TrueEffect]) -> Seen:
        squares = self._fits.squares(self._fits.of(rest))
        more: FloatArray = np.maximum(squares - self._own, 0.0)
        missing = max(self._none - float(self._own.sum()), 1e-12)
        return Seen(
            round(self._fits.whole * 0.5 * float((squares - self._own).sum()), 3),
            round(min(float(more.sum()) / missing, 1.0), 6),
            round(float(np.sqrt((more * self._louder**2).max() / self._fits.count)), 4),
        )

    def standing(self, said: Sequence[TrueEffect]) -> Standing:
        """Which claims that are no effect of the truth stand for one that could be seen and was not told."""
        own, claims = {e.identity for e in self._effects}, {e.identity for e in said}
        strange = [e for e in said if self._fits.known([e]) and e.identity not in own and not e.gated]
        pairs = zip(self._effects, self.seen, strict=True)
        untold = {e.identity for e, seen in pairs if seen.nats >= LOST} - claims
        standing = Standing({}, self._effects)
        for claim in strange[:MOST_TRIED]:
            standing = self._with(claim, standing, untold - set(standing.stands.values()))
        return standing

    def _with(self, claim: TrueEffect, standing: Standing, untold: set[Identity]) -> Standing:
        """The same with the claim in the place of the first effect for which it stands, if there is one."""
        for effect in [e for e in standing.effects if e.identity in untold]:
            if len(claim.values) > len(effect.values):  # a richer one holds the truth as a special case
                continue
            tried = [claim if e is effect else e for e in standing.effects]
            found = self._fits.of(tried)
            if self._lost(found) < LOST:
                pairs = zip(tried, found.hypothesis.terms, strict=True)
                stands = {**standing.stands, claim.identity: effect.identity}
                return Standing(stands, tuple(replace(e, values=dict(t.values)) for e, t in pairs))
        return standing

    def equivalent(self, said: Sequence[TrueEffect]) -> bool:
        """Whether a whole explanation with no more parameters loses nothing."""
        if not said or not self._fits.known(said) or any(e.gated for e in said):
            return False
        poorer = sum(len(e.values) for e in said) <= sum(len(e.values) for e in self._effects)
        return poorer and self._lost(self._fits.of(said)) < LOST

    def _lost(self, found: Fit) -> float:
        """Nats of the whole recording, against the truth."""
        return self._fits.whole * 0.5 * float((self._fits.squares(found) - self._own).sum())


@dataclass(frozen=True)
class MachineListing:
    """seen: of every own effect of the machine, in the answer's order; stands: claim -> the effect that it stands for.

    values: the true values of all effects, or, where one stands for another, those that go with it; equivalent: of the
    leader and of every alternative, whether it loses nothing as a whole; rollouts: channel -> error over the truth's.
    """

    seen: Sequence[Seen]
    stands: Mapping[Identity, Identity]
    values: Sequence[Json]
    equivalent: Sequence[bool]
    rollouts: Mapping[str, float]


def machine_listing(
    out: Path, name: str, answer: Answer, outcome: Json, report: Json | None
) -> MachineListing:
    """The listing of a revealed diagnosis, from OUT/equivalents or made now and kept there."""
    said, world = _said_of(report), answer.world

    def make() -> dict[str, Any]:
        started = time.monotonic()
        clean, recording, simulator = opened(answer, recording_folders(out / PUBLIC / name)[0])
        steps = world.rough.quantum if world.rough else {}
        sensors = {n: float(np.hypot(sd, steps.get(n, 0.0) / np.sqrt(12.0))) for n, sd in world.noise.items()}
        judge = MachineJudge(clean, simulator, world.main, sensors)
        explanations = [list(map(_as_true, effects)) for effects in said]
        standing = judge.standing(explanations[0] if explanations else [])
        rollouts = {} if report is None else _rollouts(recording, simulator, world.main, report)
        return {
            "seen": [asdict(s) for s in judge.seen],
            "stands": [[list(claim), list(effect)] for claim, effect in standing.stands.items()],
            "values": [effect_json(e) for e in standing.effects],
            "equivalent": [judge.equivalent(effects) for effects in explanations],
            "rollouts": rollouts,
            "seconds": round(time.monotonic() - started, 2),
        }

    told = list(map(_in_short, said))
    follows_from = {"machine_version": MACHINE_VERSION, **digests_of(outcome), "said": told}
    kept = memoized(out, name, follows_from, make)
    stands = {(a, b): (c, d) for (a, b), (c, d) in kept["stands"]}
    seen = [Seen(**s) for s in kept["seen"]]
    return MachineListing(seen, stands, kept["values"], kept["equivalent"], ratios_from(kept))


def robot_rivals(out: Path, name: str, answer: Answer, outcome: Json, report: Json | None) -> list[Rival]:
    """What was said and is not the truth, each judged; kept in OUT/equivalents/NAME.json for the same answer."""
    truth = claims_of(answer.content["effects"])
    said = {claims_of(effects): effects for effects in _said_of(report)}
    others = [effects for claims, effects in said.items() if claims and claims != truth]
    if not others or not answer.world.effects:
        return []

    def make() -> dict[str, Any]:
        clean, _, simulator = opened(answer, out / PUBLIC / name)
        fits, effects = Fits(clean, simulator, WINDOWS, ROBOT_FIT), answer.world.effects
        # The truth's own misfit: the engine's numerical error. Where it is too large nothing can be said: all is lost.
        own = fits.misfit(fits.of(effects)) if fits.known(effects) else math.inf
        able = math.isfinite(own) and fits.explains(own)
        judged = []
        for claimed in others:
            said = list(map(_as_true, claimed))
            known = able and fits.known(said)
            loss = round(fits.whole * (fits.misfit(fits.of(said)) - own), 3) if known else math.inf
            richer = sum(len(e.values) for e in said) > sum(len(e.values) for e in effects)
            judged.append(Rival(claims_of(claimed), loss, richer))
        return {"rivals": list(map(rival_json, judged))}

    told = [short for effects in others for short in _in_short(effects)]
    follows_from = {"robot_version": ROBOT_VERSION, **digests_of(outcome), "said": told}
    return sorted(rivals_from(memoized(out, name, follows_from, make)), key=lambda r: r.loss)


def claims_of(effects: Sequence[Json]) -> Claims:
    """Families and places; several places are joined."""
    return tuple(sorted((str(e["family"]), place_of(e["on"])) for e in effects))


class WholeListing(NamedTuple):
    """rollouts: channel -> error over the refitted truth's; bodies_off: the torque that the changed bodies ask for.

    That is off by so much of what the true changes ask for, root mean square over the joints, each in its own torque.
    """

    rollouts: Mapping[str, float]
    bodies_off: float


def whole_listing(out: Path, name: str, answer: Answer, outcome: Json, report: Json | None) -> WholeListing:
    """The listing of a revealed diagnosis, from OUT/equivalents or made now and kept there."""
    said = [] if report is None else list(report["effects"])

    def make() -> dict[str, Any]:
        off = bodies_off(answer.world, list(map(_as_true, said)))
        return {"rollouts": _robots_rollouts(out, name, answer, report), "bodies_off": off}

    follows_from = {"whole_version": WHOLE_VERSION, **digests_of(outcome), "said": _in_short(said)}
    kept = memoized(out, name, follows_from, make)
    return WholeListing(ratios_from(kept), float(kept["bodies_off"]))


def afloat_rollouts(
    out: Path, name: str, answer: Answer, outcome: Json, report: Json | None
) -> dict[str, float]:
    """Of what floats or stands, channel -> error of held-out rollouts over the refitted truth's; kept as above."""

    def make() -> dict[str, Any]:
        return {"rollouts": _robots_rollouts(out, name, answer, report)}

    said = [] if report is None else list(report["effects"])
    follows_from = {"afloat_version": AFLOAT_VERSION, **digests_of(outcome), "said": _in_short(said)}
    return ratios_from(memoized(out, name, follows_from, make))


def _robots_rollouts(out: Path, name: str, answer: Answer, report: Json | None) -> dict[str, float]:
    if report is None:
        return {}
    return _rollouts(*opened_model(out / PUBLIC / name), answer.world.effects, report)


def bodies_off(world: World, said: Sequence[TrueEffect]) -> float:
    """How far the torques are off that the bodies ask for: 0 where nothing is missing, 1 where nothing was said."""
    truth = run_whole(world)
    motion = motion_of(world, truth, np.asarray(sound(world, truth)))
    scale = np.maximum(joint_torques(world, motion), 1e-12)
    wanted, found = (body_torques(world.system, effects, motion) / scale for effects in (world.effects, said))
    return float(np.sqrt(((found - wanted) ** 2).sum() / max(float((wanted**2).sum()), 1e-300)))
