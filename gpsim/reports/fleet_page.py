"""Sizes of a fleet's common effects, a panel an effect and a point a robot: who lies apart is seen at once."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gpsim.diagnosis.report import Estimate
from gpsim.reports.account import account_of
from gpsim.reports.account_effects import claim_name, effect_name, told_effects
from gpsim.reports.account_lines import account_lines
from gpsim.reports.canvas import INK, data_uri, named, panels, style
from gpsim.reports.diagnosis_text import gate_text
from gpsim.reports.fleet import Claim, Deviation, Robot, deviations, headline, size_of
from gpsim.reports.html import page_of, resource
from gpsim.reports.quantities import shortened
from gpsim.reports.sheets import MISSING, Cell, Sheet, row, whole_percent

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


MORE = """
td, th, td:first-child, th:first-child { text-align: left; vertical-align: top; }
img { max-width: 100%; } pre { overflow-x: auto; background: #f6f7f9; padding: .7rem; } summary { cursor: pointer; }
"""
NOTE = (
    "An effect belongs to the fleet where more than half of the robots have it. A size is apart where it lies beyond "
    "twice its own 90 % interval, a tenth of the fleet's median, and three robust standard deviations of the fleet."
)


def fleet_page(robots: Sequence[Robot], simulators: Sequence[str]) -> str:
    """The page; simulators: the base of each recording. Equal diagnoses give equal pages."""
    found = deviations(robots)
    figure = fleet_picture(robots, found)
    return page_of(
        "fleet.html.jinja",
        resource("plain.css") + MORE,
        robots=robots,
        said=headline(robots, found),
        picture=None if figure is None else data_uri(figure),
        sheets=[differences_sheet(found), robots_sheet(robots, found)],
        accounts=[
            (robot.name, _account(robot, simulator))
            for robot, simulator in zip(robots, simulators, strict=True)
        ],
    )


def differences_sheet(found: Sequence[Deviation]) -> Sheet:
    """A row a difference."""
    rows = tuple(
        row(Cell(d.robot, marked=True), d.effect, d.here, d.others, d.since or MISSING) for d in found
    )
    return Sheet(
        "What differs", ("robot", "effect", "here", "the others", "since, where"), rows, labels=5, note=NOTE
    )


def robots_sheet(robots: Sequence[Robot], found: Sequence[Deviation]) -> Sheet:
    """A row a robot."""
    odd = {d.robot for d in found}
    rows = tuple(_robot(robot, robot.name in odd) for robot in robots)
    return Sheet("Every robot", ("robot", "verdict", "explained", "effects"), rows, labels=4)


def _robot(robot: Robot, odd: bool) -> tuple[Cell, ...]:
    found = robot.diagnosis
    if found is None:
        return row(Cell(robot.name, marked=True), Cell("failed", marked=True), MISSING, robot.error)
    share = found.explained.rollout.share if found.explained.rollout is not None else None
    effects = [
        " ".join(filter(None, (effect_name(e), size_of(e), gate_text(e, found.dt))))
        for e in told_effects(found)[0]
    ]
    return row(
        Cell(robot.name, marked=odd), found.verdict, whole_percent(share), "\n".join(effects) or MISSING
    )


def _account(robot: Robot, simulator: str) -> list[str]:
    if robot.diagnosis is None:
        return [robot.error]
    return account_lines(account_of(robot.diagnosis, simulator=simulator or None))
