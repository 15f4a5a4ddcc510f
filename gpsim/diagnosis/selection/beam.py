"""The search: singles first, then pairs and triples as long as the data pay for them.

A beam of the best hypotheses grows by one term at a time. Every term of the catalogue is screened, the most promising
are fitted. At the end terms that no longer pay are taken out again.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gpsim.channels import FloatArray
from gpsim.diagnosis.fitting import (
    Candidate,
    Directions,
    Fit,
    Hypothesis,
    Order,
    Problem,
    child_of,
    fit,
    fit_all,
    rescored,
    scores,
    screened,
    settled,
    stretched,
    whiteness,
)
from gpsim.diagnosis.selection.elimination import doubtful, whole_robot
from gpsim.diagnosis.selection.required import with_required
from gpsim.diagnosis.settings import SearchSettings, schedules
from gpsim.effects import Scheme, closed

BEAM_OF_A_ROBOT = 2  # hypotheses that each depth of the search grows on (by hand: as many more are as dear)
LEAST_LINEAR_GAIN = 1.0  # linear gain that a term must promise, for it to be fitted [nats]
LEAST_PROMISE = 0.01
"""Share of the most promising term's linear gain that another must promise, to be fitted."""
SAME_SCHEME = 1.0  # difference within which rk4 steps are as good as fine ones, and are left out [nats]
FINE_PREFERENCE = 5.0  # benefit of the doubt for the fine scheme over the base simulator's own step [nats]
FINE_TWINS = 3  # hypotheses, the best in coarse steps, that are tried finely, too
FRICTION_SCANS = 3
"""Scans of the force of dry friction that chatters in coarse steps, each from where the last ended."""
EXACT_SHARE_OF_NOISE = 2.0
"""Times the noise floor: what leaves less in coarse steps is not searched for finely once more."""
OUTDONE = 20.0
"""By which the usual machine must lead for the beam to grow no deeper [nats] (odds of 5e8 to 1)."""

Note = Callable[[int, int, str], None]


@dataclass(frozen=True)
class Found:
    """All fitted hypotheses (of the search's windows), the best first; the null among them; the problem as settled."""

    fits: list[Fit]
    null: Fit
    scheme: Scheme
    problem: Problem


def beam_search(
    problem: Problem, offers: Sequence[Candidate], base: Scheme, note: Note, begun: Sequence[Fit] = ()
) -> Found:
    """Fit hypotheses by growing depth, beside those that were `begun` otherwise.

    Where a hypothesis on the base simulator's own coarse step comes out best, finely integrated ones get a search of
    their own: a coarse step looks like a lag or a little damping, and may lead astray whoever begins with it.
    """
    found = _grown_beam(problem, offers, ("fine", base), note, begun)
    best, seen = found.fits[0], problem.observed
    coarse = best.hypothesis.terms and best.hypothesis.scheme not in ("fine", "rk4")
    exact = (best.variance[seen] < (EXACT_SHARE_OF_NOISE * found.problem.floor[seen]) ** 2).all()
    if not coarse or exact:
        return found
    finely = _grown_beam(problem, offers, ("fine",), note, begun)
    floor = np.maximum(found.problem.floor, finely.problem.floor)
    both = replace(problem, floor=floor)
    fits = [rescored(both, f) for f in (*found.fits, *finely.fits)]
    return Found(ranked(both, fits), rescored(both, found.null), found.scheme, both)


