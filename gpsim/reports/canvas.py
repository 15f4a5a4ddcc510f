"""How every figure looks, and figures as text that a page can hold: same data, same bytes."""

from __future__ import annotations

import base64
import io
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from gpsim.reports.lettering import FAMILY, make_literal
from gpsim.reports.palette import FAINT, GRID, INK

STYLE: dict[Any, Any] = {
    "font.family": FAMILY,
    "font.size": 10.5,
    "axes.titlesize": 11,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelsize": 10.5,
    "axes.edgecolor": FAINT,
    "axes.labelcolor": INK,
    "axes.titlecolor": INK,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.unicode_minus": True,
    "grid.color": GRID,
    "grid.linewidth": 0.8,
    "xtick.color": FAINT,
    "ytick.color": FAINT,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "text.color": INK,
    "legend.frameon": False,
    "lines.linewidth": 1.8,
    "lines.solid_capstyle": "round",
    "figure.facecolor": "white",
    "savefig.facecolor": "white",
    "svg.hashsalt": "gpsim",
    "svg.fonttype": "path",
    "path.simplify": True,
}


@contextmanager
def defaults() -> Iterator[None]:
    """Matplotlib's defaults, whatever the caller's own settings are."""
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        yield


@contextmanager
def style() -> Iterator[None]:
    """Matplotlib's defaults and ours on top, whatever the caller's own settings are."""
    with defaults():
        matplotlib.rcParams.update(STYLE)
        yield


def panels(rows: int, columns: int, size: tuple[float, float], **kwargs: object) -> tuple[Figure, np.ndarray]:
    """A figure of (width, height) inches and its axes, always (rows, columns)."""
    figure = Figure(figsize=size, layout="constrained")
    FigureCanvasAgg(figure)
    axes: np.ndarray = figure.subplots(rows, columns, squeeze=False, **kwargs)  # type: ignore[call-overload]
    return figure, axes


def legend_above(figure: Figure, axes: Axes, columns: int = 6, markerscale: float = 1.0) -> None:
    """One legend for the whole figure, of the labels in `axes`."""
    handles, labels = axes.get_legend_handles_labels()
    if handles:
        figure.legend(handles, labels, loc="outside upper left", ncols=columns, markerscale=markerscale)


def svg(figure: Figure) -> bytes:
    """The figure as SVG without dates or program names."""
    stream = io.BytesIO()
    make_literal(figure)
    with style():
        figure.savefig(stream, format="svg", metadata={"Date": None, "Creator": None})
    return stream.getvalue()


def png(figure: Figure, dpi: float = 110.0) -> bytes:
    """The figure as PNG without dates or program names."""
    stream = io.BytesIO()
    make_literal(figure)
    with style():
        figure.savefig(stream, format="png", dpi=dpi, metadata={"Software": None})
    return stream.getvalue()


def data_uri(figure: Figure) -> str:
    """The figure as the source of an image; an image keeps the ids of several SVGs on a page apart."""
    return "data:image/svg+xml;base64," + base64.b64encode(svg(figure)).decode("ascii")
