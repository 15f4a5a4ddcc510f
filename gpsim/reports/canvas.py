"""What all figures share: style, panels, colours, and names shown letter by letter.

Matplotlib reads what stands between two `$` as a formula, drops legend labels that begin with `_`, and warns of letters
that its font lacks. Names are data: none of this may happen to them.
"""

from __future__ import annotations

import base64
import io
import unicodedata
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any

import matplotlib
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties, findfont
from matplotlib.ft2font import FT2Font
from matplotlib.text import Text

from gpsim.reports.pages import page_of as page_of
from gpsim.reports.pages import resource as resource
from gpsim.reports.quantities import LABEL, LONGEST, shortened

POLICIES = {
    "Source": "#D55E00",
    "Domain randomisation": "#E69F00",
    "GP-Mean": "#56B4E9",
    "GP-Sample": "#0072B2",
    "Target": "#333333",
}
"""Policies, and the simulators of the same names."""
OTHERS = ("#009E73", "#CC79A7", "#882255", "#999933", "#44AA99", "#AA4499", "#6D4C41")
"""For names that are not in POLICIES, in order of appearance; used again from the start when there are more."""
SEGMENTS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#882255", "#999933")
"""Parts of one bar that stand side by side, the largest first."""
SLIGHT = "#B8BEC7"  # of such a bar: what is small and no claim
INK, FAINT, GRID, BAND, GP = "#1B1F24", "#6B7280", "#E5E7EB", "#9CC9E8", "#0072B2"

FAMILY = "DejaVu Sans"  # comes with matplotlib: the same on every machine
UNKNOWN = "\N{REPLACEMENT CHARACTER}"
LONGEST_UNIT = 12  # letters of a unit beside an axis
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


def colours(names: Iterable[str]) -> dict[str, str]:
    """A colour for every name; names that are not known take the rest of the palette in order of appearance."""
    unique = list(dict.fromkeys(names))
    others = [name for name in unique if name not in POLICIES]
    return {n: POLICIES[n] if n in POLICIES else OTHERS[others.index(n) % len(OTHERS)] for n in unique}


def named(name: str, unit: str = "", most: int = LONGEST) -> str:
    """`name [unit]` for an axis, both shortened; the name alone where there is no unit."""
    return f"{shortened(name, most)} [{shortened(unit, LONGEST_UNIT)}]" if unit else shortened(name, most)


def beside(name: str, unit: str) -> str:
    """The same beside an axis among others, which is short: in two lines where it is longer than that."""
    whole = named(name, unit, LABEL)
    return whole if len(whole) <= LABEL else "\n[".join(whole.rsplit(" [", 1))


def legend_label(name: str, most: int = LONGEST) -> str:
    """A name as a legend's label: of one that begins with `_` matplotlib would show nothing."""
    label = shortened(name, most)
    return f"\N{ZERO WIDTH SPACE}{label}" if label.startswith("_") else label


def drawable(text: str) -> str:
    """What the font can draw of a text: letters that it lacks are replaced, marks without a shape left out."""
    known = _letters() | {ord("\n")}
    kept = (c for c in text if ord(c) in known or unicodedata.category(c) != "Cf")
    return "".join(c if ord(c) in known else UNKNOWN for c in kept)


def make_literal(figure: Figure) -> None:
    """Every text of a figure shows its own letters; numbers at ticks are left as their formatter writes them."""
    for text in _texts(figure):
        text.set_parse_math(False)
        text.set_text(drawable(text.get_text()))


def _texts(artist: Artist) -> Iterator[Text]:
    # Of an axis not its ticks, which it would make to be asked for them.
    inner = [artist.label, artist.get_offset_text()] if isinstance(artist, Axis) else artist.get_children()
    for child in inner:
        if isinstance(child, Text):
            yield child
        yield from _texts(child)


@cache
def _letters() -> frozenset[int]:
    """Code points that the font has in all weights that are used."""
    weights = (FontProperties(family=FAMILY, weight=weight) for weight in ("normal", "bold"))
    return frozenset.intersection(*(frozenset(FT2Font(findfont(w)).get_charmap()) for w in weights))


@contextmanager
def style() -> Iterator[None]:
    """Matplotlib's defaults and ours on top, whatever the caller's own settings are."""
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
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
    return _saved(figure, format="svg", metadata={"Date": None, "Creator": None})


def png(figure: Figure, dpi: float = 110.0) -> bytes:
    """The figure as PNG without dates or program names."""
    return _saved(figure, format="png", dpi=dpi, metadata={"Software": None})


def _saved(figure: Figure, **how: Any) -> bytes:
    stream = io.BytesIO()
    make_literal(figure)
    with style():
        figure.savefig(stream, **how)
    return stream.getvalue()


def data_uri(figure: Figure) -> str:
    """The figure as the source of an image; an image keeps the ids of several SVGs on a page apart."""
    return "data:image/svg+xml;base64," + base64.b64encode(svg(figure)).decode("ascii")
