"""Where the account of a robot begins: usual rows of all joints by one least squares of inverse dynamics.

Recorded motion says what forces the believed model takes for it. What drives give beyond that is linear in every
joint's viscous and dry friction, rotor and offset, in masses, in a load's first moments, and in one over a motor's gain
(Gautier and Poignet 2001, Control Engineering Practice 9(12)). Both sides are compared below one frequency, after the
same filter without phase (Gautier, Janot and Vandanjon 2013, IEEE Transactions on Control Systems Technology 21(2)).
Which frequency, how late commands come, and whether motors, servos or a mass are off, short simulations decide. Only
starts come of it.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from gpsim.channels import BoolArray, FloatArray
from gpsim.diagnosis.fitting import Candidate, Hypothesis, Problem
from gpsim.diagnosis.ladder.row_numbers import below, least_squares
from gpsim.effects import BlackBoxStepper, Term, closed
from gpsim.recordings import Episode, Recording, evenly

BANDS = (0.0125, 0.025, 0.05, 0.1, 0.2, 0.4, 0.8)  # of the Nyquist frequency, below which motion is kept
NARROWER = 1.5  # times lower are forces compared, no edge being sharp
FINE, GAP = 8.0, 5.0  # samples: a period of the band, at least; missing ones, behind which a piece ends
LONGEST, PIECE, SHORTEST = 12_000, 1_500, 60  # samples that are looked at, in evenly spread pieces of so many
FEWEST, PUSHED = 40, 0.02  # rows, of which there must be so many; share of one in which something pushes
TURNS = 0.05  # of a joint's usual speed, within which dry friction is taken to turn round
STICKS = 0.15  # what a row counts while its joint hardly moves: nobody knows how much friction holds it
HOLDS = 0.95  # quantile of the forces on a joint that stands, which friction holds at least
WINDOWS, WORST = 30, 2.0  # that are simulated to compare; times what the base misses, one at most
STEP, LATEST = 0.005, 0.15  # s, in which delays are scanned, and the longest one
NEWS, ENOUGH = 0.25, 2.0  # nats: of a row (what is wrong with rows is alike); for a delay, beside BIC
STIFFNESS = (0.15, 0.3, 0.6, 1.7, 3.0), (0.78, 0.88, 1.12, 1.28)  # of servos' gains, and of the best of these
ALIKE = 0.015  # of the base's error, beside one standard error: as good as the best
BETTER, SURELY = 0.95, 0.8  # of an error, that must be reached: by what is usual, by other motors or bodies
SURE, DRY_ENOUGH = 2.0, 0.02  # deviations, and usual forces: with more friction a joint surely rubs
ROUGHLY = 0.3  # of a size, where no blocks say how sure it is
LOAD, CARRIERS = "payload", 2  # bodies that may carry one, from the last on
BODIES, NAMED = 2, 5.0  # that are off at most; nats by which each must describe forces better
AGREED = 10.0  # deviations by blocks that a mass must have: what no model holds bends blocks apart by more than noise
GAIN, LATE, MASS, STIFF, SLOW = "actuator_gain", "actuator_delay", ".mass", ".kp", ".kv"
SLOWLY = 1e-3  # rad/s or m/s, at which no servo is at its limit
DRY, PUSH, USUAL = "coulomb_friction", "constant_force", 10.0  # usual forces, of the size that pushes have
VISCOUS = "viscous_friction"
ROWS: Mapping[str, float] = {VISCOUS: 3.0, DRY: 3.0, "armature": 3.0, PUSH: 1.0}
"""Families of rows, and their deviation a priori: in the forces that a joint usually sees at its usual motion."""
TIED: Mapping[str, str] = {
    "coupled_damping": "viscous_friction", "coupled_friction": DRY, "coupled_armature": "armature",
}  # fmt: skip
"""Families of a drive that two joints turn, and the rows that they are with its speed in the place of a joint's."""
OFF: Mapping[str, float] = {GAIN: 0.2, MASS: 0.3, LATE: 0.01}  # the same of what else may be off
WIDEST, MOSTLY = (-0.75, 3.0), 0.9  # the most that gains and masses are off; of what else a model has
Offers = Sequence[Candidate]


