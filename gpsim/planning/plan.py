"""A plan for the next recording: pieces of commands one after another, and what they are expected to teach."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from scipy.special import betaincinv

from gpsim.channels import FloatArray, IntArray
from gpsim.effects import Term
from gpsim.errors import UsageError
from gpsim.planning.information import separations, unvisited
from gpsim.planning.limits import Limits, PlanSettings, check_first
from gpsim.planning.models import Machine, drawn_model, model_of
from gpsim.planning.search import FEWEST, Candidate, Search, Situation, Tried
from gpsim.planning.signals import FIXED
from gpsim.posterior import Explanation, LeftOpen

Note = Callable[[int, int, str], None]
LEVELS = (1.0, 0.7, 0.5, 0.35, 0.25, 0.15, 0.1, 0.05)  # of a fixed excitation, tried until it is safe
SAME = 1e-3  # relative difference of two values that is none
FORCE = "the force on {on}"
SENSORS = {
    "actuator": "what {on} delivers (its force, torque, current or speed)",
    "sensor": "{on} by a second sensor",
    "parameter": "{on} itself (weigh it, measure its length)",
    "vehicle": "the wheels' steering angle and speeds",
}
LIKELY = 0.9  # of the stated chance that a draw leaves the box


@dataclass(frozen=True)
class Piece:
    """A stretch of a plan: begin [s], seconds, and which kind of signal it grew from."""

    kind: str
    begin: float
    seconds: float


@dataclass(frozen=True)
class Apart:
    """How far a pair is separated, in nats: by the plan, a minute of it, of each fixed excitation and of the old one.

    sensors: where no command separates the pair, what to measure.
    """

    first: str
    second: str
    nats: float
    a_minute: float
    fixed: dict[str, float]
    recorded: float
    separated: bool
    sensors: tuple[str, ...]


@dataclass(frozen=True)
class Safety:
    """left: of so many `draws` how many left the box less its margin or did not come back; `most`: the chance of it.

    most: the upper end of the 90 % interval.
    """

    draws: int
    left: int
    most: float
    margin: float


@dataclass(frozen=True)
class Plan:
    """What is played: t (K,) s, commands (K, A), episode (K,); courses: explanation -> (K, S) what it foresees.

    dithers: whether the commands are added to those of a policy, in a closed loop.
    """

    dt: float
    t: FloatArray
    commands: FloatArray
    episode: IntArray
    pieces: tuple[Piece, ...]
    pairs: tuple[Apart, ...]
    safety: Safety
    courses: dict[str, FloatArray]
    anew: bool
    dithers: bool

    @property
    def minutes(self) -> float:
        """How long it takes."""
        return len(self.t) * self.dt / 60.0


def make_plan(
    machine: Machine,
    posterior: LeftOpen,
    limits: Limits,
    settings: PlanSettings,
    minutes: float,
    rng: np.random.Generator,
    note: Note = lambda done, total, text: None,
    anew: bool = False,
) -> Plan:
    """Plan the next recording; raises UsageError where nothing can be played safely.

    anew: whoever plays it puts the machine back to rest before each piece, which is then an episode of its own.
    """
    for one in posterior.explanations:
        if (name := one.undetermined) is not None:  # no draw of it means anything
            raise UsageError(
                f"the recording does not determine {name}: its posterior is singular, so no motion can be predicted; "
                "record more, or fix it (diagnose.known)"
            )
    check_first(limits, machine.simulator.state, settings.margin)
    search = _search_of(machine, posterior, limits, settings, rng, anew)
    _check_rest(search)
    steps = max(int(minutes * 60.0 / machine.dt + 1e-9), len(search.t) + search.settled)
    chosen, at = _pieces(search, search.begin(unvisited(posterior.visited.rows)), steps, note)
    fixed = {}
    for kind in FIXED:
        note(steps, steps, f"comparing with a {kind}")
        fixed[kind] = _fixed_rates(search, kind, sum(tried.commands.shape[1] for _, tried in chosen))
    return _put_together(search, posterior, chosen, at, fixed)


def _search_of(
    machine: Machine,
    posterior: LeftOpen,
    limits: Limits,
    settings: PlanSettings,
    rng: np.random.Generator,
    anew: bool,
) -> Search:
    """What candidates are judged by."""
    found, names = posterior.explanations, machine.simulator.state.names
    each = -(-settings.checked // len(found))
    heard = np.array([posterior.left.get(n, 0.0) for n in names])
    driven = max(round(settings.piece / machine.dt), FEWEST)
    return Search(
        tuple(model_of(machine, e, settings.draws, rng) for e in found),
        tuple(drawn_model(machine, e, each, rng, heard) for e in found),
        np.array([posterior.noise.get(n, np.inf) for n in names]),
        limits,
        settings,
        anew,
        rng,
        machine.dt * np.arange(driven, dtype=np.float64),
        0 if anew else round(settings.settle / machine.dt),
    )


def _check_rest(search: Search) -> None:
    """Raise UsageError where a machine that is left alone does not stay where it rests."""
    if search.anew:
        return
    nothing = Candidate("rest", np.zeros((len(search.t) + search.settled, len(search.limits.low))))
    tried = search.tried(search.begin(unvisited(np.zeros((1, 1)))), [nothing])
    if tried.safe[0]:
        return
    names, limits = search.models[0].machine.simulator.state.names, search.limits
    ends = np.concatenate([t[:, 0, -1] for t in tried.true])
    off = np.abs(ends - limits.rest)
    reach = np.where(np.isfinite(limits.reach), limits.reach, np.inf)
    worst = int(np.argmax(off.max(axis=0) / reach))
    rest, end = limits.rest[worst], ends[np.argmax(off[:, worst]), worst]
    if search.around is not None:
        raise UsageError(
            f"--policy: it may leave the box or not return to rest: {names[worst]} ends {off[:, worst].max():.3g} "
            "away; widen plan.box, or raise plan.settle or plan.returns"
        )
    raise UsageError(
        f"plan.rest: without commands, {names[worst]} goes from {rest:.3g} to {end:.3g}; set plan.rest and "
        "plan.rest_commands, or widen plan.box, or reset by hand before each piece (--anew)"
    )


def _pieces(
    search: Search, at: Situation, steps: int, note: Note
) -> tuple[list[tuple[Candidate, Tried]], Situation]:
    """Pieces until there is no time for another."""
    chosen: list[tuple[Candidate, Tried]] = []
    played = 0
    while True:
        note(played, steps, f"piece {len(chosen) + 1}")
        found = search.next(at, steps - played)
        if found is None:
            break
        candidate, tried, at = found
        chosen.append((candidate, tried))
        played += tried.commands.shape[1]
    if not chosen:
        raise UsageError(
            "no commands keep the states in the box under every explanation; widen plan.box, lower plan.piece, raise "
            "plan.settle, or reset by hand before each piece (--anew)"
        )
    return chosen, at


def _put_together(
    search: Search,
    posterior: LeftOpen,
    chosen: Sequence[tuple[Candidate, Tried]],
    at: Situation,
    fixed: dict[str, FloatArray],
) -> Plan:
    dt = search.models[0].machine.dt
    commands = np.concatenate([tried.commands[0] for _, tried in chosen])
    lengths = [tried.commands.shape[1] for _, tried in chosen]
    begins = np.cumsum(lengths) - lengths
    pieces = tuple(
        Piece(c.kind, round(dt * begin, 9), round(dt * n, 9))
        for (c, _), begin, n in zip(chosen, begins, lengths, strict=True)
    )
    episode = np.repeat(np.arange(len(chosen)) * search.anew, lengths)
    t = dt * (np.arange(len(commands)) - (np.repeat(begins, lengths) if search.anew else 0.0))
    minutes = dt * len(commands) / 60.0
    nats = separations(search.models, at.sums)[0]
    courses = {
        label: np.concatenate([tried.said[k][0, 0, :-1] for _, tried in chosen])
        for k, label in enumerate(_labels(posterior.explanations))
    }
    pairs = _apart(posterior, nats, fixed, minutes, search.settings.visible)
    safety = _safety(search, chosen)
    dithers = search.around is not None
    return Plan(dt, t, commands, episode, pieces, pairs, safety, courses, search.anew, dithers)


def _labels(explanations: Sequence[Explanation]) -> list[str]:
    """What each says beyond what all of them say."""
    claims = [e.hypothesis.claims for e in explanations]
    shared = frozenset.intersection(*claims) if len(claims) > 1 else ()
    named = []
    for one in explanations:
        own = [f"{t.family} on {t.on}" for t in one.hypothesis.terms if t.identity not in shared]
        named.append(" + ".join(own) or one.label)
    return [name if named.count(name) == 1 else f"{name} ({i + 1})" for i, name in enumerate(named)]


def _apart(
    posterior: LeftOpen, nats: FloatArray, fixed: dict[str, FloatArray], minutes: float, visible: float
) -> tuple[Apart, ...]:
    found, names = posterior.explanations, _labels(posterior.explanations)
    recorded = max(posterior.visited.seconds / 60.0, 1e-9)
    out = []
    for i, (a, b) in enumerate(combinations(range(len(found)), 2)):
        odds = abs(np.log(max(found[a].probability, 1e-12) / max(found[b].probability, 1e-12)))
        told, rates = bool(nats[i] >= visible), {kind: float(values[i]) for kind, values in fixed.items()}
        sensors = () if told else sensors_for(found[a], found[b])
        size, old = float(nats[i]), float(odds / recorded)
        out.append(Apart(names[a], names[b], size, float(nats[i] / minutes), rates, old, told, sensors))
    return tuple(out)


def sensors_for(one: Explanation, other: Explanation) -> tuple[str, ...]:
    """What to measure beside the motion where no command tells: each quantity of which the two say something else."""
    first, second = ({term.identity: term for term in e.hypothesis.terms} for e in (one, other))

    def alike(term: Term, theirs: Term | None) -> bool:
        if theirs is None:
            return False
        values = ((v, theirs.values.get(k, v)) for k, v in term.values.items())
        return all(abs(v - w) <= SAME * max(abs(v), 1e-12) for v, w in values)

    both = ((first, second), (second, first))
    differing = [t for mine, others in both for key, t in mine.items() if not alike(t, others.get(key))]
    return tuple(dict.fromkeys(SENSORS.get(t.effect.site, FORCE).format(on=t.on) for t in differing))


def _fixed_rates(search: Search, kind: str, steps: int) -> FloatArray:
    """(pairs,) nats a minute of a fixed excitation in pieces, about so many steps in all, each as large as is safe."""
    rng = np.random.default_rng(0)
    at, blank = search.begin(unvisited(np.zeros((1, 1)))), len(search.t) + search.settled
    count = max(round(steps / blank), 1)
    for _ in range(count):
        drive = search.usual(kind, rng)
        tried = search.tried(at, [Candidate(kind, level * drive) for level in (*LEVELS, 0.0)])
        safe = np.flatnonzero(tried.safe)
        best = int(safe[0]) if safe.size else len(LEVELS)
        sums = at.sums.plus(tried.sums.only(best))
        starts = at.starts if search.anew else tuple(t[:, best, -1] for t in tried.true)
        at = replace(at, starts=starts, sums=sums)
    minutes = count * blank * search.models[0].machine.dt / 60.0
    return np.asarray(separations(search.models, at.sums)[0] / minutes)


def _safety(search: Search, chosen: Sequence[tuple[Candidate, Tried]]) -> Safety:
    """Draws of every posterior play the whole plan."""
    left = draws = 0
    limits, settings = search.limits, search.settings
    for model in search.checkers:
        count, time = len(model.thetas), 0.0
        state, out = np.tile(limits.rest, (count, 1)), np.zeros(count, dtype=bool)
        for _, tried in chosen:
            true = model.said(state, tried.commands, limits.idle, time)[1][:, 0]
            out |= ~limits.inside(true, settings.margin).all(axis=1)
            if not search.anew:
                out |= ~limits.back(true[:, -1], settings.returns)
                state = true[:, -1]
            time += model.machine.dt * tried.commands.shape[1]
        left, draws = left + int(out.sum()), draws + count
    # The one-sided upper end of the 90 % interval of a share (Clopper and Pearson 1934).
    most = 1.0 if left >= draws else float(betaincinv(left + 1, draws - left, LIKELY))
    return Safety(draws, left, most, settings.margin)
