"""A diagnosis as one page and its pictures."""

from __future__ import annotations

import base64
import json
from collections.abc import Mapping
from typing import Any

import numpy as np
from jinja2 import Environment, StrictUndefined

from gpsim.diagnosis.diagnosis import Diagnosis
from gpsim.diagnosis.telling import paragraphs, ranking
from gpsim.reports.canvas import panels, png, style

PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>Diagnosis of {{ name }}</title>
<style>
body { font-family: system-ui, sans-serif; max-width: 62rem; margin: 2rem auto; padding: 0 1rem; color: #1b1f24; }
h1 { font-size: 1.5rem; } .verdict { font-size: 1.2rem; font-weight: 600; }
table { border-collapse: collapse; margin: 1rem 0; } td, th { padding: .25rem .8rem; text-align: right; }
td:first-child, th:first-child { text-align: left; } tr { border-bottom: 1px solid #e5e7eb; }
img { max-width: 100%; } pre { background: #f6f7f9; padding: .8rem; overflow-x: auto; }
</style></head><body>
<h1>Diagnosis of {{ name }}</h1>
<p class="verdict">Verdict: {{ report.verdict }}</p>
{% for text in paragraphs %}<p>{{ text }}</p>
{% endfor %}
<h2>One step ahead on held-out data</h2>
<table><tr><th>rate</th>{% for kind in kinds %}<th>{{ kind }}</th>{% endfor %}<th>unit</th></tr>
{% for rate, errors in report.fit.one_step.items() %}<tr><td>{{ rate }}</td>
{% for kind in kinds %}<td>{{ "%.4g"|format(errors[kind]) }}</td>{% endfor %}<td>{{ errors.unit }}</td></tr>
{% endfor %}</table>
{% for title, source in pictures.items() %}<h2>{{ title }}</h2><img alt="{{ title }}" src="{{ source }}">
{% endfor %}
<h2>All hypotheses that were fitted</h2><pre>{{ ranking }}</pre>
<h2>diagnosis.json</h2><pre>{{ text }}</pre>
</body></html>
"""
KINDS = ("before", "tuned", "gp", "after", "after_gp", "noise_floor")
TITLES = {
    "residual_inputs": "Residual against its two most telling inputs",
    "residual_time": "Residual over time, before and after",
    "traces": "Measured and simulated: the median and the worst window",
}


def page(report: Mapping[str, Any], pictures: Mapping[str, bytes], name: str) -> str:
    """One self-contained HTML page: no network, no scripts, no dates."""
    sources = {
        TITLES[k]: f"data:image/png;base64,{base64.b64encode(v).decode()}" for k, v in pictures.items()
    }
    environment = Environment(autoescape=True, undefined=StrictUndefined)
    short = {k: v for k, v in report.items() if k != "ranking"}
    return environment.from_string(PAGE).render(
        name=name,
        report=report,
        paragraphs=paragraphs(report),
        kinds=KINDS,
        pictures=sources,
        ranking="\n".join(ranking(report)),
        text=json.dumps(short, indent=2),
    )


def figures(found: Diagnosis) -> dict[str, bytes]:
    """Name -> PNG."""
    with style():
        return {
            "residual_inputs": _inputs(found),
            "residual_time": _time(found),
            "traces": _traces(found),
        }


def _inputs(found: Diagnosis) -> bytes:
    problem, null = found.question.everything, found.judgement.null
    windows, simulator = problem.windows, problem.simulator
    names = (*simulator.state.names, *simulator.action.names)
    values = np.concatenate([windows.measured[:, :-1], windows.actions], axis=2)
    telling = [n for n in found.report["location"]["depends_on"] if n in names][:2] or list(names[:2])
    channel = int(np.argmax(np.where(problem.observed, null.variance / problem.floor**2, 0.0)))
    steps = np.diff(null.residuals, axis=1)[..., channel]
    figure, axes = panels(1, len(telling), (9.0, 3.4))
    for axis, name in zip(axes[0], telling, strict=True):
        axis.plot(values[..., names.index(name)].ravel(), steps.ravel(), ".", markersize=2, alpha=0.4)
        axis.set_xlabel(name)
        axis.set_ylabel(f"step of {simulator.state.names[channel]}'s residual")
    return png(figure)


def _time(found: Diagnosis) -> bytes:
    problem = found.question.everything
    channel = int(
        np.argmax(np.where(problem.observed, found.judgement.null.variance / problem.floor**2, 0.0))
    )
    figure, axes = panels(1, 1, (9.0, 3.2))
    for fit, label in ((found.judgement.null, "base"), (found.judgement.leader, "base + effects")):
        size = np.sqrt(np.mean(fit.residuals[..., channel] ** 2, axis=1))
        axes[0, 0].semilogy(np.arange(len(size)), np.maximum(size, 1e-12), ".", markersize=4, label=label)
    axes[0, 0].set_xlabel("window, in the order of the recording")
    axes[0, 0].set_ylabel(f"RMS residual of {problem.simulator.state.names[channel]}")
    axes[0, 0].legend()
    return png(figure)


def _traces(found: Diagnosis) -> bytes:
    problem = found.question.everything
    windows, simulator = problem.windows, problem.simulator
    null, leader = found.judgement.null, found.judgement.leader
    size = ((leader.residuals / problem.scale) ** 2).sum(axis=(1, 2))
    order = np.argsort(size)
    figure, axes = panels(len(simulator.state), 2, (9.0, 1.9 * len(simulator.state)))
    for column, (row, label) in enumerate(((order[len(order) // 2], "median"), (order[-1], "worst"))):
        t = windows.t[row][windows.valid[row]]
        for i, channel in enumerate(simulator.state):
            measured = windows.measured[row, : len(t), i]
            axis = axes[i, column]
            axis.plot(t, measured, "k.", markersize=3, label="measured")
            axis.plot(t, measured - null.residuals[row, : len(t), i], "--", label="base")
            axis.plot(t, measured - leader.residuals[row, : len(t), i], label="base + effects")
            axis.set_ylabel(f"{channel.name} [{channel.unit}]")
            if i == 0:
                axis.set_title(f"{label} window")
    axes[0, 0].legend(fontsize=8)
    return png(figure)
