"""Recordings on disk: recording.csv or recording.parquet beside recording.yaml (the format is a contract)."""

from __future__ import annotations

import difflib
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
import yaml

from gpsim.channels import Channels, FloatArray
from gpsim.errors import UsageError
from gpsim.recordings.likeness import UNITS, dated, likely_unit
from gpsim.recordings.poses import numeric_poses
from gpsim.recordings.recording import Clock, HeldOut, Recording, Velocities
from gpsim.recordings.table_files import columns_of, episodes_of, read_exactly, read_frame
from gpsim.recordings.values import Columns, Number, Numbers, Sound, Text, check_channels, checked, one_line
from gpsim.recordings.yaml_data import read_yaml

if TYPE_CHECKING:
    import pandas as pd

TableFormat = Literal["csv", "parquet"]
META_NAME = "recording.yaml"
ALIKE = 0.75  # of 1: names so much alike are a slip of the pen
MOVING = ("m", "rad", "deg", "m/s", "rad/s", "deg/s")  # units of what is looked at many times a second


def write_recording(recording: Recording, folder: Path, table: TableFormat = "parquet") -> None:
    """Write recording.<table> and recording.yaml into an existing folder."""
    frame = to_frame(recording)
    if table == "csv":
        frame.to_csv(folder / "recording.csv", index=False, lineterminator="\n")
    else:
        frame.to_parquet(folder / "recording.parquet", index=False)
    text = yaml.safe_dump(_metadata(recording), sort_keys=False, allow_unicode=True)
    (folder / META_NAME).write_text(text, encoding="utf-8")


def to_frame(recording: Recording) -> pd.DataFrame:
    """One row a sample: episode, t, state channels, action channels (NaN in an episode's last row)."""
    import pandas as pd  # here: half a second that who reads need not wait for

    frames = []
    for episode in recording.episodes:
        columns: dict[str, Any] = {"episode": episode.name, "t": episode.t}
        columns |= {name: episode.states[:, i] for i, name in enumerate(recording.state.names)}
        actions = np.vstack([episode.actions, np.full((1, len(recording.action)), np.nan)])
        columns |= {name: actions[:, i] for i, name in enumerate(recording.action.names)}
        frames.append(pd.DataFrame(columns))
    return pd.concat(frames, ignore_index=True)


def _metadata(recording: Recording) -> dict[str, Any]:
    meta: dict[str, Any] = {
        "system": recording.system,
        **({"model": recording.model} if recording.model is not None else {}),
        "parameters": {k: float(v) for k, v in recording.parameters.items()},
        "integrator": recording.integrator,
        "dt": float(recording.dt),
        "state": recording.state.units,
        "action": recording.action.units,
        "clock": recording.clock,
    }
    wraps = [channel.name for channel in recording.state if channel.wraps]
    if wraps:
        meta["wraps"] = wraps
    if recording.velocities is not None:
        meta["velocities"] = recording.velocities
    if recording.noise:
        meta["noise"] = {k: float(v) for k, v in recording.noise.items()}
    if recording.held_out is not None:
        meta["held_out"] = {k: v for k, v in vars(recording.held_out).items() if v is not None}
    if recording.provenance:
        meta["provenance"] = dict(recording.provenance)
    return meta


def _units(raw: object) -> dict[str, str]:
    if not isinstance(raw, Mapping):
        raise ValueError(f"expected channels with units, as {{x: m, x_dot: m/s}}, got {raw!r}")
    return {str(name): str(unit) for name, unit in raw.items()}


def _list(raw: object) -> list[Any]:
    if not isinstance(raw, list):
        raise ValueError(f"expected a list of channels, got {raw!r}")
    return raw


def _table(raw: object) -> Mapping[str, Any]:
    if not isinstance(raw, Mapping):
        raise ValueError(f"expected keys and values, got {one_line(repr(raw), 60)}")
    return raw


