"""The page: nothing outside itself; whatever is missing is left out."""

from __future__ import annotations

import re
from dataclasses import replace
from html.parser import HTMLParser
from typing import Any

import numpy as np
import pytest

from gpsim.reports.loop_page import render, terminal_notes, terminal_tables
from gpsim.reports.loop_report import LoopReport
from gpsim.reports.loop_sheets import gp_warnings


class _Reader(HTMLParser):
    """Addresses, tables and unclosed tags of a page."""

    def __init__(self) -> None:
        super().__init__()
        self.addresses: list[str] = []
        self.tables: list[list[list[str]]] = []
        self.open: list[str] = []
        self.tags: set[str] = set()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.add(tag)
        self.addresses += [value or "" for name, value in attrs if name in ("src", "href", "srcset", "data")]
        if tag == "table":
            self.tables.append([])
        if tag == "tr":
            self.tables[-1].append([])
        if tag in ("td", "th"):
            self.tables[-1][-1].append("")
        if tag not in ("meta", "img", "link", "br"):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if "td" in self.open or "th" in self.open:
            self.tables[-1][-1][-1] += (" " if self.open[-1] == "small" else "") + data


def read(page: str) -> _Reader:
    reader = _Reader()
    reader.feed(page)
    assert reader.open == []
    return reader


def test_nothing_from_outside_the_page(make_report: Any) -> None:
    page = render(make_report(2))
    reader = read(page)
    assert len(reader.addresses) == 6  # one per figure
    assert all(address.startswith("data:image/svg+xml;base64,") for address in reader.addresses)
    assert not {"script", "link", "iframe"} & reader.tags
    assert not re.search(r"https?://|url\(|@import", page)


@pytest.mark.parametrize("seeds", [1, 3])
def test_every_return_of_the_summary_is_in_its_table(make_report: Any, seeds: int) -> None:
    report: LoopReport = make_report(seeds)
    tables = read(render(report)).tables[:3]
    for table, key in zip(tables, ("returns", "returns_certified", "returns_all"), strict=True):
        column = {name: i for i, name in enumerate(table[0])}
        assert [row[0] for row in table[1:]] == list(report.policies)
        for row in table[1:]:
            stats = report.summary[key][row[0]]
            low, high = stats["interval"]
            assert (
                row[column["Mean ± std"]]
                == f"{stats['mean']:.1f} ± {stats['std']:.1f} {low:.1f} to {high:.1f}"
            )
            low, high = stats["iqm_interval"]
            assert row[column["IQM"]] == f"{stats['iqm']:.1f} {low:.1f} to {high:.1f}"
            if seeds > 1:
                assert row[-seeds:] == [f"{mean:.1f}" for mean in stats["by_seed"]]


def test_what_the_own_simulator_promised_stands_beside_all_starts(make_report: Any) -> None:
    solved, certified, every = read(render(make_report())).tables[:3]
    column = every[0].index("In its own simulator")
    assert [row[column] for row in every[1:]] == [f"{400 + i}.0" for i in range(len(every) - 1)]
    assert "In its own simulator" not in solved[0] + certified[0]


def test_one_step_and_rollout_numbers(make_report: Any) -> None:
    tables = read(render(make_report())).tables
    one_step = next(t for t in tables if t[0][:2] == ["Rate", "Prediction"])
    assert one_step[1][2:] == ["0.31 ± 0.10 %", "0.999990", "2.1 ± 0.7 %", "0.9995"]
    assert one_step[4][2] == "3.4 ± 0.6 %"
    rollout = next(t for t in tables if t[0][0] == "Simulator")
    assert rollout[0] == ["Simulator", "x [m]", "x_dot [m/s]", "theta [rad]", "theta_dot [rad/s]"]
    assert rollout[1] == ["Source", "0.123", "0.247", "0.370", "0.494"]


def test_terminal_shows_the_pages_numbers(make_report: Any) -> None:
    report = make_report(3)
    shown = {
        str(cell) for table in terminal_tables(report) for column in table.columns for cell in column.cells
    }
    on_page = {cell for table in read(render(report)).tables for row in table[1:] for cell in row}
    for stats in report.summary["returns"].values():
        assert {f"{mean:.1f}" for mean in stats["by_seed"]} <= {cell.removesuffix(" !") for cell in shown}
        mean = f"{stats['mean']:.1f} ± {stats['std']:.1f}"
        assert any(cell.startswith(mean) for cell in shown)
        assert any(cell.startswith(mean) for cell in on_page)


