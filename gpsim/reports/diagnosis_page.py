"""A diagnosis as a page and as a piece of a notebook's page: the account first, everything else folded below it."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from itertools import accumulate

from markupsafe import Markup

from gpsim.diagnosis import Diagnosis
from gpsim.diagnosis.run import Decision
from gpsim.reports import diagnosis_text as words
from gpsim.reports.account import Account, account_of, episodes_text, size_in
from gpsim.reports.account_effects import Row, effect_name
from gpsim.reports.canvas import FAINT, SEGMENTS
from gpsim.reports.diagnosis_figures import MOST, PARTS, ROLLOUT, Picture
from gpsim.reports.pages import fragment_of, page_of, resource
from gpsim.reports.robot_figure import ROBOT
from gpsim.reports.statistics_text import trace_lines

MOST_LINES, MOST_CHANGES = 9, 6
"""Of the account's tables of effects and of errors, on the first screen."""


def account_fragment(account: Account, pictures: Sequence[Picture] = ()) -> str:
    """HTML without scripts and without anything from elsewhere; every text is escaped."""
    return fragment_of(
        "account.html.jinja",
        style=Markup(resource("account.css")),
        account=account,
        pictures=pictures,
    )


def page(
    diagnosis: Diagnosis,
    pictures: Mapping[str, Picture],
    name: str,
    missing: Sequence[str] = (),
    decisions: Sequence[Decision] = (),
    simulator: str | None = None,
    model: Sequence[str] = (),
) -> str:
    """One self-contained HTML page: no network, no scripts, no dates.

    missing: lines about what it lacks; simulator: the base's name, if it is known; model: where in a model's file each
    effect goes.
    """
    first, account = front_of(diagnosis), account_of(diagnosis, simulator=simulator)
    return page_of(
        "diagnosis.html.jinja",
        resource("diagnosis.css") + _bars(),
        name=name,
        account=account,
        most_rows=_first_rows(account.rows),
        most_changes=MOST_CHANGES,
        colours=MOST,
        front=[pictures[key] for key in first if key in pictures],
        pictures=[picture for key, picture in pictures.items() if key not in first],
        missing=list(missing),
        episodes_text=episodes_text,
        size_in=size_in,
        units={name: e.unit for r in diagnosis.recordings or () for name, e in r.rollout.items()},
        diagnosis=diagnosis,
        words=words,
        effect_name=effect_name,
        model=model,
        not_asked=words.not_asked_lines(diagnosis.not_asked),
        ranking="\n".join(words.ranking(diagnosis)),
        trace="\n".join(trace_lines(decisions)),
        text=json.dumps({k: v for k, v in diagnosis.to_dict().items() if k != "ranking"}, indent=2),
    )


def front_of(diagnosis: Diagnosis) -> tuple[str, ...]:
    """The names of the pictures beside the account."""
    return (ROLLOUT, ROBOT) if diagnosis.verdict == "unknown" else (ROLLOUT, PARTS, ROBOT)


def _first_rows(rows: Sequence[Row]) -> int:
    """How many rows have room on the first screen: one at least."""
    lines = [max(len(row.sizes), 1 + bool(row.gate) + bool(row.instead) + bool(row.members)) for row in rows]
    return max(1, sum(used <= MOST_LINES for used in accumulate(lines)))


def _bars() -> str:
    """Lengths and colours of bars as rules of the style sheet: the policy lets no inline styles in."""
    lengths = "".join(f".w{i} {{ width: {i}%; }}\n" for i in range(101))
    return lengths + "".join(f".c{i} {{ background: {c}; }}\n" for i, c in enumerate((*SEGMENTS, FAINT)))