@dataclass(frozen=True)
class Sized:
    """What inverse dynamics say: values of parameters by family and place, and their deviations by blocks of the log.

    delay: s, by how much all commands come late; share: of the squared force residual that the rows take off; rubs:
    whether more than half of the joints surely rub dry; as_believed: the same where servos are as stiff as the model
    has them, if these are others.
    """

    values: Mapping[tuple[str, str], tuple[float, ...]]
    deviations: Mapping[tuple[str, str], tuple[float, ...]]
    delay: float
    share: float
    rubs: bool
    as_believed: Sized | None = None


def by_inverse_dynamics(
    problem: Problem, recording: Recording, candidates: Offers, longer: Trials | None = None
) -> Sized | None:
    """The usual rows of a simulator that owns its integration, sized by the forces of the whole recording.

    None where they say nothing: too little was recorded, or something pushes all the time. longer: simulations of what
    is held out, without which servos are as stiff as short ones say.
    """
    simulator, system = problem.simulator, closed(problem.simulator)
    if system is None or not simulator.coordinates:
        return None
    log = _Log(problem, system, recording, candidates)
    bands = [band / 2.0 / recording.dt for band in BANDS] if log.rows and log.pieces else []
    every = [forces for band in bands if (forces := _Forces(log, band)).told >= FEWEST]
    if not every:
        return None
    trials = Trials(problem, candidates)
    best = trials.surest(fits := [forces.fitted() for forces in every])
    for joint in range(len(simulator.coordinates)):
        best = trials.better(best, [best.holding((*best.held, joint))], BETTER)
    best = plain = trials.surest(fits := [fit.holding(best.held) for fit in fits])
    for ratios in STIFFNESS if log.servos else ():
        stiffer = [_Forces(log, best.forces.band, best.forces.stiff * r).fitted() for r in ratios]
        other = trials.better(best, [fit.holding(best.held) for fit in stiffer], BETTER)
        # In short ones a softer servo passes for dry friction, which holds for seconds what that lets go.
        best = longer.better(other, [best], BETTER) if longer else other
    best = trials.better(best, best.later(), BETTER)
    tied = [fit.with_ties() for fit in dict.fromkeys([best, *fits])]
    best = trials.better(best, [fit for fit in tied if fit.further], 1.0)
    every_place = [fit.with_bodies() for fit in dict.fromkeys([best, plain, *trials.good(fits)])]
    if with_bodies := [trials.better(fit, fit.later(), BETTER) for fit in every_place if fit.further]:
        best = trials.better(best, with_bodies, 1.0)
        best = trials.surest([best.again(forces) for forces in every])
        best = trials.better(best, best.later(), BETTER)
    # A load in the place of a mass only where that is not enough; also of softer servos, which sag as much.
    begun = best
    for kinds, places in ((log.kinds, [begun]), (log.loads, dict.fromkeys([begun, plain]))):
        every_kind = [(fit, kind) for fit in places for kind in kinds]
        more = [fit.forces.fitted(fit.late, kind).holding(fit.held) for fit, kind in every_kind]
        best = trials.better(best, more, SURELY)
    if best not in fits:
        best = trials.surest([best.again(forces) for forces in every])
    return replace(_sized(best), as_believed=_sized(plain) if best.forces.stiff != 1.0 else None)


def _sized(fit: _Fit) -> Sized:
    """What a fit says."""
    rows = fit.forces.log.rows
    values, deviations = ({on: v[i] for on, v in fit.values.items()} for i in (0, 1))
    share = 1.0 - float((fit.left / fit.was).mean())
    dry = [row.candidate for row in rows if row.kind == DRY and row.candidate.identity in values]
    sure = [
        values[c.identity][0] > max(SURE * deviations[c.identity][0], DRY_ENOUGH * c.place.span) for c in dry
    ]
    return Sized(values, deviations, fit.late, share, 2 * sum(sure) > len(fit.left))


