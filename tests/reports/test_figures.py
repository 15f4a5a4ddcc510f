"""Figures: what they draw is what the data say, and they leave nothing behind in matplotlib."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import pytest

from gpsim.reports.canvas import OTHERS, POLICIES, colours, png, svg
from gpsim.reports.gp_figures import figure_calibration, figure_residual_slices
from gpsim.reports.loop_figures import (
    figure_divergence,
    figure_expert_rounds,
    figure_learning_curves,
    figure_returns,
    figure_rollouts,
)
from gpsim.reports.loop_page import render

pytestmark = pytest.mark.pictures

FIGURES = [
    figure_returns,
    figure_learning_curves,
    figure_residual_slices,
    figure_calibration,
    figure_rollouts,
    figure_divergence,
]


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("make", FIGURES)
def test_no_traces_and_no_dates(make: Any, make_report: Any) -> None:
    before = dict(matplotlib.rcParams)
    drawn = svg(make(make_report(2)))
    assert drawn.startswith(b"<?xml")
    assert b"<dc:date>" not in drawn
    assert plt.get_fignums() == []
    assert dict(matplotlib.rcParams) == before


@pytest.mark.slow
def test_a_page_of_the_same_data_has_the_same_bytes(make_report: Any) -> None:
    first = render(make_report(2))
    with matplotlib.rc_context({"font.size": 30, "axes.grid": False, "svg.hashsalt": "another"}):
        assert render(make_report(2)) == first


def test_png_has_the_same_bytes_and_no_program_name(make_report: Any) -> None:
    first, second = (png(figure_calibration(make_report())) for _ in range(2))
    assert first == second
    assert b"Software" not in first


@pytest.mark.parametrize("make", FIGURES)
def test_every_axis_is_labelled(make: Any, make_report: Any) -> None:
    figure = make(make_report())
    lowest = [axis for axis in figure.axes if axis.get_subplotspec().is_last_row()]
    assert lowest
    assert all(axis.get_xlabel() or "interval" in axis.get_xticklabels()[0].get_text() for axis in lowest)
    assert any("[" in text for axis in figure.axes for text in (axis.get_xlabel(), axis.get_ylabel()))


def test_bars_are_shares_of_episodes(make_report: Any) -> None:
    report = make_report(1, ("Source", "Target"))
    figure = figure_returns(report)
    axis = figure.axes[0]
    heights = np.array([patch.get_height() for patch in axis.patches]).reshape(2, -1)
    totals = heights.sum(axis=1)
    assert totals == pytest.approx([totals[0]] * 2)
    target = heights[0] / totals[0]  # Target is the lowest row and never fails here
    assert target[-1] == pytest.approx(1.0)


def test_learning_curve_is_the_mean_over_seeds(make_report: Any) -> None:
    report = make_report(3, ("Target",))
    axis = figure_learning_curves(report).axes[0]
    bold = next(line for line in axis.lines if line.get_label() == "Target")
    expected = np.mean([values for _, values in report.curves["Target"]], axis=0)
    np.testing.assert_allclose(bold.get_ydata(), expected)


def test_rounds_of_an_expert_are_drawn_where_there_are_any(make_report: Any) -> None:
    report = make_report(2, ("Source", "Target"))
    assert figure_expert_rounds(report) is None
    scores = [np.array([300.0, 200.0, 450.0]), np.array([320.0, 420.0, 460.0])]
    taught = replace(report, rounds={"Target": [(np.arange(3.0), score) for score in scores]})
    axis = figure_expert_rounds(taught).axes[0]
    bold = next(line for line in axis.lines if line.get_label() == "Target")
    np.testing.assert_allclose(bold.get_ydata(), [310.0, 310.0, 455.0])
    assert "rounds of expert iteration" in axis.get_xlabel()


def test_unknown_policies_take_the_rest_of_the_palette() -> None:
    found = colours(["Source", "Effects", "Source", "New"])
    assert found == {"Source": POLICIES["Source"], "Effects": OTHERS[0], "New": OTHERS[1]}
    assert len(set(colours([f"p{i}" for i in range(20)]).values())) == len(OTHERS)
    assert not set(OTHERS) & set(POLICIES.values())
