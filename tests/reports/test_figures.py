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
from matplotlib.text import Text
from odd_names import ODD, odd_report

from gpsim.channels import Channels
from gpsim.recordings import Episode, Recording
from gpsim.reports import canvas
from gpsim.reports.canvas import OTHERS, POLICIES, colours, drawable, make_literal, panels, png, style, svg
from gpsim.reports.gp_figures import figure_residual_slices
from gpsim.reports.import_figure import draw_channels
from gpsim.reports.loop_figures import figure_learning_curves, figure_returns, figure_rollouts
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


def test_png_has_the_same_bytes_and_no_program_name(make_report: Any) -> None:
    first, second = (png(figure_returns(make_report())) for _ in range(2))
    assert first == second
    assert b"Software" not in first


@pytest.mark.parametrize("make", FIGURES)
def test_every_axis_is_labelled(make: Any, make_report: Any) -> None:
    figure = make(make_report())
    lowest = [axis for axis in figure.axes if axis.get_subplotspec().is_last_row()]
    assert lowest
    assert all(axis.get_xlabel() for axis in lowest)
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


def test_unknown_policies_take_the_rest_of_the_palette() -> None:
    found = colours(["Source", "Effects", "Source", "New"])
    assert found == {"Source": POLICIES["Source"], "Effects": OTHERS[0], "New": OTHERS[1]}
    assert len(set(colours([f"p{i}" for i in range(20)]).values())) == len(OTHERS)
    assert not set(OTHERS) & set(POLICIES.values())


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


@given(text=st.text(st.characters(max_codepoint=0x24F, exclude_categories=["Cc", "Cf", "Cn"])))
def test_what_the_font_has_is_shown_as_it_is(text):
    assert drawable(text) == text


def test_a_formula_shows_its_dollars():
    figure, axes = panels(1, 1, (4.0, 3.0))
    axes[0, 0].set_title("$x$")
    figure.canvas.draw()
    as_formula = axes[0, 0].title.get_window_extent().width
    make_literal(figure)
    assert axes[0, 0].title.get_window_extent().width > 2 * as_formula
    assert axes[0, 0].title.get_text() == "$x$"


def test_powers_at_a_logarithmic_axis_stay_powers():
    with style():
        figure, axes = panels(1, 1, (4.0, 3.0))
        axes[0, 0].semilogy([0.0, 1.0], [1e-3, 10.0])
    make_literal(figure)
    figure.canvas.draw()
    labels = axes[0, 0].get_yticklabels()
    assert any("10^{-3}" in label.get_text() and label.get_parse_math() for label in labels)


@given(name=st.text(max_size=250), most=st.integers(1, 60))
def test_a_shortened_name_keeps_its_ends(name, most):
    short = shortened(name, most)
    assert len(short) <= most
    if len(name) <= most:
        assert short == name
    else:
        begin, end = short.split("…", 1) if short.count("…") == 1 else (short[:0], short[:0])
        assert name.startswith(begin)
        assert name.endswith(end)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("make", [figure_residual_slices, figure_rollouts])
def test_figures_of_a_loop_with_odd_names_are_drawn(make: Any, make_report: Any) -> None:
    assert svg(make(odd_report(make_report))).startswith(b"<?xml")


def test_rollouts_show_what_is_no_velocity_whatever_it_is_called(make_report: Any) -> None:
    report = odd_report(make_report)
    figure = figure_rollouts(report)
    assert len(figure.axes) == 2 * 3  # two channels, three starts
    report = replace(report, states=("a_dot", "b", "c", "d"), velocities=("b",))
    assert [axis.get_ylabel() for axis in figure_rollouts(report).axes[::3]] == ["a_dot", "c", "d"]


@pytest.mark.filterwarnings("error")
def test_every_text_but_numbers_is_literal(make_report: Any) -> None:
    figure = figure_residual_slices(odd_report(make_report))
    make_literal(figure)
    axis = figure.axes[0]
    texts: list[Text] = [axis.title, axis.xaxis.label, axis.yaxis.label, *axis.texts]
    texts += figure.legends[0].get_texts()
    assert not any(text.get_parse_math() for text in texts)


@pytest.mark.filterwarnings("error")
def test_a_recording_of_odd_names_is_drawn(tmp_path: Path) -> None:
    names = list(ODD.values())
    episode = Episode("$e_{$ 位", np.arange(3.0), np.zeros((3, len(names))), np.zeros((2, 1)))
    units = Channels.of(dict.fromkeys(names, "$m^2$ " * 9)), Channels.of({"_F $": ""})
    draw_channels(Recording("$s_{", *units, (episode,), 1.0), tmp_path / "channels.png")
    assert (tmp_path / "channels.png").read_bytes().startswith(b"\x89PNG")
