"""A proof as one self-contained page: what had to be reached, strata, confusion, every miss with its report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from gpsim.reports.html import page_of
from gpsim.reports.prove_misses import miss_rows
from gpsim.reports.prove_sheets import beside, confusion_sheet, proof_sheets

Json = Mapping[str, Any]
STYLE = """
body { font-family: system-ui, sans-serif; max-width: 76rem; margin: 2rem auto; padding: 0 1rem; color: #1b1f24; }
h1 { font-size: 1.5rem; } h2 { font-size: 1.15rem; margin-top: 2rem; }
.wide { overflow-x: auto; } table { border-collapse: collapse; font-size: .9rem; }
td, th { padding: .2rem .7rem; text-align: right; } td:first-child, th:first-child, .words td { text-align: left; }
th { vertical-align: bottom; } tr { border-bottom: 1px solid #e5e7eb; } .marked { color: #b42318; font-weight: 600; }
.matrix th { writing-mode: vertical-rl; transform: rotate(180deg); font-weight: 400; }
.matrix th:first-child { writing-mode: horizontal-tb; }
"""
PAGE = """<!doctype html>
<html lang="en"><head>{{ head }}<title>gpsim prove</title></head><body>
<h1>Concealed worlds, diagnosed blind</h1>
<p>{{ content.all.n }} worlds of 2&nbsp;000 to 12&nbsp;000 transitions and {{ content.long.n }} longer ones,
{% if "rough" in content %}{{ content.rough.n }} rough ones, {% endif %}
{% if "machines" in content %}{{ content.machines.n }} whole machines, {% endif %}
{% if "mjcf" in content %}{{ content.mjcf.n }} robots by their MuJoCo models, {% endif %}seed
{{ content.seed }}. Every answer was hashed before the diagnosis began and verified before it was scored. A world
is visible when each of its effects makes 5 % of the mean squared one-step residual or moves a rollout of a second by
more than half the noise; the headline figures hold the visible ones. Commits of
the diagnoses: {{ content.diagnosed_under|join(", ") }}; of this page: {{ content.git_commit or "not recorded" }}.</p>
{% for line in beside %}<p class="marked">{{ line }}</p>
{% endfor %}
{% macro table(sheet, kind="") %}<h2>{{ sheet.title }}</h2><div class="wide"><table class="{{ kind }}">
<tr>{% for name in sheet.columns %}<th>{{ name }}</th>{% endfor %}</tr>
{% for cells in sheet.rows %}<tr>{% for cell in cells %}<td{% if cell.marked %} class="marked"{% endif %}>
{{- cell.text }}</td>{% endfor %}</tr>
{% endfor %}</table></div>{% if sheet.note %}<p>{{ sheet.note }}</p>{% endif %}{% endmacro %}
{% for sheet in sheets if sheet.rows %}{{ table(sheet) }}
{% endfor %}
{{ table(confusion, "matrix") }}
<h2>{{ misses|length }} misses</h2><div class="wide"><table class="words">
<tr><th>trial</th><th>world</th><th>truth</th><th>said</th><th>listed equivalents</th></tr>
{% for miss in misses %}<tr><td><a href="diagnoses/{{ miss.trial }}/diagnosis/report.html">{{ miss.trial }}</a></td>
<td>{{ miss.stratum }}: {{ miss.world }}</td><td>{{ miss.truth }}</td>
<td>{{ miss.said }} {{ miss.error }}</td><td>{{ miss.equivalents }}</td></tr>
{% endfor %}</table></div>
</body></html>
"""


def page(content: Json, scores: Sequence[Json]) -> str:
    """The page; it stands beside the folder of diagnoses that it links to."""
    return page_of(
        PAGE,
        STYLE,
        content=content,
        beside=beside(content),
        sheets=proof_sheets(content),
        confusion=confusion_sheet(content),
        misses=miss_rows(scores),
    )
