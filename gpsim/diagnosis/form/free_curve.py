"""A free curve in the place of a group's laws, and one of what is missing where no law is named."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from gpsim.diagnosis.fitting import Fit, Hypothesis, Problem
from gpsim.diagnosis.form.drawn import drawn, drawn_missing
from gpsim.diagnosis.form.groups import Group, further_input
from gpsim.diagnosis.form.penalised import Departure, departure, penalised
from gpsim.diagnosis.form.widened import missing, widened
from gpsim.diagnosis.report import Curve
from gpsim.diagnosis.selection import LackOfFit
from gpsim.recordings import evenly


@dataclass(frozen=True)
class FreeCurve:
    """A fitted curve.

    hypothesis: the explanation with the curve in the place of the group's laws, all else fitted along; it is simulated
    like any other. group: None of what is missing. further: the other input that the curve depends on. departure: how
    far it is from the laws.
    """

    hypothesis: Hypothesis
    curve: Curve
    group: Group | None = None
    further: str | None = None
    departure: Departure | None = None


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
    return FreeCurve(made, shown, group, curve.further, departure(curve, fitted))


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
