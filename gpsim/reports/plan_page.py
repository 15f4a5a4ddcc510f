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
from gpsim.reports.canvas import FAINT, OTHERS, data_uri, legend_above, named, panels, style
from gpsim.reports.pages import page_of, resource, text_of
from gpsim.reports.quantities import LABEL
from gpsim.reports.sheets import percent, unit


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
    """What a person wants to know first, a line each."""
    return text_of("plan.txt.jinja", percent=percent, **facts).splitlines()


MORE = """
td, th, td:first-child, th:first-child { text-align: left; vertical-align: top; } img { max-width: 100%; }
"""


def plan_page(plan: Plan, state: Channels, action: Channels, box: Mapping[str, Sequence[float]]) -> str:
    """The page; equal plans give equal pages."""
    return page_of(
        "plan.html.jinja",
        resource("plain.css") + MORE,
        lines=told(plan_facts(plan)),
        picture=data_uri(plan_figure(plan, state, action, box)),
        plan=plan,
        fixed=FIXED,
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
