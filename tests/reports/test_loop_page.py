"""The report of a loop: nothing outside itself, every number in it, and things called by what they are in this loop."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from odd_names import ODD, odd_report
from pages import Page, check_policy

from gpsim.evaluation import returns as evaluation
from gpsim.reports import loop_page, loop_sheets
from gpsim.reports.canvas import page_of, resource
from gpsim.reports.loop_figures import figure_returns
from gpsim.reports.loop_page import render, terminal_notes, terminal_tables
from gpsim.reports.loop_report import LoopReport
from gpsim.reports.loop_sheets import gp_warnings, return_sheets
from gpsim.reports.prove_page import section
from gpsim.reports.sheets import Sheet, row

EVIL = "</style></title><script>alert(1)</script><img src=x onerror=alert(1)>\"'&$"
Make = Callable[..., LoopReport]


@pytest.fixture(autouse=True)
def _undrawn(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Most look at the words alone."""
    if "drawn" not in request.node.name:
        monkeypatch.setattr(loop_page, "data_uri", lambda figure: "data:image/png;base64,")


def summed(report: LoopReport, **changes: Any) -> LoopReport:
    """With other parts of its summary."""
    return replace(report, summary={**report.summary, **changes})


def rows_of(page: str) -> list[list[str]]:
    """The cells of every row of a page, as text."""
    rows = re.findall(r"<tr[^>]*>(.*?)</tr>", page, re.S)
    found = [re.findall(r"<t[dh][^>]*>(.*?)</t[dh]>", cells, re.S) for cells in rows]
    return [[Page(cell.replace("<small>", " ")).text for cell in cells] for cells in found]


def lead(report: LoopReport) -> str:
    """The first words of its page."""
    return Page(render(report).partition('<p class="lead">')[2].partition("</p>")[0]).text


def without_target(make_report: Make) -> LoopReport:
    """As the stages make it: the first set is then the certified one."""
    report = make_report(2, ("Source", "GP-Sample"))
    starts = {**report.starts, "returns": report.starts["returns_certified"]}
    share = {**report.summary["share"], "returns": report.summary["share"]["returns_certified"]}
    return replace(summed(report, returns=report.summary["returns_certified"], share=share), starts=starts)


def test_nothing_from_outside_the_page_as_it_is_drawn(make_report: Make) -> None:
    page = check_policy(render(make_report(2)))
    pictures = [a["src"] for tag, a in page.elements if tag == "img"]
    assert len(pictures) == 4  # one per figure
    assert all(source.startswith("data:image/svg+xml;base64,") for source in pictures)
    assert not re.search(r"https?://|url\(|@import", render(make_report(2)))
    dots = {a["class"] for tag, a in page.elements if tag == "span" and a["class"].startswith("dot ")}
    assert len(dots) == 5
    assert all(f".{name.replace(' ', '.')} {{ background: #" in page.styles[0] for name in dots)


@pytest.mark.filterwarnings("error")
def test_odd_names_are_text_where_they_are_drawn_too(make_report: Make) -> None:
    odd = odd_report(make_report)
    report = replace(odd, experiment=EVIL, named={0: [EVIL]}, settings={EVIL: EVIL}, command=EVIL)
    plain, page = check_policy(render(make_report(2))), check_policy(render(report))
    assert page.tags == plain.tags | {"ul", "li"}
    assert page.attributes == plain.attributes | {"title"}
    assert page.text.count(EVIL) >= 5
    pictures = [a.get("title", "") for tag, a in page.elements if tag == "img"]
    assert any(ODD["x_dot"] in title for title in pictures)
    assert any(tag == "th" and ODD["x_dot"] in a.get("title", "") for tag, a in page.elements)
    assert "noise <floor>" in page.text