def _model(raw: object) -> str:
    if not (isinstance(raw, str) and raw):
        raise ValueError(f"expected the file of a MuJoCo model, as robot.xml, got {raw!r}")
    return raw


@dataclass(frozen=True)
class _Metadata:
    """What recording.yaml says."""

    system: Text
    dt: Number
    state: Annotated[dict[str, str], Sound(_units)]
    action: Annotated[dict[str, str], Sound(_units)] = field(default_factory=dict)
    parameters: Numbers = field(default_factory=dict)
    integrator: Text = "euler"
    velocities: Velocities | None = None
    clock: Clock = "episode"
    noise: Numbers = field(default_factory=dict)
    held_out: HeldOut | None = None
    wraps: Annotated[Sequence[str], Sound(_list)] = ()
    provenance: Annotated[Mapping[str, Any], Sound(_table)] = field(default_factory=dict)
    model: Annotated[str, Sound(_model)] | None = None

    def __post_init__(self) -> None:
        for what, names, known in (
            ("wraps", self.wraps, tuple(self.state)),
            ("noise", self.noise, (*self.state, *self.action)),
        ):
            for name in names:
                if name not in known:
                    raise ValueError(f"{what}: '{name}' is not one of {', '.join(known)}")
        for name, deviation in self.noise.items():
            if deviation < 0:
                raise ValueError(f"noise.{name}: a standard deviation is no less than 0, got {deviation:g}")


def read_recording(path: Path) -> Recording:
    """Read a recording folder; every fault ends in a UsageError that says what, where and what to do."""
    folder = path if path.is_dir() else path.parent
    meta = _read_metadata(folder / META_NAME)
    columns, table = _read_table(folder)
    state, action = Channels.of(meta.state, wraps=meta.wraps), Channels.of(meta.action)
    missing = [name for name in ("episode", "t", *state.names, *action.names) if name not in columns]
    if missing:
        raise UsageError(f"{table}: column(s) {', '.join(missing)} missing; {META_NAME} names them")
    same = (
        "system",
        "dt",
        "parameters",
        "integrator",
        "velocities",
        "clock",
        "noise",
        "held_out",
        "provenance",
    )
    poses = numeric_poses(columns, (*state.names, *action.names))
    return Recording(
        state=state,
        action=action,
        poses=poses,
        episodes=episodes_of(columns, str(table), state, action, poses),
        model=meta.model,
        **{name: getattr(meta, name) for name in same},
    )


def _read_metadata(path: Path) -> _Metadata:
    if not path.is_file():
        raise UsageError(
            f"{path.parent}: no {META_NAME}; a recording is a folder with {META_NAME} and recording.csv"
        )
    raw = read_yaml(path)
    if not isinstance(raw, dict):
        raise UsageError(f"{path}: expected a mapping with system, dt, state and action")
    lacking = [key for key in ("system", "dt", "state") if raw.get(key) is None]
    if lacking:
        raise UsageError(f"{path}: {', '.join(lacking)} missing")
    raw["held_out"] = _held_out(raw.get("held_out") or {}, f"{path}: held_out")
    meta = checked(_Metadata, raw, str(path), top=True)
    check_channels(meta.state, f"{path}: state")
    check_channels(meta.action, f"{path}: action")
    return meta


def _held_out(raw: object, where: str) -> HeldOut | None:
    rule = checked(HeldOut, raw, where)
    if isinstance(raw, Mapping) and len(raw) > 1:
        raise UsageError(f"{where}: episodes_from, time_from or share, not two of them")
    return rule if raw else None


def _read_table(folder: Path) -> tuple[Columns, Path]:
    parquet, csv = folder / "recording.parquet", folder / "recording.csv"
    table = parquet if parquet.is_file() else csv
    if not table.is_file():
        raise UsageError(f"{folder}: neither recording.csv nor recording.parquet")
    columns = read_exactly(table)
    if not any(map(len, columns.values())):
        raise UsageError(f"{table}: no rows")
    return columns, table


