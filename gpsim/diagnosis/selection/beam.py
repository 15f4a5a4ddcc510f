"""The search: singles first, then pairs and triples as long as the data pay for them.

A beam of the best hypotheses grows by one term at a time. Every term of the catalogue is screened, the most promising
are fitted; the best of them are tried with a gate. At the end terms that no longer pay are taken out again.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gpsim.channels import FloatArray
from gpsim.diagnosis.fitting import (
    PER_TERM,
    Candidate,
    Directions,
    Fit,
    Hypothesis,
    Order,
    Problem,
    child_of,
    fit,
    fit_all,
    gain,
    mean_squares,
    price,
    rescored,
    scores,
    screened,
    settled,
    stretched,
    whiteness,
    window_costs,
)
from gpsim.diagnosis.run import kept
from gpsim.diagnosis.selection.gates import gated_children, with_edges
from gpsim.effects import Scheme

Note = Callable[[int, int, str], None]
BEAM, DEPTH = 3, 3
SCANS = 3  # of the force of dry friction that chatters
TWINS = 3  # of the best hypotheses in coarse steps that are tried finely, too
FITTED = (18, 9, 7)  # how many of the screened terms are fitted at each depth
LEAST_WORTH = 0.01  # of the most promising term's linear gain that another must promise to be fitted
LEAST_SHARE = 0.02  # of the variance left over in some channel that it must remove,
BEYOND_DOUBT, SLIGHT_SHARE = 10.0, 0.002  # or so little where it gains so many nats, and leaves white noise
BETTER_LAW = 5.0  # nats beyond doubt for a richer law in a simpler one's place, which is not one of dozens
MOST_OF_IT = 0.5  # of the variance left over, which a richer law in a simpler one's place may remove instead,
NO_LAST_DIGITS = 200.0  # where it gains so many nats
LEAST_PART = 1e-4  # of what the base simulator leaves over there: a hundredth of the amplitude
SELDOM_PART, BEYOND_ALL_DOUBT = 1e-5, 50.0  # a richer law's: so little, where it gains so many nats
ORDINARY = 1.5  # times the median of all windows' costs: nothing out of the ordinary is left of a window
SAME, BENEFIT = 1.0, 5.0  # nats: two schemes that do not differ; the benefit of the doubt for the fine one
MOST_EFFORT = 2.5e8  # simulated rows after which it grows no deeper; improving goes on from there
EXACT = 2.0  # times the floor: no noise is left
STRUCTURED = 1e-2  # p-value below which a residual is not white


@dataclass(frozen=True)
class Found:
    """All fitted hypotheses (of the search's windows), the best first; the null among them; the problem as settled."""

    fits: list[Fit]
    null: Fit
    scheme: Scheme
    problem: Problem


def search(problem: Problem, offers: Sequence[Candidate], base: Scheme, note: Note) -> Found:
    """Fit hypotheses by growing depth.

    Where a hypothesis on the base simulator's own coarse step comes out best, finely integrated ones get a search of
    their own: a coarse step looks like a lag or a little damping, and may lead astray whoever begins with it.
    """
    found = _grow(problem, offers, ("fine", base), note)
    best, seen = found.fits[0], problem.observed
    coarse = best.hypothesis.terms and best.hypothesis.scheme not in ("fine", "rk4")
    exact = (best.variance[seen] < (EXACT * found.problem.floor[seen]) ** 2).all()
    if not coarse or exact:
        return found
    finely = _grow(problem, offers, ("fine",), note)
    floor = np.maximum(found.problem.floor, finely.problem.floor)
    both = replace(problem, floor=floor)
    fits = [rescored(both, f) for f in (*found.fits, *finely.fits)]
    return Found(_ranked(both, fits), rescored(both, found.null), found.scheme, both)


def _grow(problem: Problem, offers: Sequence[Candidate], schemes: Sequence[Scheme], note: Note) -> Found:
    nulls = [
        fit(problem, Hypothesis(scheme=s), problem.windows.measured[:, 0], iterations=8)
        for s in dict.fromkeys(schemes)
    ]
    if "rk4" in schemes and len(nulls) > 1 and abs(nulls[0].objective - nulls[1].objective) < SAME:
        nulls = nulls[:1]  # but a coarse step makes friction chatter, whatever it does without friction
    nulls.sort(key=lambda f: f.objective - (BENEFIT if f.hypothesis.scheme == "fine" else 0.0))
    null = nulls[0]
    fits, beam = list(nulls), list(nulls)
    total = 2 * FITTED[0] + BEAM * (FITTED[1] + FITTED[2])
    done, most = 0, problem.run.budget.spent + MOST_EFFORT
    for depth in range(DEPTH):
        children: list[Fit] = []
        for parent in beam:
            if children and problem.run.budget.spent > most:
                break
            directions = Directions(problem, parent)
            plain = grown(problem, directions, offers, FITTED[depth])
            if depth == 0 and parent is null:
                problem = settled(problem, _ranked(problem, [*fits, *plain])[0])
                fits, plain = ([rescored(problem, f) for f in group] for group in (fits, plain))
            children += plain
            if parent is beam[0] and depth < 2 and _structured(problem, [*fits, *plain]):
                gated = gated_children(problem, directions, plain, offers)
                children += with_edges(problem, gated)
            done += FITTED[depth]
            best = min((*children, *fits), key=lambda f: f.objective)
            note(min(done, total), total, f"best so far: {best.hypothesis.label}")
        children = _distinct(children)
        children = _distinct([*children, *_fine_twins(problem, children)])
        if depth == 0 and len(nulls) > 1:
            coarse = next(f for f in nulls if f.hypothesis.scheme != "fine").hypothesis
            children = _distinct([*children, *_chattering_twins(problem, children, coarse, offers)])
        fits += children
        if not children or not _structured(problem, fits) or problem.run.budget.spent > most:
            break
        beam = _beam(problem, children)
    note(total, total, "")
    ranking = _ranked(problem, [*fits, *_reduced(problem, _ranked(problem, fits)[0])])
    return Found(ranking, rescored(problem, null), null.hypothesis.scheme, problem)


def _fine_twins(problem: Problem, fits: Sequence[Fit]) -> list[Fit]:
    """The best of those in coarse steps once more, finely: the right law may have been met on a coarse grid only."""
    coarse = [f for f in fits if f.hypothesis.scheme != "fine"]
    new = _ranked(problem, coarse)[:TWINS] if coarse else []
    return fit_all(problem, [Order(replace(f.hypothesis, scheme="fine"), f.starts, 12) for f in new])


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
    for _ in range(SCANS):
        scans = problem.run.side_by_side(_scanned, [(problem, coarse, c, starts) for c, starts in known])
        orders = [Order(child, starts, 12) for child, (_, starts) in zip(scans, known, strict=True)]
        again = fit_all(problem, orders)
        found += again
        known = [(c, f.starts) for (c, _), f in zip(known, again, strict=True)]
    return found


def _scanned(problem: Problem, coarse: Hypothesis, law: Candidate, starts: FloatArray) -> Hypothesis:
    """The law in coarse steps with the force that suits these start states best."""
    directions = Directions(problem, fit(problem, coarse.frozen(), starts, iterations=0))
    begun = screened(directions, [law])[0][2]
    return child_of(coarse, law, stretched(directions, law, begun))


def pays(problem: Problem, richer: Fit, poorer: Fit) -> bool:
    """Whether the additional terms earn their parameters and remove a share worth speaking of.

    Of what was left, and of the whole mismatch: with clean sensors the numbers of a law that is nearly right would
    otherwise be mended by another one. A term that does nothing never pays: it may change the grid, and with it the
    numerical error.
    """
    plainly, slightly = _worth(problem, richer, poorer)
    return plainly or (slightly and whiteness(problem, richer)[0] > STRUCTURED)


def may_pay(problem: Problem, richer: Fit, poorer: Fit) -> bool:
    """Whether they would pay if nothing else were left over, which another term may yet bring about."""
    return any(_worth(problem, richer, poorer))


def _worth(problem: Problem, richer: Fit, poorer: Fit) -> tuple[bool, bool]:
    """Whether the additional terms remove a good share, or at least a slight one beyond doubt."""
    poorer = on_its_grid(problem, poorer, richer)
    won = gain(problem, richer, poorer)
    if richer.hypothesis.idle or won < PER_TERM or _in_one_window(problem, richer, poorer):
        return False, False
    left, before = (mean_squares(problem, f.residuals) for f in (richer, poorer))
    removed = before - left  # the variance itself stops at known noise
    worth = (removed > LEAST_PART * problem.mismatch) & problem.observed
    plainly, slightly = (
        bool((worth & (removed > s * poorer.variance)).any()) for s in (LEAST_SHARE, SLIGHT_SHARE)
    )
    better = _better_law(richer, poorer)
    slightly = slightly and won > (BETTER_LAW if better else BEYOND_DOUBT)
    return plainly, slightly or (better and _seldom_asked(problem, removed, poorer, won))


def _seldom_asked(problem: Problem, removed: FloatArray, poorer: Fit, won: float) -> bool:
    """Whether part of a law acts seldom: little of the mismatch, but a good share of what is left, or most of it."""
    good, most = (
        bool((removed > share * poorer.variance)[problem.observed & (removed > least)].any())
        for share, least in ((LEAST_SHARE, SELDOM_PART * problem.mismatch), (MOST_OF_IT, 0.0))
    )
    return (good and won > BEYOND_ALL_DOUBT) or (most and won > NO_LAST_DIGITS)


def _better_law(richer: Fit, poorer: Fit) -> bool:
    """Whether they differ in one law of the same place, of which the one has more parameters, and in no gate."""
    new = [on for _, on in richer.hypothesis.claims - poorer.hypothesis.claims]
    old = [on for _, on in poorer.hypothesis.claims - richer.hypothesis.claims]
    alike = len(richer.hypothesis.terms) == len(poorer.hypothesis.terms)
    more = len(richer.hypothesis.parameters) > len(poorer.hypothesis.parameters)
    return alike and more and len(new) == 1 and new == old and _gated_terms(richer) == _gated_terms(poorer)


def on_its_grid(problem: Problem, poorer: Fit, richer: Fit) -> Fit:
    """The poorer fit on as fine a grid as the richer one has."""
    same = problem.as_finely(poorer.hypothesis, richer.hypothesis) is problem
    return poorer if same else _finer(problem, poorer)


@kept
def _finer(problem: Problem, at: Fit) -> Fit:
    """The fit on a grid twice as fine."""
    grid = replace(problem, substeps=2 * problem.substeps)
    return fit(grid, at.hypothesis, at.starts, iterations=5, near=True)


def _in_one_window(problem: Problem, richer: Fit, poorer: Fit) -> bool:
    """Whether the richer one is better in a single window only, and does not explain that one to the noise.

    A moment that went wrong is no law; a law that shows once leaves nothing of what happened.
    """
    costs = [window_costs(problem, f.residuals[None], poorer.variance)[0] for f in (poorer, richer)]
    worst = int(np.argmax(costs[0] - costs[1]))
    if costs[1][worst] < ORDINARY * float(np.median(costs[1])):
        return False
    others = np.arange(len(problem.windows)) != worst
    rest = problem.on(problem.windows.take(others))
    left = [
        rescored(rest, replace(f, residuals=f.residuals[others], starts=f.starts[others]))
        for f in (richer, poorer)
    ]
    return gain(rest, *left) + price(rest, *left) < PER_TERM


def grown(problem: Problem, directions: Directions, offers: Sequence[Candidate], count: int) -> list[Fit]:
    """The parent with each of the `count` most promising terms.

    All are fitted a little, the better half to the end (successive halving).
    """
    parent = directions.parent
    taken = parent.hypothesis.claims
    found = screened(directions, [c for c in offers if c.identity not in taken and not c.only_gated])
    least = max(1.0, LEAST_WORTH * found[0][0]) if found else 1.0
    children = [child_of(parent.hypothesis, c, start) for worth, c, start in found[:count] if worth > least]
    begun = fit_all(problem, [Order(child, parent.starts, 5) for child in children])
    begun.sort(key=lambda f: f.objective)
    better = [f for f in begun[: -(-len(begun) // 2)] if not f.converged]
    ended = fit_all(problem, [Order(f.hypothesis, f.starts, 8) for f in better])
    return [*ended, *(f for f in begun if not any(f is b for b in better))]


def _structured(problem: Problem, fits: Sequence[Fit]) -> bool:
    """Whether the leader leaves something to explain."""
    return whiteness(problem, _ranked(problem, fits)[0])[0] < STRUCTURED


def _distinct(fits: Sequence[Fit]) -> list[Fit]:
    """One fit a set of claims and gates, the best."""
    best: dict[object, Fit] = {}
    for found in fits:
        key = (found.hypothesis.claims, found.hypothesis.scheme, bool(_gated_terms(found)))
        if key not in best or found.objective < best[key].objective:
            best[key] = found
    return list(best.values())


def _beam(problem: Problem, children: Sequence[Fit]) -> list[Fit]:
    """The best to grow on: each says something else, and one gate at most is among them, since gates are dear."""
    out: list[Fit] = []
    for found in _ranked(problem, children):
        gates = _gated_terms(found)
        new = all(found.hypothesis.claims != f.hypothesis.claims for f in out)
        if new and (not gates or (gates == 1 and not any(map(_gated_terms, out)))):
            out.append(found)
    return out[:BEAM]


def _gated_terms(found: Fit) -> int:
    return sum(bool(term.gate) for term in found.hypothesis.terms)


def _ranked(problem: Problem, fits: Sequence[Fit]) -> list[Fit]:
    nats = scores(problem, list(fits))
    return [fits[i] for i in sorted(range(len(fits)), key=lambda i: -nats[i])]


def _reduced(problem: Problem, best: Fit) -> list[Fit]:
    """Backward elimination: the best hypothesis with each of its terms left out."""
    if len(best.hypothesis.terms) < 2:
        return []
    parts = [best.hypothesis.without(i) for i in range(len(best.hypothesis.terms))]
    return fit_all(problem, [Order(part, best.starts, 12) for part in parts])
