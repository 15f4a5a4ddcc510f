"""A bare CSV or Parquet table as a recording: what its columns are is said by whom it is compared with."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from gpsim.channels import Channels
from gpsim.errors import UsageError
from gpsim.recordings.files import read_csv
from gpsim.recordings.recording import Episode, Recording


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

    Every fault is a UsageError that names file, episode, row and column.
    """
    table = _read(path)
    held = Channels(tuple(c for c in state if c.name in table.columns or c.name not in optional))
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
    return Recording(system, held, action, episodes, float(np.median(steps)), parameters, integrator)


def _read(path: Path) -> pd.DataFrame:
    try:
        return pd.read_parquet(path) if path.suffix == ".parquet" else read_csv(path)
    except Exception as error:  # pandas and pyarrow raise a dozen kinds on a damaged file
        raise UsageError(f"{path}: cannot be read: {' '.join(str(error).split())[:160]}") from error


def _check_columns(path: Path, table: pd.DataFrame, needed: Sequence[str], system: str) -> None:
    missing = [name for name in needed if name not in table.columns]
    if missing:
        raise UsageError(
            f"{path}: column(s) {', '.join(missing)} missing; {system} needs {', '.join(needed)}"
        )
    dates = [name for name in needed if table[name].dtype.kind in "mM"]
    if dates:
        raise UsageError(f"{path}: column(s) {', '.join(dates)} hold dates; write numbers (t in seconds)")


def _episode(path: Path, name: str, rows: pd.DataFrame, needed: Sequence[str], states: int) -> Episode:
    """One episode: the last row's action never acted, and may be empty."""
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
    t = values[:, 0]
    if (np.diff(t) <= 0).any():
        raise UsageError(f"{path}: episode {name}: t does not increase; sort the rows")
    return Episode(name, t, values[:, 1 : 1 + states], values[:-1, 1 + states :])