def read_bare_table(
    path: Path,
    system: str,
    state: Channels,
    action: Channels,
    parameters: Mapping[str, float],
    *,
    optional: Collection[str] = (),
    integrator: str = "euler",
    stand_ins: Mapping[str, tuple[str, ...]] = MappingProxyType({}),
) -> Recording:
    """Columns t [s], `state`, `action` and, if there are several, episode; states in `optional` may be absent.

    So may all actions, of something that nobody commands. stand_ins: of an action the columns that may stand for it.

    Every fault is a UsageError that names file, episode, row and column.
    """
    table = columns_of(read_frame(path))
    return recording_of(
        table, path, system, state, action, parameters,
        optional=optional, integrator=integrator, stand_ins=stand_ins,
    )  # fmt: skip


def recording_of(
    table: Columns,
    path: Path | str,
    system: str,
    state: Channels,
    action: Channels,
    parameters: Mapping[str, float],
    *,
    optional: Collection[str] = (),
    integrator: str = "euler",
    stand_ins: Mapping[str, tuple[str, ...]] = MappingProxyType({}),
    dt: float | None = None,
) -> Recording:
    """The same of a table that is there already; path: what messages call it.

    dt: the usual step [s] where it is known, which says that t is in seconds; else the median step.
    """
    held = Channels(tuple(c for c in state if c.name in table or c.name not in optional))
    held = held if len(held) else state
    stood = _stood_for(table, stand_ins)
    table = {stood.get(name, name): values for name, values in table.items()}
    poses = numeric_poses(table, (*state.names, *action.names))
    _check_spelling(path, table, (*state.names, *action.names))
    action = action if set(action.names) & set(table) else Channels(())
    needed = ("t", *held.names, *action.names)
    _check_columns(path, table, needed, system)
    table = {"episode": np.full(len(table["t"]), "0")} | table
    episodes = episodes_of(table, str(path), held, action, poses)
    steps = np.concatenate([np.zeros(0), *(np.diff(e.t) for e in episodes)])
    if not len(steps):
        raise UsageError(f"{path}: too short: no episode has two rows")
    usual = float(np.median(steps))
    if dt is None:
        _check_seconds(path, np.concatenate([e.t for e in episodes]), usual, held + action)
    step = usual if dt is None else dt
    return Recording(system, held, action, episodes, step, parameters, integrator, poses=poses)


def _stood_for(table: Columns, stand_ins: Mapping[str, tuple[str, ...]]) -> dict[str, str]:
    """Columns that stand in for a channel which has none of its own -> that channel."""
    return {
        next(name for name in others if name in table): channel
        for channel, others in stand_ins.items()
        if channel not in table and not {*others}.isdisjoint(table)
    }


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


def _check_spelling(path: Path | str, table: Columns, names: Sequence[str]) -> None:
    """A column that is nearly called as a channel that is absent would be passed over without a word."""
    others = [column for column in table if column not in ("t", "episode", *names)]
    for name in names:
        near = alike(name, others)
        if name not in table and near:
            raise UsageError(
                f"{path}: column(s) {name} missing; '{near}' is like it: call it {name}, or otherwise"
            )


def alike(name: str, columns: Sequence[str]) -> str | None:
    """The column that is nearly called so, a slip of the pen; None where none is."""
    lower = {column.lower(): column for column in columns}
    near = difflib.get_close_matches(name.lower(), lower, n=1, cutoff=ALIKE)
    return lower[near[0]] if near else None


def _check_columns(path: Path | str, table: Columns, needed: Sequence[str], system: str) -> None:
    missing = [name for name in needed if name not in table]
    if missing:
        raise UsageError(
            f"{path}: column(s) {', '.join(missing)} missing; {system} needs {', '.join(needed)}"
        )
    dates = [name for name in needed if table[name].dtype.kind in "mM"]
    if dates:
        raise UsageError(f"{path}: column(s) {', '.join(dates)} hold dates; write numbers (t in seconds)")
