"""Sizes of a fleet's common effects, a panel an effect and a point a robot: who lies apart is seen at once."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gpsim.diagnosis.report import Estimate
from gpsim.reports.account_effects import claim_name
from gpsim.reports.canvas import panels, style
from gpsim.reports.fleet import Claim, Deviation, Robot
from gpsim.reports.lettering import named, shortened
from gpsim.reports.palette import INK

ODD = "#B42318"  # as the page marks names
MOST, NAMED = 6, 30  # panels; robots whose names fit below an axis
Point = tuple[int, Estimate]
"""Which robot, counted from 0, and the size of its effect."""


def fleet_picture(robots: Sequence[Robot], found: Sequence[Deviation]) -> Figure | None:
    """The first parameter of each effect that more than half of the robots have; None where there is none."""
    odd = {(d.robot, d.effect) for d in found}
    chosen = [(claim, points) for claim in _common(robots) if (points := _points(robots, claim))][:MOST]
    if not chosen:
        return None
    names = [robot.name for robot in robots]
    with style():
        size = (min(12.0, 2.5 + 0.28 * len(robots)), 1.9 * len(chosen) + 0.8)
        figure, axes = panels(len(chosen), 1, size, sharex=True)
        for axis, (claim, points) in zip(axes[:, 0], chosen, strict=True):
            _draw(axis, claim, points, [(name, claim_name(*claim)) in odd for name in names])
        last = axes[-1, 0]
        if len(names) <= NAMED:
            last.set_xticks(range(len(names)), [shortened(name) for name in names], rotation=60, ha="right")
        else:
            last.set_xlabel("robot, in the order of the table")
        last.set_xlim(-0.5, len(names) - 0.5)
    return figure


def _common(robots: Sequence[Robot]) -> list[Claim]:
    """The most frequent first."""
    judged = [robot for robot in robots if robot.judged]
    often = Counter(claim for robot in judged for claim in robot.effects)
    return [claim for claim, count in often.most_common() if 2 * count > len(judged) and count > 1]


def _points(robots: Sequence[Robot], claim: Claim) -> list[Point]:
    having = [(i, robot.effects[claim]) for i, robot in enumerate(robots) if claim in robot.effects]
    sizes = [(i, next(iter(effect.parameters.values()), None)) for i, effect in having]
    return [(i, size) for i, size in sizes if size is not None and math.isfinite(size.value)]


def _draw(axis: Axes, claim: Claim, points: Sequence[Point], odd: Sequence[bool]) -> None:
    for i, size in points:
        low, high = (size.value if end is None else end for end in (size.low, size.high))
        colour = ODD if odd[i] else INK
        axis.plot([i, i], [low, high], color=colour, linewidth=1.2)
        axis.plot(i, size.value, "o", color=colour, markersize=4.5)
    axis.set_title(shortened(claim_name(*claim), 60))
    axis.set_ylabel(named("size", points[0][1].unit))
    axis.margins(y=0.15)
