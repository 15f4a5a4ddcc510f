"""All pages: nothing gets in but the page's own pictures and style, and names are text."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from odd_names import ODD, odd_report
from pages import check_policy

from gpsim.reports.canvas import page_of, resource
from gpsim.reports.loop_page import render
from gpsim.reports.prove_page import record
from gpsim.reports.sheets import Sheet, row

EVIL = "</style></title><script>alert(1)</script><img src=x onerror=alert(1)>\"'&$"


@pytest.mark.filterwarnings("error")
def test_the_page_of_a_loop_with_odd_names(make_report: Any) -> None:
    report = replace(
        odd_report(make_report), experiment=EVIL, named={0: [EVIL]}, settings={EVIL: EVIL}, command=EVIL
    )
    plain = check_policy(render(make_report(2)))
    page = check_policy(render(report))
    assert page.tags == plain.tags | {"ul", "li"}
    assert page.attributes == plain.attributes | {"title"}
    assert page.text.count(EVIL) >= 5
    pictures = [a.get("title", "") for tag, a in page.elements if tag == "img"]
    assert any(ODD["x_dot"] in title for title in pictures)
    assert any(tag == "th" and ODD["x_dot"] in a.get("title", "") for tag, a in page.elements)


def test_the_colours_of_policies_are_rules_of_the_style_sheet(make_report: Any) -> None:
    page = check_policy(render(make_report()))
    dots = {a["class"] for tag, a in page.elements if tag == "span" and a["class"].startswith("dot ")}
    assert len(dots) == 5
    assert all(f".{name.replace(' ', '.')} {{ background: #" in page.styles[0] for name in dots)


def test_the_page_of_a_proof() -> None:
    content = {
        "all": {"n": 1},
        "long": {"n": 0},
        "seed": EVIL,
        "diagnosed_under": [EVIL],
        "git_commit": EVIL,
    }
    sheet = Sheet(EVIL, (EVIL,), (row(EVIL),), note=EVIL)
    miss = dict.fromkeys(("trial", "stratum", "world", "truth", "said", "error", "equivalents"), EVIL)
    text = page_of(
        "prove.html.jinja",
        resource("plain.css"),
        groups={},
        content=content,
        beside=[EVIL],
        sheets=[sheet],
        confusion=sheet,
        misses=[miss],
    )
    page = check_policy(text)
    assert "img" not in page.tags
    assert page.text.count(EVIL) >= 15


def test_a_style_sheet_cannot_end_its_own_element() -> None:
    with pytest.raises(ValueError, match="style sheet"):
        page_of("prove.html.jinja", "body { } </style>")


def test_a_record_keeps_tags_and_bars_in_their_cells(monkeypatch: pytest.MonkeyPatch) -> None:
    sheet = Sheet("Sheet", ("name", "n"), (row("<b>|x\ny\x1b[31m", "< 5"),))
    monkeypatch.setattr("gpsim.reports.prove_page.proof_sheets", lambda content: [sheet])
    monkeypatch.setattr("gpsim.reports.prove_page.beside", lambda content: [])
    content = {"all": {"n": 1}, "long": {"n": 0}, "seed": 1, "diagnosed_under": ["abc"]}
    text = record(content)
    assert r"| \<b>\|x y[31m | < 5 |" in text.splitlines()
