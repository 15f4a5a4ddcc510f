"""Text in figures: any text is drawn letter by letter, without a warning, and short enough."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from matplotlib.text import Text
from odd_names import ODD, odd_report

from gpsim.channels import Channels
from gpsim.recordings import Episode, Recording
from gpsim.reports.canvas import (
    drawable,
    legend_above,
    legend_label,
    make_literal,
    named,
    panels,
    png,
    shortened,
    style,
    svg,
)
from gpsim.reports.gp_figures import figure_calibration, figure_residual_slices
from gpsim.reports.import_figure import draw_channels
from gpsim.reports.loop_figures import figure_divergence, figure_rollouts

pytestmark = pytest.mark.pictures

TEX = st.text(st.sampled_from("$\\_^{}%&#~ a"), max_size=12)
ANY = st.one_of(TEX, st.text(max_size=30), st.text(max_size=300))


def drawn_with(text: str) -> bytes:
    with style():
        figure, axes = panels(1, 1, (4.0, 3.0))
        axes[0, 0].plot([0.0, 1.0], [1e-3, 10.0], label=legend_label(text))
        axes[0, 0].set_yscale("log")
        axes[0, 0].set_title(shortened(text))
        axes[0, 0].set_xlabel(named(text, text))
        axes[0, 0].set_ylabel(named(text, text, 18))
        axes[0, 0].annotate(shortened(text), (0.0, 1.0))
        figure.suptitle(shortened(text, 40))
        legend_above(figure, axes[0, 0])
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
@pytest.mark.parametrize(
    "make", [figure_residual_slices, figure_calibration, figure_rollouts, figure_divergence]
)
def test_figures_of_a_loop_with_odd_names_are_drawn(make: Any, make_report: Any) -> None:
    assert svg(make(odd_report(make_report))).startswith(b"<?xml")


def test_no_rate_is_dropped_from_the_legend(make_report: Any) -> None:
    legend = figure_calibration(odd_report(make_report)).axes[-1].get_legend()
    assert [text.get_text().lstrip("\u200b") for text in legend.get_texts()] == [
        "nominal",
        ODD["x_acc"],
        ODD["theta_acc"],
    ]


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
