"""A diagnosis as one page and its pictures."""

from __future__ import annotations

import base64
import json
from collections.abc import Mapping
from typing import Any

import numpy as np
from jinja2 import Environment, StrictUndefined

from gpsim.diagnosis.diagnosis import Diagnosis
from gpsim.diagnosis.hypothesis import Hypothesis
from gpsim.diagnosis.predicting import traced
from gpsim.diagnosis.preparing import spread_out
from gpsim.diagnosis.shooting import fit
from gpsim.diagnosis.telling import number, paragraphs, ranking
from gpsim.reports.canvas import panels, png, style

PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>Diagnosis of {{ name }}</title>
<style>
body { font-family: system-ui, sans-serif; max-width: 62rem; margin: 2rem auto; padding: 0 1rem; color: #1b1f24; }
h1 { font-size: 1.5rem; } .verdict { font-size: 1.2rem; font-weight: 600; }
table { border-collapse: collapse; margin: 1rem 0; } td, th { padding: .25rem .8rem; text-align: right; }
td:first-child, th:first-child { text-align: left; } tr { border-bottom: 1px solid #e5e7eb; }
.typical td { color: #6b7280; font-size: .9rem; }
img { max-width: 100%; } pre { background: #f6f7f9; padding: .8rem; overflow-x: auto; }
</style></head><body>
<h1>Diagnosis of {{ name }}</h1>
<p class="verdict">Verdict: {{ report.verdict }}</p>
{% for text in paragraphs %}<p>{{ text }}</p>
{% endfor %}
{% for title, rows in tables.items() %}<h2>{{ title }}</h2>
<table><tr><th>error (RMS)</th>{% for kind in kinds.values() %}<th>{{ kind }}</th>{% endfor %}<th>unit</th></tr>
{% for name, errors in rows.items() %}<tr><td>{{ name }}</td>
{% for kind in kinds %}<td>{{ number(errors[kind]) }}</td>{% endfor %}<td>{{ errors.unit }}</td></tr>
<tr class="typical"><td>typical (from the median)</td>
{% for kind in kinds %}<td>{{ number(errors.typical[kind]) }}</td>{% endfor %}<td>{{ errors.unit }}</td></tr>
{% endfor %}</table>
{% endfor %}
{% for title, source in pictures.items() %}<h2>{{ title }}</h2><img alt="{{ title }}" src="{{ source }}">
{% endfor %}
<h2>All hypotheses that were fitted</h2><p>Nats behind the best, integration, explanation.</p><pre>{{ ranking }}</pre>
<h2>diagnosis.json</h2><pre>{{ text }}</pre>
</body></html>
"""
KINDS = {
    "before": "base",
    "tuned": "base tuned",
    "gp": "base + GP",
    "after": "base + effects",
    "after_gp": "base + effects + GP",
    "noise_floor": "noise floor",
}
SHOWN = 100  # held-out windows among which the median and the worst are looked for
TITLES = {
    "residual_inputs": "Residual against its two most telling inputs",
    "residual_time": "Residual over time, before and after",
    "traces": "Measured and simulated: the median and the worst held-out window",
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
        number=number,
        tables=_tables(report["fit"]),
        pictures=sources,
        ranking="\n".join(ranking(report)),
        text=json.dumps(short, indent=2),
    )


def _tables(fit: Mapping[str, Any]) -> dict[str, Mapping[str, Any]]:
    """Title -> rows of errors."""
    rollout = {name: errors for name, errors in fit["rollout"].items() if name != "horizon_s"}
    tables = {"One step ahead on held-out data": fit["one_step"]}
    return tables | (
        {f"After {fit['rollout']['horizon_s']:.3g} s on held-out data": rollout} if rollout else {}
    )


def figures(found: Diagnosis) -> dict[str, bytes]:
    """Name -> PNG."""
    with style():
        pictures = {"residual_inputs": _inputs(found)} if found.comparison.one_step else {}
        return pictures | {"residual_time": _time(found), "traces": _traces(found)}


def _inputs(found: Diagnosis) -> bytes:
    """The rate that stands out most against what it depends on most, before and after."""
    comparison, simulator = found.comparison, found.question.everything.simulator
    channels = (*simulator.state, *simulator.action)
    names = [channel.name for channel in channels]
    ratio = {n: e["before"] / max(e["noise_floor"], 1e-300) for n, e in comparison.one_step.items()}
    rate = simulator.rate.index(max(ratio, key=lambda name: ratio[name]))
    telling = [n for n in found.report["location"]["depends_on"] if n in names][:2] or names[:2]
    before, after = comparison.left_before[:, rate], comparison.left_after[:, rate]
    low, high = np.quantile(before, [0.002, 0.998])
    margin = 0.15 * (high - low) + 1e-12
    outside = float(np.mean((before < low - margin) | (before > high + margin)))
    figure, axes = panels(1, len(telling), (9.0, 3.6))
    for axis, name in zip(axes[0], telling, strict=True):
        column = names.index(name)
        for values, label in ((before, "base"), (after, "base + effects")):
            axis.plot(comparison.inputs[:, column], values, ".", markersize=2.5, alpha=0.4, label=label)
        axis.set_xlabel(f"{name} [{channels[column].unit}]")
        axis.set_ylim(
            low - margin, high + margin
        )  # a sensor's leaps would flatten the rest: they are counted
    axes[0, 0].set_ylabel(f"residual of {simulator.rate.names[rate]} [{simulator.rate.items[rate].unit}]")
    if outside > 0:
        axes[0, -1].set_title(f"{100 * outside:.2g} % lie outside", fontsize=9)
    axes[0, 0].legend(fontsize=8, markerscale=4)
    return png(figure)


def _time(found: Diagnosis) -> bytes:
    problem = found.question.everything
    channel = int(
        np.argmax(np.where(problem.observed, found.judgement.null.variance / problem.floor**2, 0.0))
    )
    unit = problem.simulator.state.items[channel].unit
    clock = problem.windows.t[:, 0] + found.question.origin
    session = bool((np.diff(clock) > 0).all())
    figure, axes = panels(1, 1, (9.0, 3.2))
    for one, label in ((found.judgement.null, "base"), (found.judgement.leader, "base + effects")):
        size = np.sqrt(np.mean(one.residuals[..., channel] ** 2, axis=1))
        at = clock if session else np.arange(len(size))
        axes[0, 0].semilogy(at, np.maximum(size, 1e-12), ".", markersize=4, label=label)
    axes[0, 0].set_xlabel("t [s]" if session else "window, in the order of the recording")
    axes[0, 0].set_ylabel(f"RMS residual of {problem.simulator.state.names[channel]} [{unit}]")
    axes[0, 0].legend()
    return png(figure)


def _traces(found: Diagnosis) -> bytes:
    """The median and the worst held-out window (of all, where nothing was held out), start states fitted."""
    question, leader = found.question, found.judgement.leader.hypothesis
    problem = question.held_out if len(question.held_out.windows) else question.everything
    problem = problem.on(spread_out(problem.windows, SHOWN))
    windows, simulator = problem.windows, problem.simulator
    fits = [
        fit(problem, h.frozen(), windows.measured[:, 0], iterations=8)
        for h in (Hypothesis(scheme=leader.scheme), leader)
    ]
    base, corrected = (traced(problem, f) for f in fits)
    order = np.argsort(((fits[1].residuals / problem.scale) ** 2).sum(axis=(1, 2)))
    figure, axes = panels(len(simulator.state), 2, (9.0, 1.9 * len(simulator.state)))
    for column, (row, label) in enumerate(((order[len(order) // 2], "median"), (order[-1], "worst"))):
        t = windows.t[row][windows.valid[row]]
        for i, channel in enumerate(simulator.state):
            axis = axes[i, column]
            if channel.name not in question.hidden:
                axis.plot(t, windows.measured[row, : len(t), i], "k.", markersize=3, label="measured")
            axis.plot(t, base[row, : len(t), i], "--", label="base")
            axis.plot(t, corrected[row, : len(t), i], label="base + effects")
            axis.ticklabel_format(useOffset=False)
            axis.set_ylabel(f"{channel.name} [{channel.unit}]")
            if i == 0:
                axis.set_title(f"{label} window")
        axes[-1, column].set_xlabel("t [s]")
    axes[-1, 0].legend(fontsize=8)
    return png(figure)