def _grown_beam(
    problem: Problem, offers: Sequence[Candidate], schemes: Sequence[Scheme], note: Note, begun: Sequence[Fit]
) -> Found:
    settings = problem.run.settings.search
    nulls = [
        fit(problem, Hypothesis(scheme=s), problem.windows.measured[:, 0], iterations=schedules.SETTLE)
        for s in dict.fromkeys(schemes)
    ]
    alike = len(nulls) > 1 and abs(nulls[0].objective - nulls[1].objective) < SAME_SCHEME
    if "rk4" in schemes and alike:
        nulls = nulls[:1]  # but a coarse step makes friction chatter, whatever it does without friction
    nulls.sort(key=lambda f: f.objective - (FINE_PREFERENCE if f.hypothesis.scheme == "fine" else 0.0))
    null = nulls[0]
    seeds = [with_required(problem, f, offers) for f in nulls] if problem.run.known.require else []
    fits, beam = [*nulls, *seeds, *begun], seeds or list(nulls)
    counts = _fitted_per_depth(settings)
    dear = problem.run.settings.closed_step if closed(problem.simulator) is not None else None
    width = settings.beam if dear is None else BEAM_OF_A_ROBOT
    total = 2 * sum(counts[:1]) + width * sum(counts[1:])
    done, most = 0, problem.run.budget.spent + settings.budget
    if dear is not None and _outdone(problem, nulls, begun):
        counts = []  # what every joint lacks is known: going on from there finds what else is missing
        problem = settled(problem, ranked(problem, fits)[0])
    for depth, count in enumerate(counts):
        children: list[Fit] = []
        for parent in beam:
            if children and problem.run.budget.spent > most:
                break
            directions = Directions(problem, parent)
            plain = most_promising(problem, directions, offers, count)
            if depth == 0 and parent is beam[0]:
                problem = settled(problem, ranked(problem, [*fits, *plain])[0])
                fits, plain = ([rescored(problem, f) for f in group] for group in (fits, plain))
            children += plain
            done += count
            best = min((*children, *fits), key=lambda f: f.objective)
            note(min(done, total), total, f"best so far: {best.hypothesis.label}")
        children = _distinct(children)
        children = _distinct([*children, *_fine_twins(problem, children)])
        if depth == 0 and len(nulls) > 1:
            coarse = next(f for f in nulls if f.hypothesis.scheme != "fine").hypothesis
            children = _distinct([*children, *_chattering_twins(problem, children, coarse, offers)])
        fits += children
        over = problem.run.budget.spent > most or _outdone(problem, children, begun)
        if not children or not _structured(problem, fits) or over:
            break
        beam = _beam(problem, children, width)
    note(total, total, "")
    fits = [rescored(problem, f) for f in fits]
    ranking = ranked(problem, [*fits, *_reduced(problem, ranked(problem, fits)[0])])
    return Found(ranking, rescored(problem, null), null.hypothesis.scheme, problem)


def _outdone(problem: Problem, children: Sequence[Fit], begun: Sequence[Fit]) -> bool:
    """Whether what was begun otherwise is far better than all that grows here: that is where to go on."""
    if not children or not begun:
        return False
    nats = scores(problem, [*children, *(rescored(problem, f) for f in begun)])
    ahead = nats[len(children) :].max() - nats[: len(children)].max()
    return bool(ahead > OUTDONE)


def _fitted_per_depth(settings: SearchSettings) -> list[int]:
    """How many of the screened terms are fitted at each depth; deeper than the settings say, as many as at the last."""
    said = settings.fitted_per_depth
    return [said[min(depth, len(said) - 1)] for depth in range(settings.depth)]


def _fine_twins(problem: Problem, fits: Sequence[Fit]) -> list[Fit]:
    """The best of those in coarse steps once more, finely: the right law may have been met on a coarse grid only."""
    coarse = [f for f in fits if f.hypothesis.scheme != "fine"]
    new = ranked(problem, coarse)[:FINE_TWINS] if coarse else []
    finely = [(replace(f.hypothesis, scheme="fine"), f.starts) for f in new]
    return fit_all(problem, [Order(*one, schedules.REFIT, schedules.ROUGH) for one in finely])


def _chattering_twins(
    problem: Problem, fits: Sequence[Fit], coarse: Hypothesis, offers: Sequence[Candidate]
) -> list[Fit]:
    """Dry friction alone, found finely, once more in the base simulator's coarse steps, in which it chatters.

    From where the motion is known, over which the force is scanned, and again as the motion becomes better known: a
    fit from nothing gets stuck.
    """
    laws = [c for c in offers if c.dry and len(c.declared) == 1 and not c.only_gated]
    plain = [f for f in fits if f.hypothesis.scheme == "fine" and not _gated_terms(f)]
    known = [(c, f.starts) for c in laws for f in plain if c.identity in f.hypothesis.claims]
    found: list[Fit] = []
    for _ in range(FRICTION_SCANS):
        scans = problem.run.side_by_side(_scanned, [(problem, coarse, c, starts) for c, starts in known])
        begun = [(child, starts) for child, (_, starts) in zip(scans, known, strict=True)]
        again = fit_all(problem, [Order(*one, schedules.REFIT, schedules.ROUGH) for one in begun])
        found += again
        known = [(c, f.starts) for (c, _), f in zip(known, again, strict=True)]
    return found


