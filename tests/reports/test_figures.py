"""Figures: what they draw is what the data say, every text letter by letter, and they leave nothing behind."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from odd_names import ODD, odd_report

from gpsim.channels import Channels
from gpsim.recordings import Episode, Recording
from gpsim.reports import canvas
from gpsim.reports.canvas import make_literal, panels, png, style, svg
from gpsim.reports.import_figure import draw_channels
from gpsim.reports.loop_figures import (
    figure_learning_curves,
    figure_residual_slices,
    figure_returns,
    figure_rollouts,
)
from gpsim.reports.loop_page import render
from gpsim.reports.quantities import shortened

pytestmark = pytest.mark.pictures

FIGURES = [figure_returns, figure_learning_curves, figure_residual_slices, figure_rollouts]


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


TEX = st.text(st.sampled_from("$\\_^{}%&#~ a"), max_size=12)
ANY = st.one_of(TEX, st.text(max_size=30), st.text(max_size=300))


def drawn_with(text: str) -> bytes:
    with style():
        figure, axes = panels(1, 1, (4.0, 3.0))
        axis = axes[0, 0]
        axis.plot([0.0, 1.0], [1e-3, 10.0], label=canvas.legend_label(text))
        axis.set(yscale="log", title=shortened(text), xlabel=canvas.named(text, text))
        axis.set_ylabel(canvas.named(text, text, 18))
        axis.annotate(shortened(text), (0.0, 1.0))
        figure.suptitle(shortened(text, 40))
        canvas.legend_above(figure, axis)
    return png(figure, dpi=30)


@pytest.mark.slow
@pytest.mark.filterwarnings("error")
@settings(deadline=None, max_examples=12)
@given(text=ANY)
@example(text=r"$\frac{$")
@example(text="_hidden")
@example(text="位😀\u200d\x00\ud800\n")
def test_any_text_is_drawn(text):
    assert drawn_with(text).startswith(b"\x89PNG")


def test_a_formula_shows_its_dollars():
    figure, axes = panels(1, 1, (4.0, 3.0))
    axes[0, 0].set_title("$x$")
    figure.canvas.draw()
    as_formula = axes[0, 0].title.get_window_extent().width
    make_literal(figure)
    assert axes[0, 0].title.get_window_extent().width > 2 * as_formula
    assert axes[0, 0].title.get_text() == "$x$"


def test_rollouts_show_what_is_no_velocity_whatever_it_is_called(make_report: Any) -> None:
    report = odd_report(make_report)
    figure = figure_rollouts(report)
    assert len(figure.axes) == 2 * 3  # two channels, three starts
    report = replace(report, states=("a_dot", "b", "c", "d"), velocities=("b",))
    assert [axis.get_ylabel() for axis in figure_rollouts(report).axes[::3]] == ["a_dot", "c", "d"]


@pytest.mark.filterwarnings("error")
def test_a_recording_of_odd_names_is_drawn(tmp_path: Path) -> None:
    names = list(ODD.values())
    episode = Episode("$e_{$ 位", np.arange(3.0), np.zeros((3, len(names))), np.zeros((2, 1)))
    units = Channels.of(dict.fromkeys(names, "$m^2$ " * 9)), Channels.of({"_F $": ""})
    draw_channels(Recording("$s_{", *units, (episode,), 1.0), tmp_path / "channels.png")
    assert (tmp_path / "channels.png").read_bytes().startswith(b"\x89PNG")
