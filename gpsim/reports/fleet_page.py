"""A fleet as one self-contained page: which robots differ, all of them in a table, and every account below."""

from __future__ import annotations

from collections.abc import Sequence

from gpsim.reports.account import account_of
from gpsim.reports.account_effects import effect_name, told_effects
from gpsim.reports.account_lines import account_lines
from gpsim.reports.diagnosis_text import gate_text
from gpsim.reports.fleet import Deviation, Robot, deviations, headline, size_of
from gpsim.reports.html import page_of
from gpsim.reports.prove_page import STYLE
from gpsim.reports.sheets import MISSING, Cell, Sheet, row, whole_percent

MORE = """
td, th, td:first-child, th:first-child { text-align: left; vertical-align: top; }
pre { overflow-x: auto; background: #f6f7f9; padding: .7rem; } summary { cursor: pointer; }
"""
PAGE = """<!doctype html>
<html lang="en"><head>{{ head }}<title>gpsim diagnose --each</title></head><body>
<h1>{{ robots|length }} recordings</h1>
<p>{{ said[:1]|upper }}{{ said[1:] }}.</p>
{% for sheet in sheets if sheet.rows %}<h2>{{ sheet.title }}</h2><div class="wide"><table class="words">
<tr>{% for name in sheet.columns %}<th>{{ name }}</th>{% endfor %}</tr>
{% for cells in sheet.rows %}<tr>{% for cell in cells %}<td{% if cell.marked %} class="marked"{% endif %}>
{{- cell.text|short }}</td>{% endfor %}</tr>
{% endfor %}</table></div>{% if sheet.note %}<p>{{ sheet.note }}</p>{% endif %}
{% endfor %}
<h2>Accounts</h2>
{% for name, lines in accounts %}<details><summary>{{ name }}</summary><pre>{{ lines|join("\\n") }}</pre></details>
{% endfor %}
</body></html>
"""
NOTE = (
    "An effect belongs to the fleet where more than half of the robots have it. A size is apart where it lies beyond "
    "twice its own 90 % interval, a tenth of the fleet's median, and three robust standard deviations of the fleet."
)


def fleet_page(robots: Sequence[Robot], simulators: Sequence[str]) -> str:
    """The page; simulators: the base of each recording. Equal diagnoses give equal pages."""
    found = deviations(robots)
    return page_of(
        PAGE,
        STYLE + MORE,
        robots=robots,
        said=headline(robots, found),
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
        Cell(robot.name, marked=odd), found.verdict, whole_percent(share), "; ".join(effects) or MISSING
    )


def _account(robot: Robot, simulator: str) -> list[str]:
    if robot.diagnosis is None:
        return [robot.error]
    return account_lines(account_of(robot.diagnosis, simulator=simulator or None))
