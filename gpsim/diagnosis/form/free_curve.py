"""A free curve in the place of a group's laws, and one of what is missing where no law is named."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gpsim.diagnosis.fitting import Fit, Hypothesis, Problem
from gpsim.diagnosis.form.drawn import drawn, drawn_missing
from gpsim.diagnosis.form.groups import Group, further_input
from gpsim.diagnosis.form.penalised import Curved, Departure, departure, penalised
from gpsim.diagnosis.form.visited import places
from gpsim.diagnosis.form.widened import Widened, missing, widened
from gpsim.diagnosis.report import Curve
from gpsim.diagnosis.selection import LackOfFit
from gpsim.effects import Shape
from gpsim.recordings import evenly

KNOTS_OF_MEASURED = 24
"""Knots of a measured curve of one input, which stands for a law (with 16 the last knots of -3 sin(4 v) were off by a
tenth of its range)."""


@dataclass(frozen=True)
class FreeCurve:
    """A fitted curve.

    hypothesis: the explanation with the curve in the place of the group's laws, all else fitted along; it is simulated
    like any other. group: None of what is missing. further: the other input that the curve depends on. departure: how
    far it is from the laws. widened, fitted: the curve as it was fitted;
    """

    hypothesis: Hypothesis
    curve: Curve
    group: Group | None = None
    further: str | None = None
    departure: Departure | None = None
    widened: Widened | None = None
    fitted: Curved | None = None


def free_curves(
    problem: Problem, leader: Fit, groups: Sequence[Group], lack: LackOfFit | None = None
) -> list[FreeCurve | None]:
    """The curve of every group, side by side; None of those that have none."""
    further = [further_input(problem.simulator, group, lack) for group in groups]
    calls = [(problem, leader, group, other) for group, other in zip(groups, further, strict=True)]
    return problem.run.side_by_side(free_curve, calls)


def free_curve(problem: Problem, leader: Fit, group: Group, further: str | None = None) -> FreeCurve | None:
    """One free curve in the place of all laws of a group, times a further input; None where nothing can be drawn.

    problem, leader: the explanation fitted to these windows.
    """
    if not group.testable:
        return None
    some, part = _on_some(problem, leader)
    curve = widened(some, leader.hypothesis, group, further)
    if curve is None:
        return None
    fitted = penalised(some, part, curve)
    shown = drawn(some, leader.hypothesis, group, curve, fitted)
    made = curve.hypothesis.having(fitted.theta).frozen()
    return FreeCurve(made, shown, group, curve.further, departure(curve, fitted), curve, fitted)


def free_curve_again(
    problem: Problem, found: Fit, group: Group, gone: Sequence[int], shape: Shape
) -> FreeCurve | None:
    """A curve in the place of terms that are gone, all of which has a price, not what differs from laws.

    So a curve is fitted once more: only around its own fit is it known what is noise. group: without laws; gone: the
    terms' indices; shape: from which it begins. It has more knots.
    """
    some, part = _on_some(problem, replace(found, hypothesis=found.hypothesis.without_all(gone)))
    curve = widened(some, part.hypothesis, group, knots=KNOTS_OF_MEASURED)
    if curve is None:
        return None
    theta = np.array(curve.hypothesis.theta)
    theta[curve.free] = shape.at(*places(curve.basis.axes))
    curve = replace(curve, hypothesis=curve.hypothesis.having(theta))
    fitted = penalised(some, part, curve)
    made = curve.hypothesis.having(fitted.theta).frozen()
    shown = drawn(some, part.hypothesis, group, curve, fitted)
    return FreeCurve(made, shown, group, None, departure(curve, fitted), curve, fitted)


def missing_curve(problem: Problem, leader: Fit, lack: LackOfFit) -> FreeCurve | None:
    """What is missing beside the leader as a curve of a rate, as lack of fit names it; None of what hardly moves."""
    some, part = _on_some(problem, leader)
    curve = missing(some, leader.hypothesis, lack)
    if curve is None:
        return None
    fitted = penalised(some, part, curve)
    shown = drawn_missing(some, lack, curve, fitted)
    return FreeCurve(curve.hypothesis.having(fitted.theta).frozen(), shown, None, curve.further)


def _on_some(problem: Problem, leader: Fit) -> tuple[Problem, Fit]:
    """The problem on evenly spread windows, enough for a curve, and the fit's share of it."""
    settings = problem.run.settings
    most = round(settings.form.windows * settings.windows.length / problem.windows.length)
    rows = evenly(len(problem.windows), most)
    part = replace(leader, starts=leader.starts[rows], residuals=leader.residuals[rows])
    return problem.on(problem.windows.take(rows)), part
