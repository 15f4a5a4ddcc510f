"""Choosing pieces: candidates are simulated under every explanation, and the safe ones that teach most improved."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from gpsim.channels import BoolArray, FloatArray, IntArray
from gpsim.planning.information import (
    POINTS,
    Sums,
    Unvisited,
    nothing_played,
    precisions,
    separations,
    summed,
)
from gpsim.planning.limits import Limits, PlanSettings
from gpsim.planning.models import Around, Model
from gpsim.planning.signals import FIXED, SHAPES, multisine, there_and_back, usual

SHORTER = (1.0, 0.5, 0.25)  # times the longest piece, that one may be driven
USUAL_LEVELS = (1.0, 0.7, 0.5, 0.35)
SMALLER = (1.0, 0.3, 0.1)  # times the usual sizes of candidates, where none of the larger ones is safe
FEWEST = 4  # control steps of a piece
RESTED = 3  # this part of `settle` nothing is commanded: actuators forget
LEAST_LEVEL, MIXED, SHRUNK = 0.15, 0.35, (0.6, 1.3)


@dataclass(frozen=True)
class Candidate:
    """A piece: drive (L, A) in [-1, 1], 0 where the machine is left at rest."""

    kind: str
    drive: FloatArray


@dataclass(frozen=True)
class Situation:
    """Where all copies of all models stand after what was played: starts (C, S) a model; time [s], sums, visits."""

    starts: tuple[FloatArray, ...]
    checked: tuple[FloatArray, ...]
    time: float
    sums: Sums
    unvisited: Unvisited


@dataclass(frozen=True)
class Tried:
    """Candidates as they were simulated: commands, or dithers (E, L, A), score (E,), said and true a model.

    steps (E,): after which every copy of every model is back at rest for good. The score is a minute of these.
    """

    commands: FloatArray
    safe: BoolArray
    steps: IntArray
    score: FloatArray
    sums: Sums
    said: tuple[FloatArray, ...]
    true: tuple[FloatArray, ...]


@dataclass(frozen=True)
class Search:
    """What candidates are judged by. checkers: draws of each posterior, by which the chosen piece is verified.

    noise: (S,), infinite where nothing is measured. anew: each piece begins at rest, put there by whoever plays it.
    """

    models: tuple[Model, ...]
    checkers: tuple[Model, ...]
    noise: FloatArray
    limits: Limits
    settings: PlanSettings
    anew: bool
    rng: np.random.Generator
    t: FloatArray = field(repr=False)  # (L,) s of the part of a piece that is driven
    settled: int = 0

    @property
    def around(self) -> Around | None:
        """What steers the machine; then all that is played is a dither of its commands."""
        return self.models[0].machine.around

    @property
    def still(self) -> FloatArray:
        """(A,) what is played while nothing is asked of the machine."""
        return self.limits.idle if self.around is None else np.zeros_like(self.limits.idle)

    def begin(self, unvisited: Unvisited) -> Situation:
        """Everything at rest."""
        return Situation(*self._rested(), 0.0, nothing_played(self.models), unvisited)

    def _rested(self) -> tuple[tuple[FloatArray, ...], tuple[FloatArray, ...]]:
        at_rest = [
            tuple(np.tile(self.limits.rest, (len(m.thetas), 1)) for m in models)
            for models in (self.models, self.checkers)
        ]
        return at_rest[0], at_rest[1]

    def next(self, at: Situation, steps: int) -> tuple[Candidate, Tried, Situation] | None:
        """The safe piece of at most so many steps that teaches most a minute, and where it leads; None if none is."""
        lengths = [max(round(share * len(self.t)), FEWEST) for share in SHORTER]
        parts = [replace(self, t=self.t[:n]) for n in lengths if n + self.settled <= steps]
        for size in SMALLER if parts else ():
            tries = [(part, part.improved(at, part.candidates(size))) for part in parts]
            ranked = [
                (score, candidate, part) for part, found in tries for candidate, score in found if score > 0.0
            ]
            for _, candidate, part in sorted(ranked, key=lambda one: -one[0]):
                tried = part.cut(part.tried(at, [candidate]))
                ends = self.verified(at, tried.commands)
                if ends is not None:
                    return candidate, tried, self.after(at, tried, ends)
        return None

    def cut(self, tried: Tried) -> Tried:
        """One candidate, up to where all are back at rest."""
        count = int(tried.steps[0])
        said, true = (tuple(s[:, :, : count + 1] for s in each) for each in (tried.said, tried.true))
        sums = summed(self.models, said, self.noise)
        return replace(tried, commands=tried.commands[:, :count], said=said, true=true, sums=sums)

    def after(self, at: Situation, tried: Tried, ends: tuple[FloatArray, ...]) -> Situation:
        """Where one candidate leads."""
        starts = tuple(t[:, 0, -1] for t in tried.true)
        if self.anew:
            starts, ends = self._rested()
        time = at.time + self.models[0].machine.dt * tried.commands.shape[1]
        unvisited = at.unvisited.with_visits(self._visits(tried)[0])
        return Situation(starts, ends, time, at.sums.plus(tried.sums), unvisited)

    def candidates(self, size: float) -> list[Candidate]:
        """Random ones, and what is usually played at a few levels: a plan is no worse than these."""
        drawn = [self.random(size) for _ in range(self.settings.candidates)]
        for kind in FIXED[:2]:
            drive = self.usual(kind, self.rng)
            drawn += [Candidate(kind, size * level * drive) for level in USUAL_LEVELS]
        return drawn

    def usual(self, kind: str, rng: np.random.Generator) -> FloatArray:
        """(L, A) of what is usually played, as large as may be, and rest."""
        drive = np.zeros((len(self.t) + self.settled, len(self.limits.low)))
        for a in range(drive.shape[1]):
            drive[: len(self.t), a] = usual(kind, self.t, self.settings.slowest, rng)
        return drive

    def random(self, size: float) -> Candidate:
        """A candidate of a random kind and size, for one action or for all of them."""
        rng, dt = self.rng, self.models[0].machine.dt
        kind = str(rng.choice(list(SHAPES)))
        actions = len(self.limits.low)
        driven = np.ones(actions, dtype=np.bool_)
        if actions > 1 and rng.random() < 0.5:
            driven = np.arange(actions) == rng.integers(actions)
        fastest = self.settings.fastest / dt
        slowest = min(max(self.settings.slowest, 1.0 / max(float(self.t[-1]), dt)), fastest)
        drive = np.zeros((len(self.t) + self.settled, actions))
        for a in np.flatnonzero(driven):
            level = size * np.exp(rng.uniform(np.log(LEAST_LEVEL), 0.0))
            drive[: len(self.t), a] = level * there_and_back(SHAPES[kind](self.t, slowest, fastest, rng), rng)
        return Candidate(kind, drive)

    def improved(self, at: Situation, candidates: list[Candidate]) -> list[tuple[Candidate, float]]:
        """The best candidates, best first: each round changes their sizes and mixes other waves in."""
        best = self._ranked(at, candidates)
        for _ in range(self.settings.rounds if best else 0):
            children = [
                self._changed(best[int(self.rng.integers(len(best)))][0])
                for _ in range(self.settings.candidates // 2)
            ]
            best = sorted([*best, *self._ranked(at, children)], key=lambda found: -found[1])
            best = best[: self.settings.best]
        return best

    def _ranked(self, at: Situation, candidates: list[Candidate]) -> list[tuple[Candidate, float]]:
        tried = self.tried(at, candidates)
        order = [int(e) for e in np.argsort(-tried.score) if tried.safe[e]]
        return [(candidates[e], float(tried.score[e])) for e in order[: self.settings.best]]

    def _changed(self, candidate: Candidate) -> Candidate:
        rng, drive, dt = self.rng, candidate.drive.copy(), self.models[0].machine.dt
        count = len(self.t)
        for a in np.flatnonzero(np.abs(drive).max(axis=0) > 0.0):
            wave = multisine(self.t, self.settings.slowest, self.settings.fastest / dt, rng)
            drive[:count, a] = rng.uniform(*SHRUNK) * drive[:count, a] + MIXED * rng.random() * wave
        return replace(candidate, drive=np.clip(drive, -1.0, 1.0))

    def commands(self, candidates: Sequence[Candidate]) -> FloatArray:
        """(E, L, A) within all limits; of a plan around a policy how far they are from the idle ones."""
        limits, drive = self.limits, np.stack([c.drive for c in candidates])
        up, down = limits.high - limits.idle, limits.idle - limits.low
        wanted = limits.idle + np.where(drive > 0.0, drive * up, drive * down)
        return limits.held(wanted, self.models[0].machine.dt) - (limits.idle - self.still)

    def tried(self, at: Situation, candidates: Sequence[Candidate]) -> Tried:
        """Candidates, simulated and judged."""
        commands = self.commands(candidates)
        both = [
            m.said(s, commands, self.limits.idle, at.time)
            for m, s in zip(self.models, at.starts, strict=True)
        ]
        said, true = tuple(s for s, _ in both), tuple(t for _, t in both)
        safe = np.logical_and.reduce([self._safe(t).all(axis=0) for t in true])
        steps = self._steps(commands, true)
        sums = summed(self.models, said, self.noise)
        made = Tried(commands, safe, steps, np.zeros(len(commands)), sums, said, true)
        return replace(made, score=self._score(at, made))

    def verified(self, at: Situation, commands: FloatArray) -> tuple[FloatArray, ...] | None:
        """Where every draw is after commands (1, L, A); None where too many of an explanation's leave the box."""
        ends = []
        for model, starts in zip(self.checkers, at.checked, strict=True):
            true = model.said(starts, commands, self.limits.idle, at.time)[1]
            if 1.0 - self._safe(true)[:, 0].mean() > 1.0 - self.settings.probability:
                return None
            ends.append(true[:, 0, -1])
        return tuple(ends)

    def _steps(self, commands: FloatArray, true: Sequence[FloatArray]) -> IntArray:
        """(E,) until nothing has been commanded for a while, and every copy of every model is at rest for good."""
        count = commands.shape[1]
        if self.anew:
            return np.full(len(commands), count)
        moved = (commands != self.still).any(axis=2)
        quiet = _from_when(~moved) + self.settled // RESTED
        back = [self.limits.back(t, self.settings.returns).all(axis=0) for t in true]
        return np.minimum(np.maximum(quiet, _from_when(np.logical_and.reduce(back))), count)

    def _safe(self, true: FloatArray) -> BoolArray:
        """(C, E) whether the states (C, E, L + 1, S) stay in the box, and are back at rest in the end."""
        stays = self.limits.inside(true, self.settings.margin).all(axis=2)
        if self.anew:
            return np.asarray(stays)
        return np.asarray(stays & self.limits.back(true[:, :, -1], self.settings.returns))

    def _score(self, at: Situation, tried: Tried) -> FloatArray:
        """(E,) weighted nats a minute that each adds. Beyond what is enough a pair's nats count for less and less."""
        settings, before = self.settings, at.sums
        both = before.plus(tried.sums)
        value = settings.precision * (precisions(self.models[0], both) - precisions(self.models[0], before))
        if len(self.models) > 1:
            gained = self._enough(separations(self.models, both)) - self._enough(
                separations(self.models, before)
            )
            value = value + settings.separation * gained.mean(axis=1)
        if settings.novelty > 0.0 and at.unvisited.columns.size:
            value = value + settings.novelty * at.unvisited.nats(self._visits(tried))
        minutes = tried.steps * self.models[0].machine.dt / 60.0
        return np.asarray(np.where(np.isfinite(value), value, 0.0) / minutes)

    def _enough(self, nats: FloatArray) -> FloatArray:
        enough = self.settings.enough
        return np.asarray(enough * np.log1p(nats / enough))

    def _visits(self, tried: Tried) -> FloatArray:
        """(E, POINTS, S + A) where the leader goes."""
        rows = np.linspace(0, tried.commands.shape[1] - 1, POINTS).astype(np.int64)
        course, commands = tried.said[0][0][:, rows], tried.commands[:, rows]
        if self.around is not None:
            steered = self.around.steer(course.reshape(-1, course.shape[2])).reshape(commands.shape)
            commands = np.clip(steered + commands, self.limits.low, self.limits.high)
        return np.concatenate([course, commands], axis=2)


def _from_when(holds: BoolArray) -> IntArray:
    """(E,) the first column from which on all of holds (E, K) is true."""
    return np.asarray(holds.shape[1] - np.cumprod(holds[:, ::-1], axis=1).sum(axis=1))
