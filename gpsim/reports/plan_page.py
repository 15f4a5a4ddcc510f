"""A plan as one self-contained page: what is played, how it goes under each explanation, and what it teaches.

What a plan says, in a few lines: for the terminal and above its page.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from gpsim.channels import Channels
from gpsim.planning import FIXED, Plan
from gpsim.reports.canvas import (
    FAINT,
    LABEL,
    OTHERS,
    data_uri,
    legend_above,
    named,
    page_of,
    panels,
    resource,
    style,
)
from gpsim.reports.sheets import MISSING, Cell, Sheet, percent, row, significant, unit


def plan_facts(plan: Plan) -> dict[str, Any]:
    """What plan.yaml says of pieces, pairs and safety."""
    return {
        "minutes": plan.minutes,
        "dt": plan.dt,
        "anew": plan.anew,
        "dithers": plan.dithers,
        "pieces": [vars(p) for p in plan.pieces],
        "pairs": [{**vars(p), "sensors": list(p.sensors)} for p in plan.pairs],
        "safety": vars(plan.safety),
    }


def told(facts: Mapping[str, Any]) -> list[str]:
    """What a person wants to know first."""
    pairs, safety = facts["pairs"], facts["safety"]
    lines = [
        f"{facts['minutes']:.2g} minutes in {len(facts['pieces'])} pieces, one command every {facts['dt']:g} s."
    ]
    if facts["anew"]:
        lines.append("Before each piece the machine is put back to rest by hand; each is an episode.")
    if facts["dithers"]:
        lines.append(
            "A policy steers meanwhile: what is played is its command plus the plan's, within the limits."
        )
    if not pairs:
        lines.append("There is one explanation: the plan is for its parameters.")
    for pair in pairs:
        lines.append(_told(pair))
    lines.append(
        f"Of {safety['draws']} draws of all posteriors {safety['left']} left the box less {safety['margin']:.0%} at "
        f"each side, or did not come back to rest: a chance of at most {percent(safety['most'])} (90 %)."
    )
    return lines


def _told(pair: Mapping[str, Any]) -> str:
    who = f"{pair['first']} and {pair['second']}"
    if not pair["separated"]:
        wanted = "; ".join(pair["sensors"]) or "a quantity of which they say something different"
        return f"No command that was tried separates {who} ({pair['nats']:.2g} nats); measure {wanted}."
    others = ", ".join(f"{kind} {nats:.3g}" for kind, nats in pair["fixed"].items())
    return f"{who} differ by {pair['a_minute']:.3g} nats a minute ({others}, the old recording {pair['recorded']:.2g})."


MORE = """
td, th, td:first-child, th:first-child { text-align: left; vertical-align: top; } img { max-width: 100%; }
"""
NOTE = (
    "Nats are what the explanation that is not true loses in log likelihood after its parameters have moved to where "
    "they mimic the true one best, as far as the first recording lets them; 2.3 nats are odds of ten. The noise is "
    "that of the first recording. A fixed excitation is as large as is safe in each piece; of the old recording it is "
    "the log odds that it gave."
)


def plan_page(plan: Plan, state: Channels, action: Channels, box: Mapping[str, Sequence[float]]) -> str:
    """The page; equal plans give equal pages."""
    return page_of(
        "plan.html.jinja",
        resource("plain.css") + MORE,
        lines=told(plan_facts(plan)),
        picture=data_uri(plan_figure(plan, state, action, box)),
        sheets=[pairs_sheet(plan), pieces_sheet(plan)],
    )


def pairs_sheet(plan: Plan) -> Sheet:
    """A row a pair: nats a minute of the plan and of what else could be played."""
    rows = tuple(
        row(
            f"{p.first} / {p.second}",
            Cell(significant(p.nats), marked=not p.separated),
            significant(p.a_minute),
            *(significant(p.fixed.get(kind)) for kind in FIXED),
            significant(p.recorded),
            "; ".join(p.sensors) or MISSING,
        )
        for p in plan.pairs
    )
    columns = ("pair", "nats in all", "a minute: plan", *FIXED, "the old recording", "sensor that would tell")
    return Sheet("What it tells apart", columns, rows, labels=1, note=NOTE)


def pieces_sheet(plan: Plan) -> Sheet:
    """A row a piece."""
    rows = tuple(row(f"{i + 1}", p.kind, f"{p.begin:g}", f"{p.seconds:g}") for i, p in enumerate(plan.pieces))
    return Sheet("Pieces", ("piece", "grew from", "begins [s]", "lasts [s]"), rows, labels=2)


def plan_figure(plan: Plan, state: Channels, action: Channels, box: Mapping[str, Sequence[float]]) -> Figure:
    """Commands above, states below."""
    rows = len(action) + len(state)
    t = plan.dt * np.arange(len(plan.t))
    with style():
        figure, axes = panels(rows, 1, (11.0, 0.7 + 1.5 * rows), sharex=True)
        for i, channel in enumerate(action):
            axis = axes[i, 0]
            axis.step(t, plan.commands[:, i], where="post", color="#333333", linewidth=1.0)
            name = f"{channel.name}, added" if plan.dithers else channel.name
            axis.set_ylabel(named(name, unit(channel.unit), LABEL))
        for i, channel in enumerate(state):
            axis = axes[len(action) + i, 0]
            for k, (label, course) in enumerate(plan.courses.items()):
                axis.plot(t, course[:, i], color=OTHERS[k % len(OTHERS)], label=label, linewidth=1.2)
            for edge in box.get(channel.name, ()):
                axis.axhline(edge, color=FAINT, linestyle="--", linewidth=0.8)
            axis.set_ylabel(named(channel.name, unit(channel.unit), LABEL))
        axes[-1, 0].set_xlabel("time [s]")
        legend_above(figure, axes[len(action), 0], columns=2)
        return figure