@pytest.mark.parametrize("seeds", [1, 3])
def test_every_number_of_the_summary_is_in_its_table_and_in_the_terminals(
    make_report: Make, seeds: int
) -> None:
    report = make_report(seeds)
    on_page = rows_of(render(report))
    shown = {str(c) for table in terminal_tables(report) for column in table.columns for c in column.cells}
    for key in ("returns", "returns_certified", "returns_all"):
        for name, stats in report.summary[key].items():
            (low, high), (below, above) = stats["interval"], stats["iqm_interval"]
            cells = [
                f"{stats['mean']:.1f} ± {stats['std']:.1f} {low:.1f} to {high:.1f}",
                f"{stats['iqm']:.1f} {below:.1f} to {above:.1f}",
                *(f"{mean:.1f}" for mean in stats["by_seed"] if seeds > 1),
            ]
            assert any(
                cells_of[0] == name and set(cells) <= set(cells_of) for cells_of in on_page if cells_of
            )
            assert any(cell.startswith(cells[0].split(" ±")[0]) for cell in shown)
    for name, promised in report.summary["own_simulator"].items():  # beside all starts alone
        assert sum(cells[0] == name and f"{promised:.1f}" in cells for cells in on_page if cells) == 1
    assert ["x_acc [m/s²]", "mean", "0.31 ± 0.10 %", "0.999990", "2.1 ± 0.7 %", "0.9995"] in on_page
    assert ["Source", "0.123", "0.247", "0.370", "0.494"] in on_page
    first = lead(report)
    assert all(
        f"{report.summary['returns'][n]['mean']:.1f}" in first for n in ("Source", "GP-Sample", "Target")
    )


def test_a_seed_that_fails_is_marked_and_named(make_report: Make) -> None:
    report = make_report(3)
    report.summary["returns"]["GP-Sample"]["by_seed"][1] = 61.5
    page = render(report)
    assert re.search(r'class="number marked"[^>]*>61\.5<', page)
    assert "GP-Sample with seed 1 (61.5)" in page


def test_what_is_missing_is_left_out(make_report: Make) -> None:
    empty = LoopReport("empty", (0,), {})
    assert terminal_tables(empty) == []
    assert "<img" not in render(empty)
    assert "No policy was evaluated" in render(empty)
    report = make_report()
    none = {name: {"episodes": 0} for name in report.policies}
    page = render(summed(report, returns=none, share={**report.summary["share"], "returns": 0.0}))
    assert "No start belongs to this set." in page
    assert f"{report.summary['returns_certified']['Source']['mean']:.1f} of 500" in page


def with_nan(value: Any) -> Any:
    """The same structure with every float NaN."""
    if isinstance(value, dict):
        return {key: with_nan(item) for key, item in value.items()}
    if isinstance(value, list):
        return [with_nan(item) for item in value]
    return float("nan") if isinstance(value, float) else value


@pytest.mark.filterwarnings("error")
def test_nan_anywhere_breaks_nothing_that_is_drawn(make_report: Make) -> None:
    report = make_report(2)
    holes = {n: np.where(np.arange(60) % 7 == 0, np.nan, values) for n, values in report.returns.items()}
    report = replace(
        report,
        summary=with_nan(report.summary),
        returns=holes | {"Source": np.full((2, 60), np.nan)},
        curves={"Source": [(np.arange(3.0), np.full(3, np.nan)), (np.empty(0), np.empty(0))]},
        rollouts={name: np.full_like(path, np.nan) for name, path in report.rollouts.items()},
    )
    page = render(report)
    assert "nan" not in re.sub(r"base64,[^\"]*", "", page).lower().replace("finance", "")
    assert terminal_tables(report)


def test_without_a_target_policy_nobody_speaks_of_one(make_report: Make) -> None:
    report = without_target(make_report)
    titles = [sheet.title for sheet in return_sheets(report)]
    assert len(titles) == 2
    assert "a search over action sequences certifies" in titles[0]
    figure = figure_returns(report)
    assert figure is not None
    drawn = [axis.get_title("left").split(" (")[0] for axis in figure.axes]
    assert drawn == ["Certified by the search", "All starts"]
    assert "the starts that a search over action sequences certifies as solvable" in lead(report)
    assert not re.search("that a Target policy|Solved by a Target", render(report))
    assert "that a Target policy of any seed solves" in return_sheets(make_report(2))[0].title


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({}, "on the policy's own data and 4.4 % on data of random actions"),
        ({"judged_on": "the training episodes: the recording holds nothing out"}, "1.7 % on the training episodes (NRMSE"),
        ({"judged_on": "held-out episodes"}, "1.7 % on the held-out episodes (NRMSE"),
        ({"measured_on": "the stand-in limo"}, " Measured on the stand-in limo."),
    ],
)  # fmt: skip
def test_what_was_judged_and_measured_on_reads_as_a_sentence(
    make_report: Make, changes: dict[str, str], said: str
) -> None:
    report = make_report()
    assert said in lead(summed(report, **changes))
    if "measured_on" in changes:
        kept = evaluation.summarise_seeds([{**report.summary, "seed": 0, **changes}], {}, {}, "limo")
        assert kept["measured_on"] == changes["measured_on"]
        told = [f"measured on {changes['measured_on']}", *terminal_notes(report)]
        assert terminal_notes(summed(report, **changes)) == told
        assert said not in lead(report)


