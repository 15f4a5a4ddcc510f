"""Where equal axes of a figure stand: as by Matplotlib's constrained layout, which measures every tick ten times."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.layout_engine import LayoutEngine
from matplotlib.text import Text

from gpsim.channels import FloatArray

PAD, APART, BESIDE = 3.0, 5.0, 4.0  # points: around everything, between axes, between ticks and their label
PASSES = 2  # ticks change with the size of the axes


class Panels(LayoutEngine):
    """Axes in rows and columns, as large as what stands around them allows; a legend above or below all of them."""

    _adjust_compatible, _colorbar_gridspec = False, False

    def execute(self, fig: Any) -> None:
        """Give the axes of `fig` their places, and their labels one line a row or column."""
        canvas: Any = FigureCanvasAgg(fig)
        point, renderer = fig.dpi / 72.0, canvas.get_renderer()
        whole = np.array(fig.bbox.size)
        low, high = np.full(2, PAD * point), whole - PAD * point
        for box in (legend.get_window_extent(renderer) for legend in fig.legends):
            if box.y0 + box.y1 < whole[1]:
                low[1] = box.y1 + PAD * point
            else:
                high[1] = box.y0 - PAD * point
        cells = {axes: _cell(axes) for axes in fig.axes}
        for _ in range(PASSES):
            around = {axes: _around(axes, renderer, BESIDE * point) for axes in cells}
            begins, sizes, ticks = zip(
                *(_line(cells, around, side, low[side], high[side], APART * point) for side in (0, 1)),
                strict=True,
            )
            for axes, (column, row) in cells.items():
                begin, size = np.array([begins[0][column], begins[1][row]]), np.array(sizes)
                axes.set_position((*(begin / whole), *(size / whole)))
                axes.yaxis.set_label_coords(-(ticks[0][column] + BESIDE * point) / sizes[0], 0.5)
                axes.xaxis.set_label_coords(0.5, -(ticks[1][row] + BESIDE * point) / sizes[1])


def _cell(axes: Axes) -> tuple[int, int]:
    """Its column and row, counted from the lower left."""
    place = axes.get_subplotspec()
    assert place is not None
    return place.colspan.start, place.get_gridspec().nrows - place.rowspan.stop


def _around(axes: Axes, renderer: Any, beside: float) -> FloatArray:
    """(3, 2) pixels: what the ticks take left of and below it, what everything there takes, and right of and above."""
    inner, ticks = np.array(axes.bbox.extents).reshape(2, 2), np.zeros(2)
    taken = np.zeros((2, 2))
    boxes = [
        c.get_window_extent(renderer) for c in axes.get_children() if isinstance(c, Text) and c.get_text()
    ]
    for side, axis in enumerate((axes.yaxis, axes.xaxis) if axes.axison else ()):
        axis.set_label_coords(0.5, 0.5)  # where it takes nothing
        if (box := axis.get_tightbbox(renderer, for_layout_only=True)) is not None:
            boxes.append(box)
            ticks[side] = max(inner[0, side] - box.extents[side], 0.0)
        if axis.label.get_text():
            taken[0, side] = ticks[side] + beside + axis.label.get_window_extent(renderer).size[side]
    for box in boxes:
        outer = np.array(box.extents).reshape(2, 2)
        taken = np.maximum(taken, (inner - outer) * [[1.0], [-1.0]])
    return np.vstack([ticks, taken])


def _line(
    cells: dict[Axes, tuple[int, int]],
    around: dict[Axes, FloatArray],
    side: int,
    low: float,
    high: float,
    apart: float,
) -> tuple[FloatArray, float, FloatArray]:
    """Of the columns (0) or the rows (1): where the axes begin, their size, and what the ticks take before them."""
    count = 1 + max(cell[side] for cell in cells.values())
    most = [
        np.max([found[:, side] for axes, found in around.items() if cells[axes][side] == k], axis=0)
        for k in range(count)
    ]
    ticks, before, after = np.array(most).T
    size = (high - low - before.sum() - after.sum() - apart * (count - 1)) / count
    begins = low + np.cumsum(before) + np.concatenate([[0.0], np.cumsum(after + size + apart)[:-1]])
    return begins, size, ticks
