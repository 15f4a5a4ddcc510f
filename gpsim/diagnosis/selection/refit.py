"""The best of the search once more, on all training windows, and which of them leads there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gpsim.channels import FloatArray
from gpsim.diagnosis.fitting import (
    Fit,
    Hypothesis,
    Order,
    Problem,
    channel_objectives,
    correlation_time,
    fit,
    fit_all,
    fit_near,
    gain,
    scores,
)
from gpsim.diagnosis.run import kept
from gpsim.diagnosis.selection.acceptance import pays
from gpsim.diagnosis.selection.beam import Found
from gpsim.diagnosis.selection.elimination import SMALL_ACCOUNT, simplest, whole_robot
from gpsim.diagnosis.selection.held_out import contradicted, held_out_fit
from gpsim.diagnosis.settings import schedules
from gpsim.diagnosis.setup import Question
from gpsim.effects import Scheme, closed

MOST_REFITTED = 8  # hypotheses that are fitted again, the best of the search
MOST_REFITTED_OF_A_ROBOT = 3  # the same where every step is dear [hypotheses]
REFITTED_WITHIN = 12.0  # behind the best of the search, that a hypothesis may be [nats]
CONTRADICTING_LOSS = 0.05
"""Of what a term gains on training windows: what it loses on held-out ones beyond that speaks against it (a delay
that gained 219 nats on a sweep must not go for 2.5 nats on nine held-out windows)."""


@dataclass(frozen=True)
class Contenders:
    """Fits on all training windows: the leading one, that of the base simulator, and all that were tried."""

    leader: Fit
    null: Fit
    tried: list[Fit]


def refit(question: Question, found: Found) -> Contenders:
    """The hypotheses near the best of the search, fitted on all training windows."""
    problem = question.everything
    near = _near(question.searched, found)
    null = null_of(problem, found.scheme)
    fits = _again(problem, _working([f.hypothesis for f in near]))
    fits += _without_idlers(problem, fits)
    return Contenders(_leader(question, [null, *fits], null), null, fits)


def _without_idlers(problem: Problem, fits: Sequence[Fit]) -> list[Fit]:
    """What is left of fits of which a term came to do nothing on all windows: no account that holds one can lead."""
    idle = [f for f in fits if f.hypothesis.idle and f.hypothesis.working.terms]
    robots = any(whole_robot(problem, f.hypothesis) for f in idle)  # the one that leads is finished later
    most, least = (schedules.TRIAL, schedules.ROUGH) if robots else (schedules.FINISH, schedules.FINAL)
    orders = [Order(f.hypothesis.working, f.starts, most, least, near=True) for f in idle]
    found = fit_all(problem, orders)
    known = [f.hypothesis for f in fits]
    return [f for f in found if not any(f.hypothesis.says_the_same_as(h) for h in known)]


@kept
def null_of(problem: Problem, scheme: Scheme) -> Fit:
    """The base simulator alone, integrated by a scheme."""
    steps = schedules.REFIT
    return fit(problem, Hypothesis(scheme=scheme), problem.windows.measured[:, 0], iterations=steps)


def _near(problem: Problem, found: Found) -> list[Fit]:
    nats = scores(problem, found.fits)
    order = [i for i in np.argsort(-nats) if nats.max() - nats[i] < REFITTED_WITHIN]
    dear = closed(problem.simulator) is not None
    return [found.fits[i] for i in order[: MOST_REFITTED_OF_A_ROBOT if dear else MOST_REFITTED]]


def _working(hypotheses: Sequence[Hypothesis]) -> list[Hypothesis]:
    """Without terms that do nothing: what they stood in for was found later, and nothing that holds one can lead."""
    out: list[Hypothesis] = []
    for hypothesis in (h.working for h in hypotheses):
        if hypothesis.terms and not any(hypothesis.says_the_same_as(other) for other in out):
            out.append(hypothesis)
    return out


def _again(problem: Problem, hypotheses: Sequence[Hypothesis]) -> list[Fit]:
    """All fitted a little, those that are not far behind the best to the end."""
    measured = problem.windows.measured[:, 0]
    begun = _begun(problem, hypotheses, measured)
    small = SMALL_ACCOUNT
    starts = [measured if len(h.terms) <= small else begun for h in hypotheses]
    orders = [Order(*one, schedules.TRIAL, schedules.ROUGH) for one in zip(hypotheses, starts, strict=True)]
    if any(whole_robot(problem, h) for h in hypotheses):  # the one that leads is followed to its end later
        return fit_all(problem, orders)
    return fit_near(problem, orders, schedules.FINISH, schedules.FINAL)


def _begun(problem: Problem, hypotheses: Sequence[Hypothesis], measured: FloatArray) -> FloatArray:
    """(W, S) where windows start by the first large account, whose values are known from other windows.

    Speeds that nobody measured are off at first, and many parameters would make good for them.
    """
    small = SMALL_ACCOUNT
    large = next((h for h in hypotheses if len(h.terms) > small), None)
    if large is None:
        return measured
    return held_out_fit(problem, large).starts


def _leader(question: Question, fits: Sequence[Fit], null: Fit) -> Fit:
    """The best by all evidence, learnt from and held out, that is better than nothing; or a simpler one as good."""
    problem, trace = question.everything, question.everything.run.trace
    nats = _evidence(question, fits, null)
    order = [fits[int(i)] for i in np.argsort(-nats)]
    for place, chosen in enumerate(order):
        if chosen is null or not chosen.hypothesis.terms:
            return null
        if pays(problem, chosen, null):
            behind = [f for f in order[place + 1 :] if f.hypothesis.terms and pays(problem, f, null)]
            return simplest(problem, [chosen, *behind])
        trace.note(chosen.hypothesis.names, null.hypothesis.names, False, "no better than nothing")
    return null


def _evidence(question: Question, fits: Sequence[Fit], null: Fit) -> FloatArray:
    """(F,) nats of each fit on the windows it was fitted to and on held-out ones, whose start states alone are fitted.

    What held-out windows speak against is as good as nothing, unless a user requires it.
    """
    problem, held_out = question.everything, question.held_out
    nats = scores(problem, list(fits))
    if not len(held_out.windows):
        return nats
    best = fits[int(np.argmax(nats))]
    tau = np.maximum(correlation_time(problem, best.residuals), 1.0)
    calls = [(held_out, f.hypothesis) for f in fits]
    later = problem.run.side_by_side(held_out_fit, calls)
    left = np.array([(channel_objectives(held_out, f) / tau).sum() for f in later])
    base = next(i for i, f in enumerate(fits) if f is null)
    worse = np.array(
        [
            f is not null
            and contradicted(
                held_out, there, later[base], gain(problem, f, null), _pardoned(problem, f, null)
            )
            for f, there in zip(fits, later, strict=True)
        ]
    )
    if problem.run.known.require:  # held-out windows have no say in it
        return np.asarray(nats - left)
    for found in (f for f, is_worse in zip(fits, worse, strict=True) if is_worse):
        names = (found.hypothesis.names, null.hypothesis.names)
        problem.run.trace.note(*names, False, "no better on held-out windows")
    return np.asarray(np.where(worse, np.minimum(nats, nats[base] - 1.0), nats) - left)


def _pardoned(problem: Problem, found: Fit, null: Fit) -> float:
    """Nats that it may lose on held-out windows: of a whole robot a part of what it gains, as of a term in pruning.

    The end of a log may be another motion, in which next to nothing rubs.
    """
    if not whole_robot(problem, found.hypothesis):
        return 0.0
    return CONTRADICTING_LOSS * max(null.objective - found.objective, 0.0)