def test_what_lies_outside_the_recording_is_said_and_much_of_it_is_a_warning(make_report: Make) -> None:
    assert "outside the range" not in render(make_report())
    shares = {"policy": 0.031, "random": 0.4, "deployed": float("nan")}
    note = loop_sheets.one_step_sheet(summed(make_report(), outside_recording=shares)).note
    assert note.endswith("training rows: 3 % of the source policy's, 40 % of random.")
    outside = {0: {"policy": 0.9, "deployed": 0.1}, 1: {"deployed": 0.347}, 2: {"deployed": None}}
    report = replace(make_report(3), outside=outside)
    (found,) = (text for text in gp_warnings(report) if "outside" in text)
    assert found.startswith("35 % of what the GP policy visits")
    assert found.endswith("(seed 1)")
    assert f"warning: {found}" in terminal_notes(report)
    for page in (render(report), render(replace(report, fits={}))):  # without a fit to speak of, too
        assert found in page.split('class="warnings"')[1].split("</div>")[0]


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ((), "the diagnosis of each seed's recording"),
        (("recording",), "each seed's diagnosis of the recording that the loop was given"),
        (("recording", "diagnosis"), "the diagnosis that the loop was given"),
    ],
)
def test_the_page_says_whose_diagnosis_it_was(make_report: Make, given: tuple[str, ...], said: str) -> None:
    report = replace(make_report(2), named={0: ["friction"], 1: ["a spring"]}, given=given)
    text = check_policy(render(report)).text
    assert f"Found by {said}, which uses" in text
    assert ("Every seed: friction" if "diagnosis" in given else "Seed 1: a spring") in text


def test_of_rewards_of_a_tasks_own_no_start_is_solved_and_no_episode_full(make_report: Make) -> None:
    report = replace(make_report(2, ("Source", "Effects", "Target")), earns_steps=False, own_rewards=True)
    assert report.set_words == {"returns_all": "all starts"}
    (sheet,) = return_sheets(report)
    assert "Full episodes" not in sheet.columns
    assert " of 500 on the target" not in lead(report)
    assert " on the target" in lead(report)
    assert "certifies as solvable" not in render(report)


def test_the_page_of_a_proof_holds_names_as_text() -> None:
    content = {"all": {"n": 1}, "long": {"n": 0}, "seed": EVIL, "diagnosed_under": [EVIL], "git_commit": EVIL}
    sheet = Sheet(EVIL, (EVIL,), (row(EVIL),), note=EVIL)
    miss = dict.fromkeys(("trial", "stratum", "world", "truth", "said", "error", "equivalents"), EVIL)
    parts = {"groups": {}, "beside": [EVIL], "sheets": [sheet], "confusion": sheet, "misses": [miss]}
    page = check_policy(page_of("prove.html.jinja", resource("plain.css"), content=content, **parts))
    assert "img" not in page.tags
    assert page.text.count(EVIL) >= 15
    with pytest.raises(ValueError, match="style sheet"):
        page_of("prove.html.jinja", "body { } </style>")


def test_a_record_keeps_tags_and_bars_in_their_cells() -> None:
    sheet = Sheet("Sheet", ("name", "n"), (row("<b>|x\ny\x1b[31m", "< 5"),))
    assert r"| \<b>\|x y[31m | < 5 |" in section("## Sheet", sheet).splitlines()
