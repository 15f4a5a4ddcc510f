"""What the report calls things: by what they are in this loop, not in the thesis's."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from gpsim.evaluation.summary import summarise_seeds
from gpsim.reports.loop_figures import figure_learning_curves, figure_returns
from gpsim.reports.loop_page import render, terminal_notes
from gpsim.reports.loop_report import LoopReport, TripReport
from gpsim.reports.loop_sheets import one_step_sheet, paragraph, return_sheets, rollout_sheet, success_sheets

UNDRAWN = "gpsim.reports.loop_page.data_uri"


def without_target(make_report: Any) -> LoopReport:
    """As the stages make it: the first set is then the certified one."""
    report: LoopReport = make_report(2, ("Source", "GP-Sample"))
    summary = {**report.summary, "returns": report.summary["returns_certified"]}
    summary["share"] = {**summary["share"], "returns": summary["share"]["returns_certified"]}
    starts = {**report.starts, "returns": report.starts["returns_certified"]}
    return replace(report, summary=summary, starts=starts)


def to_goals(report: LoopReport) -> LoopReport:
    """The same returns, of a task with a goal."""
    parts = {
        part: {name: values >= 500.0 for name, values in report.returns.items()}
        for part in ("reached", "steps", "path")
    }
    trips = TripReport(**parts, behind=np.zeros(60, dtype=np.bool_))
    success = {
        key.replace("returns", "success"): {name: {"rate": 0.5} for name in report.policies}
        for key in report.starts
    }
    return replace(report, summary={**report.summary, **success}, trips=trips, earns_steps=False, held=10)


def test_without_a_target_policy_nobody_speaks_of_one(
    make_report: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(UNDRAWN, lambda figure: "data:,")
    report = without_target(make_report)
    titles = [sheet.title for sheet in return_sheets(report)]
    assert len(titles) == 2
    assert "a search over action sequences certifies" in titles[0]
    figure = figure_returns(report)
    assert figure is not None
    assert [axis.get_title("left").split(" (")[0] for axis in figure.axes] == [
        "Certified by the search",
        "All starts",
    ]
    assert "the starts that a search over action sequences certifies as solvable" in paragraph(report)
    page = render(report)
    assert "that a Target policy" not in page
    assert "Solved by a Target" not in page
    assert "that a Target policy of any seed solves" in return_sheets(make_report(2))[0].title


def test_the_starts_of_a_goal_are_certified_by_geometry(make_report: Any) -> None:
    for report in (make_report(2), without_target(make_report)):
        goals = to_goals(report)
        titles = [sheet.title for sheet in (*success_sheets(goals), *return_sheets(goals))]
        assert not [title for title in titles if "action sequences" in title]
        assert [title for title in titles if "geometry of arcs and straights certifies" in title]


def test_curves_of_a_goal_are_not_counted_in_steps(make_report: Any) -> None:
    """Whether the target was driven, as `trips` tells, or is known by its logs alone."""
    curves = {"Source": [(np.arange(1, 4) * 800.0, np.array([5.0, 7.0, 9.0]))]}
    driven = replace(to_goals(make_report()), curves=curves)
    for report in (driven, replace(driven, trips=None, returns={}, starts={})):
        figure = figure_learning_curves(report)
        assert figure is not None
        axis = figure.axes[0]
        assert axis.get_xlabel() == "decisions in training, each held for 10 steps"
        assert axis.get_ylabel() == "mean return"
        assert axis.get_ylim()[1] < 20.0
    balancing = figure_learning_curves(make_report())
    assert balancing is not None
    axis = balancing.axes[0]
    assert (axis.get_xlabel(), axis.get_ylabel()) == ("steps in training", "mean return [steps]")
    assert axis.get_ylim() == (0.0, 525.0)


def test_what_was_judged_on_reads_as_a_sentence(make_report: Any) -> None:
    report = make_report()
    for judged, said in (
        ("the training episodes: the recording holds nothing out", "1.7 % on the training episodes (NRMSE"),
        ("held-out episodes", "1.7 % on the held-out episodes (NRMSE"),
    ):
        found = paragraph(replace(report, summary={**report.summary, "judged_on": judged}))
        assert said in found
    assert "on the policy's own data and 4.4 % on data of random actions" in paragraph(report)


def test_what_was_measured_instead_of_what_was_recorded_is_said(make_report: Any) -> None:
    report, words = make_report(), "the stand-in limo, not on what was recorded; choose target=recording"
    assert "Measured on" not in paragraph(report)
    evaluations = [{**report.summary, "seed": 0, "measured_on": words}]
    summary = summarise_seeds(evaluations, {}, {}, "limo")
    told = replace(report, summary={**report.summary, "measured_on": summary["measured_on"]})
    assert paragraph(told) == f"{paragraph(report)} Measured on {words}."
    assert terminal_notes(told) == [f"measured on {words}", *terminal_notes(report)]
    assert one_step_sheet(told) == one_step_sheet(report)


@pytest.mark.parametrize(
    ("count", "said"),
    [(3.0, "3 rollouts ceased"), (1, "1 rollout ceased"), (0.6, "0.6 rollouts a seed ceased")],
)
def test_rollouts_that_ran_away_are_counted_in_whole_ones(make_report: Any, count: float, said: str) -> None:
    report = make_report()
    source = {**report.summary["rollout"]["Source"], "not_finite": count}
    summary = {**report.summary, "rollout": {**report.summary["rollout"], "Source": source}}
    assert f"Source: {said} to be finite" in rollout_sheet(replace(report, summary=summary)).note


def test_the_page_says_whose_diagnosis_it_was(make_report: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(UNDRAWN, lambda figure: "data:,")
    report = replace(make_report(2), named={0: ["friction"], 1: ["a spring"]})
    page = render(report)
    assert "Said by the diagnosis of each seed&#39;s recording, from" in page
    assert "<li>Seed 1: a spring.</li>" in page
    page = render(replace(report, given=("recording",)))
    assert "Said by each seed&#39;s diagnosis of the recording that the loop was given, from" in page
    page = render(replace(report, named={0: ["friction"]}, given=("recording", "diagnosis")))
    assert "Said by the diagnosis that the loop was given, from" in page
    assert "<li>Every seed: friction.</li>" in page


def test_of_rewards_of_a_tasks_own_no_start_is_solved_and_no_episode_full(make_report):
    report = replace(make_report(2, ("Source", "Effects", "Target")), earns_steps=False, own_rewards=True)
    assert report.set_words == {"returns_all": "all starts"}
    (sheet,) = return_sheets(report)
    assert "Full episodes" not in [
        column if isinstance(column, str) else column.text for column in sheet.columns
    ]
    said = paragraph(report)
    assert " of 500 on the target" not in said
    assert " on the target" in said
    page = render(report)
    assert "certifies as solvable" not in page
