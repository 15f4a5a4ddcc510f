"""A plan as one self-contained page: what is played, how it goes under each explanation, and what it teaches.

What a plan says, in a few lines: for the terminal and above its page.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import cycle
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
from gpsim.reports.sheets import MISSING, Cell, percent, row, sheet, significant, unit


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
        lines.append("The machine is reset by hand before each piece, and each piece is an episode.")
    if facts["dithers"]:
        lines.append(
            "A policy controls the machine: its command plus that of the plan is played, within the limits."
        )
    if not pairs:
        lines.append("There is only one explanation, so the plan is for its parameters.")
    for pair in pairs:
        who = f"{pair['first']} and {pair['second']}"
        wanted = "; ".join(pair["sensors"]) or "a quantity for which they differ"
        others = ", ".join(f"{kind} {nats:.3g}" for kind, nats in pair["fixed"].items())
        others += f", the old recording {pair['recorded']:.2g}"
        lines.append(
            f"{who} differ by {pair['a_minute']:.3g} nats a minute ({others})."
            if pair["separated"]
            else f"None of the tested commands separates {who} ({pair['nats']:.2g} nats); measure {wanted}."
        )
    lines.append(
        f"Of {safety['draws']} draws of all posteriors {safety['left']} left the box (minus {safety['margin']:.0%} on "
        f"each side), or did not return to rest: a probability of at most {percent(safety['most'])} (90 %)."
    )
    return lines


MORE = """
td, th, td:first-child, th:first-child { text-align: left; vertical-align: top; } img { max-width: 100%; }
"""
NOTE = (
    "Nats are the log likelihood that a false explanation loses after its parameters were adjusted, within the "
    "limits of the first recording, to mimic the true one; 2.3 nats are odds of ten. The noise is that of the first "
    "recording. A fixed excitation has the largest safe amplitude in each piece. For the old recording, nats are its "
    "log odds."
)


def plan_page(plan: Plan, state: Channels, action: Channels, box: Mapping[str, Sequence[float]]) -> str:
    """The page; equal plans give equal pages."""
    pairs = (
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
    heads = ("pair", "nats in all", "a minute: plan", *FIXED, "the old recording", "sensor that would tell")
    pieces = ((f"{i + 1}", p.kind, f"{p.begin:g}", f"{p.seconds:g}") for i, p in enumerate(plan.pieces))
    return page_of(
        "plan.html.jinja",
        resource("plain.css") + MORE,
        lines=told(plan_facts(plan)),
        picture=data_uri(plan_figure(plan, state, action, box)),
        sheets=[
            sheet("What it tells apart", heads, pairs, note=NOTE),
            sheet("Pieces", ("piece", "grew from", "begins [s]", "lasts [s]"), pieces, labels=2),
        ],
    )


def plan_figure(plan: Plan, state: Channels, action: Channels, box: Mapping[str, Sequence[float]]) -> Figure:
    """Commands above, states below."""
    rows = len(action) + len(state)
    t = plan.dt * np.arange(len(plan.t))
    with style():
        figure, axes = panels(rows, 1, (11.0, 0.7 + 1.5 * rows), sharex=True)
        for i, channel in enumerate((*action, *state)):
            axis, k = axes[i, 0], i - len(action)
            name = f"{channel.name}, added" if k < 0 and plan.dithers else channel.name
            axis.set_ylabel(named(name, unit(channel.unit), LABEL))
            if k < 0:
                axis.step(t, plan.commands[:, i], where="post", color="#333333", linewidth=1.0)
                continue
            for tint, (label, course) in zip(cycle(OTHERS), plan.courses.items(), strict=False):
                axis.plot(t, course[:, k], color=tint, label=label, linewidth=1.2)
            for edge in box.get(channel.name, ()):
                axis.axhline(edge, color=FAINT, linestyle="--", linewidth=0.8)
        axes[-1, 0].set_xlabel("time [s]")
        legend_above(figure, axes[len(action), 0], columns=2)
        return figure
