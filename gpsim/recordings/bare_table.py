"""A bare CSV or Parquet table as a recording: what its columns are is said by whom it is compared with."""

from __future__ import annotations

import difflib
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from gpsim.channels import Channels, FloatArray
from gpsim.errors import UsageError
from gpsim.recordings.guessing_time import UNITS, dated, likely_unit
from gpsim.recordings.recording import Episode, Recording
from gpsim.recordings.table_files import check_size, read_frame
from gpsim.recordings.values import check_name

ALIKE = 0.75  # of 1: names so much alike are a slip of the pen
MOVING = ("m", "rad", "deg", "m/s", "rad/s", "deg/s")  # units of what is looked at many times a second


def read_bare_table(
    path: Path,
    system: str,
    state: Channels,
    action: Channels,
    parameters: Mapping[str, float],
    *,
    optional: Collection[str] = (),
    integrator: str = "euler",
) -> Recording:
    """Columns t [s], `state`, `action` and, if there are several, episode; states in `optional` may be absent.

    So may all actions, of something that nobody commands.

    Every fault is a UsageError that names file, episode, row and column.
    """
    table = read_frame(path)
    return recording_of(
        table, path, system, state, action, parameters, optional=optional, integrator=integrator
    )


def recording_of(
    table: pd.DataFrame,
    path: Path | str,
    system: str,
    state: Channels,
    action: Channels,
    parameters: Mapping[str, float],
    *,
    optional: Collection[str] = (),
    integrator: str = "euler",
    dt: float | None = None,
) -> Recording:
    """The same of a table that is there already; path: what messages call it.

    dt: the usual step [s] where it is known, which says that t is in seconds; else the median step.
    """
    held = Channels(tuple(c for c in state if c.name in table.columns or c.name not in optional))
    held = held if len(held) else state
    _check_spelling(path, table, (*state.names, *action.names))
    action = action if set(action.names) & set(table.columns) else Channels(())
    needed = ("t", *held.names, *action.names)
    _check_columns(path, table, needed, system)
    if "episode" not in table.columns:
        table = table.assign(episode="0")
    unnamed = np.flatnonzero(table["episode"].isna() | (table["episode"] == ""))
    if unnamed.size:
        raise UsageError(f"{path}: row {unnamed[0]}: no episode; give every row its episode's name")
    episodes = tuple(
        _episode(path, str(name), rows, needed, len(held))
        for name, rows in table.groupby("episode", sort=False)
    )
    steps = np.concatenate([np.zeros(0), *(np.diff(e.t) for e in episodes)])
    if not len(steps):
        raise UsageError(f"{path}: too short: no episode has two rows")
    usual = float(np.median(steps))
    if dt is None:
        _check_seconds(path, np.concatenate([e.t for e in episodes]), usual, held + action)
    return Recording(system, held, action, episodes, usual if dt is None else dt, parameters, integrator)


def _check_seconds(path: Path | str, t: FloatArray, step: float, channels: Channels) -> None:
    """Refuse a clock that counts something else than seconds: a date says so, or what moves and is seen so seldom."""
    unit = likely_unit(t, step)
    if unit is None or not (dated(t) or any(channel.unit in MOVING for channel in channels)):
        return
    count = str(round(1 / UNITS[unit]))
    seconds = f"if it is in seconds, say so: dt={step:g}"
    if isinstance(path, Path):
        seconds = f"if it is in seconds, say so in a recording.yaml beside it (dt: {step:g})"
        count = f"{count}, or `gpsim import` the table with time.scale={UNITS[unit]:.0e}"
    raise UsageError(
        f"{path}: t looks like {unit}: its usual step is {step:g}, and t is read in seconds; divide the column by "
        f"{count}; {seconds}"
    )


def _check_spelling(path: Path | str, table: pd.DataFrame, names: Sequence[str]) -> None:
    """A column that is nearly called as a channel that is absent would be passed over without a word."""
    columns = [str(column) for column in table.columns]
    others = [column for column in columns if column not in ("t", "episode", *names)]
    for name in names:
        near = alike(name, others)
        if name not in columns and near:
            raise UsageError(
                f"{path}: column(s) {name} missing; '{near}' is like it: call it {name}, or otherwise"
            )


def alike(name: str, columns: Sequence[str]) -> str | None:
    """The column that is nearly called so, a slip of the pen; None where none is."""
    lower = {column.lower(): column for column in columns}
    near = difflib.get_close_matches(name.lower(), lower, n=1, cutoff=ALIKE)
    return lower[near[0]] if near else None


def _check_columns(path: Path | str, table: pd.DataFrame, needed: Sequence[str], system: str) -> None:
    missing = [name for name in needed if name not in table.columns]
    if missing:
        raise UsageError(
            f"{path}: column(s) {', '.join(missing)} missing; {system} needs {', '.join(needed)}"
        )
    dates = [name for name in needed if table[name].dtype.kind in "mM"]
    if dates:
        raise UsageError(f"{path}: column(s) {', '.join(dates)} hold dates; write numbers (t in seconds)")


def _episode(path: Path | str, name: str, rows: pd.DataFrame, needed: Sequence[str], states: int) -> Episode:
    """One episode: the last row's action never acted, and may be empty."""
    check_name(name, f"{path}: column episode")
    try:
        values = rows[list(needed)].to_numpy(dtype=np.float64)
    except ValueError as error:
        raise UsageError(f"{path}: episode {name}: a value is not a number: {error}") from error
    used = np.isfinite(values)
    used[-1, 1 + states :] = True
    bad = np.argwhere(~used)
    if bad.size:
        row, column = bad[0]
        raise UsageError(
            f"{path}: episode {name}, row {row}: {needed[column]} is not a finite number; repair it"
        )
    check_size(values, needed, f"{path}: episode {name}", range(len(values)))
    t = values[:, 0]
    back = np.flatnonzero(np.diff(t) <= 0)
    if back.size:
        row = int(back[0]) + 1
        raise UsageError(
            f"{path}: episode {name}: t does not increase at row {row} ({t[row - 1]:g}, then {t[row]:g}); sort the "
            "rows, or give every run an episode of its own"
        )
    return Episode(name, t, values[:, 1 : 1 + states], values[:-1, 1 + states :])