class Trials:
    """Simulations of a problem's windows: how far they miss measured positions, in what the base misses."""

    def __init__(self, problem: Problem, candidates: Offers) -> None:
        every, index = problem.windows, problem.simulator.state.index
        self._problem = problem.slopes.on(every.take(evenly(len(every), WINDOWS)))
        self._candidates = [c for c in candidates if not c.variant]
        at = [index(c.name) for c in problem.simulator.coordinates]
        self._seen = [i for i in at if problem.observed[i]]
        self._usual, self._errors = self._missed(Hypothesis()).mean(axis=0) + 1e-24, dict[_Fit, FloatArray]()

    def _missed(self, hypothesis: Hypothesis) -> FloatArray:
        """(W, Q) mean squares of positions."""
        starts = self._problem.windows.measured[None, :, 0]
        left = self._problem.residuals(hypothesis, hypothesis.theta[None], starts)[0][:, :, self._seen]
        return np.asarray((np.clip(np.nan_to_num(left, nan=3.0), -3.0, 3.0) ** 2).mean(axis=1))

    def share(self, hypothesis: Hypothesis) -> FloatArray:
        """(W,) what a hypothesis misses, the mean over all positions."""
        share = np.sqrt(self._missed(hypothesis) / self._usual).mean(axis=1)
        return np.asarray(np.minimum(share, WORST))

    def each(self, fit: _Fit) -> FloatArray:
        """(W,) the same of a fit."""
        if fit not in self._errors:
            all_of_it, values = Hypothesis(), fit.values
            for c in self._candidates:
                nothing = (c.declared[0].none,)
                if (own := values.get(c.identity, (nothing,))[0])[0] != nothing[0]:
                    all_of_it = all_of_it.plus(c.term(own), c.declared)
            self._errors[fit] = self.share(all_of_it)
        return self._errors[fit]

    def error(self, fit: _Fit) -> float:
        """The mean over windows."""
        return float(self.each(fit).mean())

    def surest(self, fits: Sequence[_Fit]) -> _Fit:
        """Of those that are as good as the best the one that is least uncertain: bands differ in noise and in news."""
        return min(self.good(fits), key=lambda fit: float(np.median(np.log(fit.deviations))))

    def good(self, fits: Sequence[_Fit]) -> list[_Fit]:
        """Those that are as good as the best."""
        best = self.each(min(fits, key=self.error))
        more = [self.each(fit) - best for fit in fits]
        return [fit for fit, e in zip(fits, more, strict=True) if e.mean() <= ALIKE + e.std() / len(e) ** 0.5]

    def better(self, fit: _Fit, others: Sequence[_Fit], share: float) -> _Fit:
        """The best of the others, where it misses less than this share of what the first one misses."""
        best = min(others, key=self.error, default=fit)
        return best if self.error(best) < share * self.error(fit) else fit