def _scanned(problem: Problem, coarse: Hypothesis, law: Candidate, starts: FloatArray) -> Hypothesis:
    """The law in coarse steps with the force that suits these start states best."""
    directions = Directions(problem, fit(problem, coarse.frozen(), starts, iterations=0))
    begun = screened(directions, [law])[0][2]
    return child_of(coarse, law, stretched(directions, law, begun))


def most_promising(
    problem: Problem, directions: Directions, offers: Sequence[Candidate], count: int
) -> list[Fit]:
    """The parent with each of the `count` most promising terms.

    All are fitted a little, the better half to the end (successive halving).
    """
    parent = directions.parent
    taken = parent.hypothesis.claims
    found = screened(directions, [c for c in offers if c.identity not in taken and not c.only_gated])
    least = max(LEAST_LINEAR_GAIN, LEAST_PROMISE * found[0][0]) if found else LEAST_LINEAR_GAIN
    chosen = [one for one in found[:count] if one[0] > least]
    for i, (worth, c, _) in enumerate(found):
        rule = "worth fitting" if i < len(chosen) else "promises too little"
        names = (*parent.hypothesis.names, c.name)
        problem.run.trace.note(names, parent.hypothesis.names, i < len(chosen), rule, gain=worth)
    children = [child_of(parent.hypothesis, c, start) for _, c, start in chosen]
    begun = fit_all(
        problem, [Order(child, parent.starts, schedules.GLANCE, schedules.ROUGH) for child in children]
    )
    begun.sort(key=lambda f: f.objective)
    better = [f for f in begun[: -(-len(begun) // 2)] if not f.converged]
    ended = fit_all(
        problem, [Order(f.hypothesis, f.starts, schedules.SETTLE, schedules.ROUGH) for f in better]
    )
    return [*ended, *(f for f in begun if not any(f is b for b in better))]


def _structured(problem: Problem, fits: Sequence[Fit]) -> bool:
    """Whether the leader leaves something to explain."""
    return whiteness(problem, ranked(problem, fits)[0])[0] < problem.run.settings.acceptance.structured


def _distinct(fits: Sequence[Fit]) -> list[Fit]:
    """One fit a set of claims and gates, the best."""
    best: dict[object, Fit] = {}
    for found in fits:
        key = (found.hypothesis.claims, found.hypothesis.scheme, bool(_gated_terms(found)))
        if key not in best or found.objective < best[key].objective:
            best[key] = found
    return list(best.values())


def _beam(problem: Problem, children: Sequence[Fit], most: int) -> list[Fit]:
    """The best to grow on: each says something else, and one gate at most is among them, since gates are dear."""
    out = list[Fit]()
    for found in ranked(problem, children):
        gates = _gated_terms(found)
        new = all(found.hypothesis.claims != f.hypothesis.claims for f in out)
        fits_in = new and (not gates or (gates == 1 and not any(map(_gated_terms, out)))) and len(out) < most
        rule = "in the beam" if fits_in else "not in the beam"
        problem.run.trace.note(found.hypothesis.names, (), fits_in, rule)
        if fits_in:
            out.append(found)
    return out


def _gated_terms(found: Fit) -> int:
    return sum(bool(term.gate) for term in found.hypothesis.terms)


def ranked(problem: Problem, fits: Sequence[Fit]) -> list[Fit]:
    """The fits, the best by evidence first."""
    nats = scores(problem, list(fits))
    return [fits[i] for i in sorted(range(len(fits)), key=lambda i: -nats[i])]


def _reduced(problem: Problem, best: Fit) -> list[Fit]:
    """Backward elimination: the best hypothesis with each of its terms left out; of a whole robot that was done."""
    if len(best.hypothesis.terms) < 2 or whole_robot(problem, best.hypothesis):
        return []
    parts = [best.hypothesis.without(i) for i in doubtful(problem, best)]
    return fit_all(problem, [Order(part, best.starts, schedules.REFIT, schedules.ROUGH) for part in parts])
