"""A picture of an imported recording: every channel over time, with episodes, gaps and what is held out."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from gpsim.channels import FloatArray
from gpsim.recordings import Recording
from gpsim.reports.canvas import LONGEST_UNIT, panels, png, style
from gpsim.reports.quantities import shortened

STATE_COLOUR, ACTION_COLOUR, HELD_COLOUR = "#1f4e79", "#b5541c", "#e9e4d4"
LONGEST_TITLE = 100  # letters
MOST_POINTS = 4000  # a curve; more is thinned to the extremes of each pixel column


def draw_channels(recording: Recording, path: Path) -> None:
    """Write a PNG: one panel a channel, states as lines, actions as steps, held-out time shaded.

    Episodes on their own clocks are laid one after the other.
    """
    channels = [*recording.state, *recording.action]
    with style():
        figure, axes = panels(len(channels), 1, (10.0, 1.0 + 1.25 * len(channels)), sharex=True)
        starts = _starts(recording)
        for row, (channel, panel) in enumerate(zip(channels, axes[:, 0], strict=True)):
            _panel(panel, recording, starts, row)
            label = f"{shortened(channel.name)}\n[{shortened(channel.unit, LONGEST_UNIT)}]"
            panel.set_ylabel(label, rotation=0, ha="right", va="center", fontsize=9)
        apart = "" if recording.clock == "session" else ", episodes one after the other"
        axes[-1, 0].set_xlabel(f"time [s]{apart}")
        what = f"{recording.system}: {len(recording.episodes)} episode(s)"
        figure.suptitle(shortened(what, LONGEST_TITLE), fontsize=11)
        path.write_bytes(png(figure))


def _starts(recording: Recording) -> FloatArray:
    """Where each episode's clock begins in the picture [s]."""
    if recording.clock == "session":
        return np.zeros(len(recording.episodes))
    firsts, lasts = np.array([(e.t[0], e.t[-1]) for e in recording.episodes]).T
    lengths = lasts - firsts
    space = 0.01 * lengths.sum() / len(lengths) if len(lengths) > 1 else 0.0
    return np.asarray(np.concatenate([[0.0], np.cumsum(lengths + space)[:-1]]) - firsts, dtype=np.float64)


def _panel(panel: Axes, recording: Recording, starts: FloatArray, row: int) -> None:
    states, held = len(recording.state), recording.held_out
    low, high = np.inf, -np.inf
    for index, (episode, start) in enumerate(zip(recording.episodes, starts, strict=True)):
        t = episode.t + start
        first, last = float(episode.t[0]), float(episode.t[-1])
        if held is not None and held.episodes_from is not None:
            first = first if index >= held.episodes_from else last
        elif held is not None and held.time_from is not None:
            first = min(max(first, held.time_from), last)
        if held is not None and first < last:
            panel.axvspan(first + start, last + start, color=HELD_COLOUR, linewidth=0, zorder=0)
        if index and len(recording.episodes) <= 60:
            panel.axvline(float(t[0]), color="#999999", linewidth=0.5, zorder=0.5)
        if row < states:
            values = episode.states[:, row]
            x, y = _thinned(t, values)
            if recording.state.wraps[row]:  # interrupted there, so that no line crosses the panel
                jumps = np.flatnonzero(np.abs(np.diff(y)) > np.pi) + 1
                x, y = np.insert(x, jumps, x[jumps]), np.insert(y, jumps, np.nan)
            panel.plot(x, y, color=STATE_COLOUR, linewidth=0.8)
        else:
            values = episode.actions[:, row - states]
            steps = _thinned(np.repeat(t, 2)[1:-1], np.repeat(values, 2))
            panel.plot(*steps, color=ACTION_COLOUR, linewidth=0.8)
        if len(values):
            low, high = min(low, float(values.min())), max(high, float(values.max()))
    margin = 0.08 * (high - low) or 0.1 * (abs(high) or 1.0)
    panel.set_ylim(low - margin, high + margin)
    panel.margins(x=0.005)
    panel.tick_params(labelsize=8)


def _thinned(t: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Least and greatest value of each of many equal runs of samples: looks the same, draws faster."""
    if len(t) <= MOST_POINTS:
        return t, values
    size = -(-len(t) // (MOST_POINTS // 2))
    runs = len(t) // size
    block = values[: runs * size].reshape(runs, size)
    picks = np.stack([block.argmin(axis=1), block.argmax(axis=1)], axis=1)
    rows = np.sort(picks, axis=1) + size * np.arange(runs)[:, None]
    chosen = np.unique(np.concatenate([rows.ravel(), [len(t) - 1]]))
    return t[chosen], values[chosen]