def test_what_lies_outside_the_recording_is_said(make_report: Any) -> None:
    report = make_report()
    assert "outside the range" not in render(report)
    shares = {"policy": 0.031, "random": 0.4, "deployed": float("nan")}
    page = render(replace(report, summary={**report.summary, "outside_recording": shares}))
    assert "training rows: 3 % of the source policy&#39;s, 40 % of random." in page


def test_much_outside_the_recording_is_a_warning(make_report: Any) -> None:
    report = make_report(3)
    outside = {0: {"policy": 0.9, "deployed": 0.1}, 1: {"deployed": 0.347}, 2: {"deployed": None}}
    found = [text for text in gp_warnings(replace(report, outside=outside)) if "outside" in text]
    assert len(found) == 1
    assert found[0].startswith("35 % of what the deployed GP policy visits")
    assert found[0].endswith("(seed 1)")
    page = render(replace(report, outside=outside))
    assert found[0] in page.split('class="warnings"')[1].split("</div>")[0]
    assert f"warning: {found[0]}" in terminal_notes(replace(report, outside=outside))
    # Without a fit to speak of, the warning still has its box.
    assert 'class="warnings"' in render(replace(report, outside=outside, fits={}))


def test_failing_seed_is_shown_and_named(make_report: Any) -> None:
    report = make_report(3)
    report.summary["returns"]["GP-Sample"]["by_seed"][1] = 61.5
    page = render(report)
    assert re.search(r'class="number marked"[^>]*>61\.5<', page)
    assert "GP-Sample with seed 1 (61.5)" in page


def test_text_from_outside_is_escaped(make_report: Any) -> None:
    page = render(replace(make_report(), experiment="<script>alert(1)</script>"))
    assert "<script" not in page
    assert "noise &lt;floor&gt;" in page


def test_headline_names_the_three_policies(make_report: Any) -> None:
    report = make_report()
    page = render(report)
    lead = page.split('<p class="lead">')[1].split("</p>")[0]
    for name in ("Source", "GP-Sample", "Target"):
        assert f"{report.summary['returns'][name]['mean']:.1f}" in lead


@pytest.mark.parametrize(
    "policies", [("GP-Mean", "Target"), ("Source",), ("Source", "Effects", "Something new", "Target")]
)
def test_any_set_of_policies(make_report: Any, policies: tuple[str, ...]) -> None:
    report = make_report(2, policies)
    tables = read(render(report)).tables
    assert [row[0] for row in tables[0][1:]] == list(policies)
    assert terminal_tables(report)


def test_nothing_but_a_name_still_makes_a_page() -> None:
    report = LoopReport("empty", (0,), {})
    assert read(render(report)).addresses == []
    assert terminal_tables(report) == []
    assert "No policy was evaluated" in render(report)


def test_no_starts_in_the_first_set(make_report: Any) -> None:
    report = make_report()
    summary = {**report.summary, "returns": {name: {"episodes": 0} for name in report.policies}}
    summary["share"] = {**summary["share"], "returns": 0.0}
    page = render(replace(report, summary=summary))
    assert "No start belongs to this set." in page
    assert f"{summary['returns_certified']['Source']['mean']:.1f} of 500" in page


@pytest.mark.filterwarnings("error")
def test_nan_anywhere_breaks_nothing(make_report: Any) -> None:
    report = make_report(2)
    holes = {
        name: np.where(np.arange(60) % 7 == 0, np.nan, values) for name, values in report.returns.items()
    }
    holes["Source"] = np.full((2, 60), np.nan)
    steps = np.arange(3.0)
    report = replace(
        report,
        summary=_with_nan(report.summary),
        returns=holes,
        curves={"Source": [(steps, np.full(3, np.nan)), (np.empty(0), np.empty(0))]},
        rollouts={name: np.full_like(path, np.nan) for name, path in report.rollouts.items()},
    )
    page = render(report)
    assert "nan" not in re.sub(r"base64,[^\"]*", "", page).lower().replace("finance", "")
    assert terminal_tables(report)


def _with_nan(value: Any) -> Any:
    """The same structure with every float NaN."""
    if isinstance(value, dict):
        return {key: _with_nan(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_with_nan(item) for item in value]
    return float("nan") if isinstance(value, float) else value