@dataclass(frozen=True)
class _Row:
    """A candidate whose first parameter is sized, and the coordinate at which it acts; -1: at several.

    moment: 1 to 3 where that is times its place along an axis of its body, as of a payload; 4 to 6 times its square.
    slowed: what the velocity gain of the joint's servo gives [N m s], by which it may be less than nothing;
    along: of a drive that two joints turn, each and how often it does.
    """

    candidate: Candidate
    joint: int
    moment: int = 0
    slowed: float = 0.0
    along: tuple[tuple[int, float], ...] = ()

    @property
    def kind(self) -> str:
        """Its family, but a body's mass is one by itself."""
        return MASS if self.candidate.place.on.endswith(MASS) else self.candidate.family

    @property
    def order(self) -> int:
        """Of its moment."""
        return -(-self.moment // 3)

    @property
    def bounds(self) -> tuple[float, float]:
        """Of its size."""
        p = self.candidate.declared[0]
        if self.moment:
            far = p.high * self.candidate.place.reach**self.order
            return (-far if self.order == 1 else 0.0), far
        return WIDEST if self.kind in OFF else (MOSTLY * (p.low - self.slowed), p.high)


class _Log:
    """A recording in pieces on an even clock, and what may be asked of it.

    at: (C,) columns; columns: (Q,) of all positions; paths: (C,) places among these; rows: friction, rotors and offsets
    of joints whose position was measured; slowing: joint -> velocity gain of its servo; kinds: what else may be off,
    one at a time: all motors' gains, or a mass (of servos neither: what they give has no other measure than bodies);
    loads: what the last bodies may carry; ties: drives that turn with two joints, and both of two joints together; dry:
    (C,) the model's own dry friction, left out of it; pieces: episodes, moments (N,), positions (N, Q).
    """

    def __init__(
        self, problem: Problem, system: BlackBoxStepper, recording: Recording, offers: Offers
    ) -> None:
        self.problem, self.system, self.dt = problem, system, recording.dt
        self.candidates = candidates = [c for c in offers if not c.variant]
        index, coordinates = problem.simulator.state.index, problem.simulator.coordinates
        self.at = np.array([index(c.name) for c in coordinates])
        self.columns = list(system.positions)
        self.paths = [self.columns.index(column) for column in self.at]
        seen = {c.name: i for i, c in enumerate(coordinates) if problem.observed[self.at[i]]}
        self.ties = self._ties_among(seen)
        self.late = [c for c in candidates if c.family == LATE]
        self.servos = [c for c in candidates if c.place.on.endswith(STIFF)]
        drives = problem.simulator.drives
        driven = [*drives.values()]
        alone = {a: seen[on] for a, on in drives.items() if on in seen and driven.count(on) == 1}
        self.slowing = {
            alone[action]: c
            for c in candidates
            if c.place.on.endswith(SLOW) and (action := c.place.on.removesuffix(SLOW)) in alone
        }
        slowed = dict[tuple[str, str], float]()
        if self.slowing:
            slowly = np.zeros((2, len(problem.simulator.state)))
            slowly[1, [index(c.velocity) for c in coordinates]] = SLOWLY
            none = np.zeros((2, len(problem.simulator.action)))
            given = problem.simulator.given(slowly, none, problem.parameters)
            slowed = {(VISCOUS, on): float(still - slow) / SLOWLY for on, (still, slow) in given.items()}
        self.rows = [
            _Row(c, seen[c.place.on], slowed=slowed.get(c.identity, 0.0))
            for c in candidates
            if c.family in ROWS and c.place.on in seen
        ]
        motors = [_Row(c, alone[c.place.on]) for c in candidates if c.family == GAIN and c.place.on in alone]
        masses = [[_Row(c, -1)] for c in candidates if c.place.on.endswith(MASS)]
        loads = [c for c in candidates if c.family == LOAD][-CARRIERS:]
        self.loads = [[_Row(c, -1, moment) for moment in range(7)] for c in loads]
        self.kinds = [motors, *masses] if motors and not self.servos else masses
        self.bodies = [*masses, *self.loads]
        if len(system.positions) > len(coordinates):  # bodies of what floats are asked by rollouts
            self.kinds, self.loads, self.bodies = [motors] if motors else [], [], []
        own = [r for r in self.rows if r.kind == DRY and r.candidate.place.friction > 0.0]
        self.dry = np.zeros(len(coordinates))
        self.dry[[r.joint for r in own]] = [r.candidate.place.friction for r in own]
        self.without_dry = [r.candidate.term((-r.candidate.place.friction,)) for r in own]
        pieces = [piece for episode in recording.episodes for piece in self._pieces(episode)]
        share = LONGEST / max(sum(len(t) for _, t, _ in pieces), 1)
        self.pieces = [pieces[i] for i in evenly(len(pieces), max(int(share * len(pieces)), 1))]

    def _ties_among(self, seen: Mapping[str, int]) -> list[list[_Row]]:
        """Of joints that were read, by their numbers."""
        places, alone = self.problem.simulator.model_places, defaultdict[str, list[_Row]](list)
        both = defaultdict[frozenset[int], list[_Row]](list)
        for c in self.candidates:
            if c.family in TIED:
                along = places[c.family][c.place.on].along
                if all(name in seen for name, _ in along):
                    row = _Row(c, -1, along=tuple((seen[name], turns) for name, turns in along))
                    alone[c.place.on].append(row)
                    both[frozenset(joint for joint, _ in row.along)].append(row)
        return [*alone.values(), *both.values()]

    def _pieces(self, e: Episode) -> list[tuple[Episode, FloatArray, FloatArray]]:
        from scipy.interpolate import CubicSpline  # here: most commands need not wait for it

        e = replace(e, actions=self.system.acting(e.actions, e.t))
        wraps, found = np.array(self.problem.simulator.state.wraps)[self.columns], []
        weights = np.ones_like(e.states) if e.weights is None else e.weights
        good = np.flatnonzero(weights[:, self.columns].min(axis=1) > 0)
        for run in np.split(good, np.flatnonzero(np.diff(e.t[good]) > GAP * self.dt) + 1):
            if len(run) >= SHORTEST:
                q = e.states[run][:, self.columns]
                path = CubicSpline(e.t[run], np.where(wraps, np.unwrap(q, axis=0), q))
                grid = np.arange(e.t[run[0]], e.t[run[-1]], self.dt)
                found += [(e, t, path(t)) for t in np.array_split(grid, -(-len(grid) // PIECE))]
        return found


class _Forces:
    """Forces below a frequency [Hz], as servos of so many times the believed stiffness give them.

    motion: (3, N, C) positions, speeds and accelerations; way: (N, C) which way joints go, -1 to 1; counts: (K, C) what
    a row counts at a joint, little where that hardly moves, nothing where something pushes it; told: rows at most.
    """

    def __init__(self, log: _Log, band: float, stiff: float = 1.0) -> None:
        self.log, self.band, self.stiff = log, band, stiff
        every = max(int(1.0 / (FINE * band * log.dt)), 1)
        self.dt, self._moments = every * log.dt, [(e, t[::every]) for e, t, _ in log.pieces]
        moved = [below(band, q, log.dt, 3)[:, ::every] for _, _, q in log.pieces]
        path = np.concatenate(moved, axis=1)
        self.motion, (self.states, self._rates) = path[:, :, log.paths], log.system.motion(path)
        self._noise = 2.0 * np.pi * band * np.sqrt(2.0 / 3.0 * band * log.dt) * log.problem.floor[log.at]
        self.way = np.tanh(self.motion[1] / np.maximum(TURNS * self.motion[1].std(axis=0), self._noise))
        moves = self._heard(np.abs(self.way), plain=True) > np.tanh(1.0)
        pushed = np.abs(self._heard(log.system.hindered(self.states).astype(np.float64))) > PUSHED
        self.counts = np.where(pushed, 0.0, np.where(moves, 1.0, STICKS))
        self.told, self._given = int((self.counts > 0).sum(axis=0).max()), dict[float, FloatArray]()
        self._loads, self._bodies = dict[object, FloatArray](), dict[_Row, FloatArray]()
        self._ties = dict[tuple[tuple[int, float], ...], dict[str, FloatArray]]()

    def commands(self, late: float) -> FloatArray:
        """(N, A): what was commanded so much [s] earlier, as a line through the middles of what was held."""
        out = []
        for e, t in self._moments:
            given = [np.interp(t - late, (e.t[1:] + e.t[:-1]) / 2.0, u) for u in e.actions.T]
            out.append(np.reshape(given, (-1, len(t))).T)
        return np.concatenate(out)

    def _lacking(self, commands: FloatArray, *terms: Term) -> FloatArray:
        """(K, C): what the motion takes beyond what the model, with these terms, is given."""
        log, parameters = self.log, dict(self.log.problem.parameters)
        parameters |= {c.place.on: self.stiff * parameters[c.place.on] for c in log.servos}
        moved, every = (self.states, commands, self._rates), [*log.without_dry, *terms]
        lacks = np.nan_to_num(log.system.lacking_force(*moved, parameters, every), posinf=0.0, neginf=0.0)
        return self._heard(lacks + log.dry * self.way)

    def _heard(self, force: FloatArray, plain: bool = False) -> FloatArray:
        """(K, ...): forces (N, ...) below the lower frequency, or as they are, at rows that are new and settled."""
        out, period = [], 1.0 / self.band / self.dt
        edge, step = int(period) + 1, max(int(period * NARROWER / 4.0), 1)
        for part in np.split(force, np.cumsum([len(t) for _, t in self._moments])[:-1]):
            low = part if plain else below(self.band / NARROWER, part, self.dt)[0]
            out.append(low[edge : max(len(part) - edge, edge) : step])
        return np.concatenate(out)

    @cached_property
    def _none(self) -> FloatArray:
        """(N, A): no commands."""
        return 0.0 * self.commands(0.0)

    @cached_property
    def takes(self) -> FloatArray:
        """(K, C): what the model takes for the motion where nothing is commanded."""
        return self._lacking(self._none)

    def gives(self, late: float) -> FloatArray:
        """(K, C): what drives give beyond what the model takes, where commands come so late."""
        if late not in self._given:
            self._given[late] = -self._lacking(self.commands(late))
        return self._given[late]

    @cached_property
    def of_rows(self) -> FloatArray:
        """(K, C, R): what rows of size 1 take."""
        moved = np.stack([self.motion[1], self.way, self.motion[2], -np.ones_like(self.way)], axis=2)
        heard = dict(zip(ROWS, np.moveaxis(self._heard(moved), 2, 0), strict=True))
        out = np.zeros((*self.counts.shape, len(self.log.rows)))
        for i, row in enumerate(self.log.rows):
            out[:, row.joint, i] = heard[row.kind][:, row.joint]
        return out

    def of(self, row: _Row, late: float) -> FloatArray:
        """(K, C): what a row, or what else may be off, takes; by how much less is given where commands come later."""
        if row.kind in ROWS:
            return np.asarray(self.of_rows[:, :, self.log.rows.index(row)])
        if row.along:
            return self._of_tie(row.along)[row.kind]
        if row.kind == GAIN:
            return np.where(np.arange(self.takes.shape[1]) == row.joint, self.takes, 0.0)
        if row.kind == LATE:
            more = self.log.dt / 4.0
            return np.asarray((self.gives(late - more) - self.gives(late + more)) / (2.0 * more))
        if row not in self._bodies:
            self._bodies[row] = self._of_body(row)
        return self._bodies[row]

    def _of_tie(self, along: tuple[tuple[int, float], ...]) -> dict[str, FloatArray]:
        """Family -> (K, C): what friction and a rotor of size 1 take of joints that turn a drive so often each."""
        if along not in self._ties:
            joints, turns = (list(each) for each in zip(*along, strict=True))
            speed, acceleration = self.motion[1:, :, joints] @ np.array(turns)
            noise = float(np.hypot.reduce(self._noise[joints]))
            way = np.tanh(speed / max(TURNS * float(speed.std()), noise))
            heard = self._heard(np.stack([speed, way, acceleration], axis=1))
            out = np.zeros((len(TIED), *self.counts.shape))
            out[:, :, joints] = heard.T[:, :, None] * turns
            self._ties[along] = dict(zip(TIED, out, strict=True))
        return self._ties[along]

    def _of_body(self, row: _Row) -> FloatArray:
        """(K, C): what all of a body's mass takes, or a kilogram at the origin of its frame; its moments a metre off.

        A load's forces are linear in its mass, its first and its second moments, of which only the first change sign
        with its place. What drives give does not depend on bodies.
        """
        if row.kind == MASS:
            heavier = row.candidate.term((1.0 + OFF[MASS],))
            return (self._lacking(self._none, heavier) - self.takes) / OFF[MASS]
        reach, at = row.candidate.place.reach, np.zeros(3)
        if not row.moment:
            return self._loaded(row.candidate, at)
        at[(row.moment - 1) % 3] = reach
        one, other = (self._loaded(row.candidate, place) for place in (at, -at))
        if row.order == 1:
            return 0.5 * (one - other) / reach
        return (0.5 * (one + other) - self._loaded(row.candidate, 0.0 * at)) / reach**2

    def _loaded(self, load: Candidate, place: FloatArray) -> FloatArray:
        """(K, C): what a kilogram takes at a place of a body's frame."""
        key = load.identity, tuple(place)
        if key not in self._loads:
            some = load.place.span
            self._loads[key] = (self._lacking(self._none, load.term((some, *place))) - self.takes) / some
        return self._loads[key]

    def prior(self, rows: Sequence[_Row], columns: FloatArray) -> FloatArray:
        """(R,) deviations a priori of sizes of rows with these columns (K, C, R)."""
        usual = {r.joint: USUAL * r.candidate.declared[0].scale for r in self.log.rows if r.kind == PUSH}
        moved = np.sqrt((columns**2).sum(axis=1).mean(axis=0)) + 1e-12
        out = []
        for row, rms in zip(rows, moved, strict=True):
            wide = ROWS.get(TIED.get(row.kind, row.kind))
            if wide is not None:
                joints = [joint for joint, _ in row.along] or [row.joint]
                out.append(wide * max(usual.get(joint, 1.0) for joint in joints) / rms)
            else:
                place = row.candidate.place
                out.append(place.span * place.reach**row.order if row.kind == LOAD else OFF[row.kind])
        return np.array(out)

    def late(self, more: Sequence[_Row] = ()) -> float:
        """How late commands come [s], by a scan of what rows then leave of forces; 0 where that is as likely."""
        high, weights = min([LATEST, *(c.declared[0].high for c in self.log.late)]), self.counts
        scan = np.arange(0.0, high, max(STEP, self.log.dt / 2.0)) if self.log.late else np.zeros(1)
        nats = 0.5 * (scan / self.log.dt) ** 2 + (scan > 0.0) * (ENOUGH + 0.5 * np.log(NEWS * len(weights)))
        a = np.concatenate([self.of_rows, *(self.of(row, 0.0)[:, :, None] for row in more)], axis=2)
        basis = np.linalg.qr((a * weights[:, :, None]).reshape(weights.size, -1))[0]
        for i, late in enumerate(scan):
            y = (self.gives(late) * weights).ravel()
            left = ((y - basis @ (basis.T @ y)).reshape(weights.shape) ** 2).sum(axis=0)
            nats[i] += 0.5 * NEWS * float((weights**2).sum(axis=0) @ np.log(np.maximum(left, 1e-300)))
        return float(scan[int(np.argmin(nats))])

    def fitted(self, late: float = 0.0, more: Sequence[_Row] = ()) -> _Fit:
        """Rows and what else may be off, by least squares."""
        further = [*more, *([_Row(self.log.late[0], -1)] if late > 0.0 else [])]
        a = np.concatenate([self.of_rows, *(self.of(row, late)[:, :, None] for row in further)], axis=2)
        rows = [*self.log.rows, *further]
        prior = self.prior(rows, a)
        bounds = np.array([(-late, late) if row.kind == LATE else row.bounds for row in rows]).T
        sizes, sd, told, was, left = least_squares(a, self.gives(late), self.counts, prior, bounds)
        return _Fit(self, late + float(sizes[-1]) if late > 0.0 else 0.0, rows, sizes, sd, told, was, left)


@dataclass(frozen=True, eq=False)
class _Fit:
    """Sizes, deviations and whether rows are told (P,); mean squares at joints (C,); joints that friction holds."""

    forces: _Forces
    late: float
    rows: list[_Row]
    sizes: FloatArray
    deviations: FloatArray
    told: BoolArray
    was: FloatArray
    left: FloatArray
    held: tuple[int, ...] = ()

    def holding(self, joints: Sequence[int]) -> _Fit:
        """The same with as much dry friction as holds joints that mostly stand: nothing else of them shows."""
        forces, held = self.forces, list[int]()
        sizes, deviations, told = self.sizes.copy(), self.deviations.copy(), self.told.copy()
        for i, row in enumerate(self.rows):
            counts = forces.counts[:, row.joint]
            if row.kind == DRY and row.joint in joints and (counts == STICKS).sum() > (counts == 1.0).sum():
                mine = [r.joint == row.joint and r.kind in ROWS and r.kind != PUSH for r in self.rows]
                least, sizes[mine], told[mine], told[i] = sizes[i], 0.0, False, True
                lacks = forces.gives(self.late) - forces.of_rows @ sizes[: len(forces.log.rows)]
                holds = np.quantile(np.abs(lacks[counts == STICKS, row.joint]), HOLDS)
                sizes[i] = np.clip(holds, least, row.bounds[1])
                deviations[i] = ROUGHLY * sizes[i]
                pushed = [r.joint == row.joint and r.kind == PUSH for r in self.rows]
                deviations[pushed] = np.maximum(deviations[pushed], sizes[i])  # it may hold as much as that
                held.append(row.joint)
        return replace(self, sizes=sizes, deviations=deviations, told=told, held=tuple(held))

    def again(self, forces: _Forces) -> _Fit:
        """The same asked of forces in another band."""
        forces = _Forces(forces.log, forces.band, self.forces.stiff)
        return forces.fitted(self.late, self.further).holding(self.held)

    @property
    def further(self) -> list[_Row]:
        """What else is off."""
        return [row for row in self.rows if row.along or row.kind in (GAIN, MASS, LOAD)]

    @cached_property
    def nats(self) -> float:
        """What is left of forces, as a code length, and half a logarithm of news for each number beside the rows."""
        news = NEWS * (self.forces.counts**2).sum(axis=0)
        return 0.5 * float(news @ np.log(self.left) + len(self.further) * np.log(news.mean()))

    def with_bodies(self) -> _Fit:
        """The same with the bodies that forces find to be off, one by one, where all blocks agree on how much."""
        best = self
        for _ in range(BODIES):
            asked = [kind for kind in best.forces.log.bodies if kind[0] not in best.rows]
            every = [best.beside(kind) for kind in asked]
            found = [fit for fit, kind in zip(every, asked, strict=True) if fit.agree_on(kind)]
            more = min(found, key=lambda fit: fit.nats, default=best)
            if more.nats > best.nats - NAMED:
                break
            best = more
        return best

    def with_ties(self) -> _Fit:
        """The same with drives that turn with two joints, one by one, where both joints ask for them."""
        best = self
        for _ in range(BODIES):
            asked = [kind for kind in best.forces.log.ties if not any(row in best.rows for row in kind)]
            every = [best.beside(kind) for kind in asked if best.both_ask_for(kind)]
            more = min([best, *every], key=lambda fit: fit.nats + NAMED * len(fit.further))
            if more is best:
                break
            best = more
        return best

    def both_ask_for(self, kind: Sequence[_Row]) -> bool:
        """Whether friction of a drive takes off much of what its rotor leaves at both joints.

        What does so at one is no drive; a rotor alone is the inertia of a body, where axes are parallel.
        """
        rotors = [row for row in kind if TIED[row.kind] == "armature"]
        return bool((self._left_beside(kind) < SURELY**2 * self._left_beside(rotors, kind)).all())

    def _left_beside(self, more: Sequence[_Row], kind: Sequence[_Row] = ()) -> FloatArray:
        """(2,) mean squares at the joints of a kind of drive with more rows beside those that act there."""
        joints, forces = [joint for joint, _ in (*kind, *more)[0].along], self.forces
        rows = [r for r in self.rows if {r.joint, *(joint for joint, _ in r.along)} & {*joints}] + [*more]
        a = np.stack([forces.of(row, self.late) for row in rows], axis=2)
        prior, bounds = forces.prior(rows, a), np.array([row.bounds for row in rows]).T
        given, counts = forces.gives(self.late)[:, joints], forces.counts[:, joints]
        return least_squares(a[:, joints], given, counts, prior, bounds)[-1]

    def beside(self, kind: Sequence[_Row]) -> _Fit:
        """The same, and more that may be off."""
        return self.forces.fitted(self.late, [*self.further, *kind]).holding(self.held)

    def later(self) -> list[_Fit]:
        """The same, or none, with commands that come as late as leaves the least of forces."""
        late = self.forces.late(self.further)
        return [self.forces.fitted(late, self.further).holding(self.held)] if late > 0.0 else []

    def agree_on(self, kind: Sequence[_Row]) -> bool:
        """Whether every block of the log says as much of a mass."""
        i, (low, high) = self.rows.index(kind[0]), kind[0].bounds
        return bool(low < self.sizes[i] < high and abs(self.sizes[i]) > AGREED * self.deviations[i])

    @cached_property
    def values(self) -> dict[tuple[str, str], tuple[tuple[float, ...], tuple[float, ...]]]:
        """Of what the log tells the values and their deviations."""
        both = zip(self.rows, self.sizes, strict=True)
        gains = {row.joint: 1.0 / (1.0 + size) for row, size in both if row.kind == GAIN}
        out = dict[tuple[str, str], tuple[tuple[float, ...], tuple[float, ...]]]()
        log, stiff = self.forces.log, self.forces.stiff
        for row, size, sd, told in zip(self.rows, self.sizes, self.deviations, self.told, strict=True):
            gain, p = gains.get(row.joint, 1.0), row.candidate.declared[0]
            value, slope = {GAIN: (gain, gain**2), MASS: (1.0 + size, 1.0), LOAD: (size, 1.0)}.get(
                row.kind, (size * gain, gain)
            )
            if row.kind == LATE:
                out |= {c.identity: ((self.late,), (float(sd),)) for c in log.late}
            elif row.order == 1 and row.candidate.identity in out:  # over the mass, which comes first
                mass, sds = out[row.candidate.identity]
                own, at = row.candidate.declared[row.moment], float(size) / max(mass[0], 1e-9)
                far = float(np.hypot(sd, at * sds[0])) / max(mass[0], 1e-9)
                out[row.candidate.identity] = (*mass, float(np.clip(at, own.low, own.high))), (*sds, far)
            elif row.along and size <= 0.0:
                continue
            elif told and not row.moment and (row.kind != LOAD or size > 0.0):
                out[row.candidate.identity] = (float(np.clip(value, p.low, p.high)),), (float(sd * slope),)
                # The servo slows its joint by less than its model says.
                if row.joint in log.slowing and row.slowed and value < p.low:
                    ratio = float(1.0 + (value - p.low) / row.slowed), float(sd / row.slowed)
                    out[log.slowing[row.joint].identity] = ratio[:1], ratio[1:]
        return out | {c.identity: ((stiff,), (ROUGHLY * stiff,)) for c in log.servos if stiff != 1.0}
