"""A plan for the next recording: pieces of commands one after another, and what they are expected to teach."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import betaincinv

from gpsim.channels import FloatArray, IntArray
from gpsim.errors import UsageError
from gpsim.planning.fixed import fixed_rates
from gpsim.planning.information import separations, unvisited
from gpsim.planning.limits import Limits, check_first
from gpsim.planning.models import Machine, drawn_model, model_of
from gpsim.planning.search import FEWEST, Candidate, Search, Situation, Tried
from gpsim.planning.sensors import sensors_for
from gpsim.planning.settings import PlanSettings
from gpsim.planning.signals import FIXED
from gpsim.posterior import Explanation, LeftOpen

Note = Callable[[int, int, str], None]
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
    check_determined(posterior.explanations)
    check_first(limits, machine.simulator.state, settings.margin)
    search = search_of(machine, posterior, limits, settings, rng, anew)
    _check_rest(search)
    steps = max(int(minutes * 60.0 / machine.dt + 1e-9), len(search.t) + search.settled)
    chosen, at = _pieces(search, search.begin(unvisited(posterior.visited.rows)), steps, note)
    fixed = {}
    for kind in FIXED:
        note(steps, steps, f"comparing with a {kind}")
        fixed[kind] = fixed_rates(search, kind, sum(tried.commands.shape[1] for _, tried in chosen))
    return _put_together(search, posterior, chosen, at, fixed)


def check_determined(explanations: Sequence[Explanation]) -> None:
    """Raise UsageError where nothing is known of a parameter: no draw of it means anything."""
    for one in explanations:
        if (name := one.undetermined) is not None:
            raise UsageError(
                f"the recording says nothing of {name}: its posterior is singular and no motion can be foreseen; "
                "record more, or fix it (diagnose.known)"
            )


def search_of(
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
    state, limits = search.models[0].machine.simulator.state, search.limits
    ends = np.concatenate([t[:, 0, -1] for t in tried.true])
    far = np.abs(ends - limits.rest).max(axis=0) / np.where(np.isfinite(limits.reach), limits.reach, np.inf)
    worst = int(np.argmax(far))
    name, off = state.names[worst], np.abs(ends - limits.rest).max(axis=0)[worst]
    if search.around is not None:
        raise UsageError(
            f"--policy: under some explanation it leaves the box or does not come back to rest, {name} ends {off:.3g} "
            "off; widen plan.box, lengthen plan.settle, or allow more (plan.returns)"
        )
    raise UsageError(
        f"plan.rest: left alone, the machine does not stay at rest: {state.names[worst]} goes from "
        f"{limits.rest[worst]:.3g} to {ends[np.argmax(np.abs(ends[:, worst] - limits.rest[worst])), worst]:.3g}; state "
        "plan.rest and plan.rest_commands, widen plan.box, or put it back by hand before each piece: --anew, with a "
        "short plan.piece"
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
            "no commands were found that keep the states in the box, with its margin, under every explanation; widen "
            "plan.box, shorten plan.piece, lengthen plan.settle, or put the machine back by hand: --anew"
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
    ends = np.cumsum(lengths)
    pieces = tuple(
        Piece(c.kind, round(dt * (end - n), 9), round(dt * n, 9))
        for (c, _), end, n in zip(chosen, ends, lengths, strict=True)
    )
    episode = np.zeros(len(commands), dtype=np.int64)
    if search.anew:
        episode = np.repeat(np.arange(len(chosen)), lengths)
    t = dt * (np.arange(len(commands)) - (np.repeat(ends - lengths, lengths) if search.anew else 0.0))
    minutes = dt * len(commands) / 60.0
    nats = separations(search.models, at.sums)[0]
    courses = {
        label: np.concatenate([tried.said[k][0, 0, :-1] for _, tried in chosen])
        for k, label in enumerate(labels(posterior.explanations))
    }
    pairs = _apart(posterior, nats, fixed, minutes, search.settings.visible)
    safety = _safety(search, chosen)
    dithers = search.around is not None
    return Plan(dt, t, commands, episode, pieces, pairs, safety, courses, search.anew, dithers)


def labels(explanations: Sequence[Explanation]) -> list[str]:
    """What each says beyond what all of them say."""
    shared = (
        frozenset.intersection(*(e.hypothesis.claims for e in explanations)) if len(explanations) > 1 else ()
    )
    named = []
    for one in explanations:
        own = [f"{t.family} on {t.on}" for t in one.hypothesis.terms if t.identity not in shared]
        named.append(" + ".join(own) or one.label)
    return [name if named.count(name) == 1 else f"{name} ({i + 1})" for i, name in enumerate(named)]


def _apart(
    posterior: LeftOpen, nats: FloatArray, fixed: dict[str, FloatArray], minutes: float, visible: float
) -> tuple[Apart, ...]:
    found, names, out = posterior.explanations, labels(posterior.explanations), []
    recorded = max(posterior.visited.seconds / 60.0, 1e-9)
    order = [(a, b) for a in range(len(found)) for b in range(a + 1, len(found))]
    for i, (a, b) in enumerate(order):
        odds = abs(np.log(max(found[a].probability, 1e-12) / max(found[b].probability, 1e-12)))
        told = bool(nats[i] >= visible)
        out.append(
            Apart(
                names[a],
                names[b],
                float(nats[i]),
                float(nats[i] / minutes),
                {kind: float(values[i]) for kind, values in fixed.items()},
                float(odds / recorded),
                told,
                () if told else sensors_for(found[a], found[b], posterior.noise),
            )
        )
    return tuple(out)


def _safety(search: Search, chosen: Sequence[tuple[Candidate, Tried]]) -> Safety:
    """Draws of every posterior play the whole plan."""
    left = draws = 0
    limits, settings = search.limits, search.settings
    for model in search.checkers:
        state, out, time = (
            np.tile(limits.rest, (len(model.thetas), 1)),
            np.zeros(len(model.thetas), dtype=bool),
            0.0,
        )
        for _, tried in chosen:
            true = model.said(state, tried.commands, limits.idle, time)[1][:, 0]
            out |= ~limits.inside(true, settings.margin).all(axis=1)
            if not search.anew:
                out |= ~limits.back(true[:, -1], settings.returns)
                state = true[:, -1]
            time += model.machine.dt * tried.commands.shape[1]
        left, draws = left + int(out.sum()), draws + len(out)
    return Safety(draws, left, _at_most(left, draws), settings.margin)


def _at_most(left: int, draws: int) -> float:
    """The one-sided upper end of the 90 % interval of a share (Clopper and Pearson 1934)."""
    return 1.0 if left >= draws else float(betaincinv(left + 1, draws - left, LIKELY))
