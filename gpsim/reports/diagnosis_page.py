"""A diagnosis as one page and its pictures."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence

from gpsim.diagnosis import Diagnosis
from gpsim.diagnosis.report import HeldOutFit, Kind, RolloutErrors, StepErrors
from gpsim.diagnosis.run import Decision
from gpsim.reports.diagnosis_figures import Picture
from gpsim.reports.diagnosis_text import in_percent, number, paragraphs, ranking
from gpsim.reports.html import page_of
from gpsim.reports.trace_text import trace_lines

STYLE = """
body { font-family: system-ui, sans-serif; max-width: 62rem; margin: 2rem auto; padding: 0 1rem; color: #1b1f24; }
h1, h2, p { overflow-wrap: anywhere; }
h1 { font-size: 1.5rem; } .verdict { font-size: 1.2rem; font-weight: 600; }
table { border-collapse: collapse; margin: 1rem 0; } td, th { padding: .25rem .8rem; text-align: right; }
td:first-child, th:first-child { text-align: left; } tr { border-bottom: 1px solid #e5e7eb; }
.typical td { color: #6b7280; font-size: .9rem; }
.caption { color: #6b7280; font-size: .9rem; margin-top: .2rem; }
img { max-width: 100%; } pre { background: #f6f7f9; padding: .8rem; overflow-x: auto; }
"""
PAGE = """<!doctype html>
<html lang="en"><head>{{ head }}<title>Diagnosis of {{ name }}</title></head><body>
<h1>Diagnosis of {{ name }}</h1>
<p class="verdict">Verdict: {{ verdict }}</p>
{% for text in paragraphs %}<p>{{ text }}</p>
{% endfor %}
{% for title, rows in tables.items() %}<h2>{{ title }}</h2>
<table><tr><th>error (RMS)</th>{% for kind in kinds.values() %}<th>{{ kind }}</th>{% endfor %}<th>unit</th></tr>
{% for name, errors in rows.items() %}<tr><td{{ name | title_of }}>{{ name | short }}</td>
{% for kind in kinds %}<td>{{ number(errors.of(kind)) }}</td>{% endfor %}
<td>{{ errors.unit | short(16) }}</td></tr>
{% if errors.typical %}<tr class="typical"><td>typical (from the median)</td>
{% for kind in kinds %}<td>{{ number(errors.typical.of(kind)) }}</td>{% endfor %}
<td>{{ errors.unit | short(16) }}</td></tr>
{%- endif %}
<tr class="typical"><td>of the base's, 90 % interval</td>
{% for kind in kinds %}<td>{{ share(errors, kind) }}</td>{% endfor %}<td>%</td></tr>
{% endfor %}</table>
{% endfor %}
{% for picture in pictures %}<h2>{{ picture.title }}</h2>
<img alt="{{ picture.title }}"{{ picture.shows | titles_of }} src="{{ picture.source }}">
<p class="caption">{{ picture.caption }}</p>
{% endfor %}{% if missing %}<h2>What could not be shown</h2>
{% for line in missing %}<p>{{ line }}</p>
{% endfor %}{% endif %}
<details><summary>All hypotheses that were fitted</summary>
<p>Nats behind the best, integration, explanation.</p><pre>{{ ranking }}</pre></details>
<details><summary>All decisions of the search</summary>
<p>Nats by which what was looked at wins (its price paid), the share that it removes of what was left, the rule that
took or refused it, what it adds (+) and drops (-).</p><pre>{{ trace }}</pre></details>
<details><summary>diagnosis.json</summary><pre>{{ text }}</pre></details>
</body></html>
"""
KINDS: Mapping[Kind, str] = {
    "before": "base",
    "tuned": "base tuned",
    "gp": "base + GP",
    "after": "base + effects",
    "after_gp": "base + effects + GP",
    "noise_floor": "noise floor",
}


def page(
    diagnosis: Diagnosis,
    pictures: Mapping[str, Picture],
    name: str,
    missing: Sequence[str] = (),
    decisions: Sequence[Decision] = (),
) -> str:
    """One self-contained HTML page: no network, no scripts, no dates. missing: lines about what it lacks."""
    short = {k: v for k, v in diagnosis.to_dict().items() if k != "ranking"}
    return page_of(
        PAGE,
        STYLE,
        name=name,
        verdict=diagnosis.verdict,
        paragraphs=paragraphs(diagnosis),
        kinds=KINDS,
        number=number,
        share=_share,
        tables=_tables(diagnosis.fit),
        pictures=list(pictures.values()),
        missing=list(missing),
        ranking="\n".join(ranking(diagnosis)),
        trace="\n".join(trace_lines(decisions)),
        text=json.dumps(short, indent=2),
    )


def _share(errors: StepErrors | RolloutErrors, kind: Kind) -> str:
    """What is left of the base's error, in per cent, with its paired interval where there are enough samples."""
    left = None if errors.over_before is None else errors.over_before.of(kind)
    if left is None or left.value is None:
        return ""
    text = in_percent(left.value)
    if left.low is None or left.high is None:
        return text
    return f"{text} ({in_percent(left.low)} to {in_percent(left.high)})"


def _tables(fit: HeldOutFit) -> dict[str, Mapping[str, StepErrors] | Mapping[str, RolloutErrors]]:
    """Title -> rows of errors."""
    steps, runs = fit.one_step, fit.rollout.channels
    tables: dict[str, Mapping[str, StepErrors] | Mapping[str, RolloutErrors]]
    tables = {"One step ahead on held-out data": steps}
    return tables | ({f"After {fit.rollout.horizon_s:.3g} s on held-out data": runs} if runs else {})
