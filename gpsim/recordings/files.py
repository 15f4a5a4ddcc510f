"""Recordings on disk: recording.csv or recording.parquet beside recording.yaml (the format is a contract).

Of a Parquet file it is asked first how much its columns make: one that always says the same takes no bytes on the disk
and eight a row in memory.
"""

from __future__ import annotations

import csv
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
import yaml
from numpy.typing import NDArray

from gpsim.channels import Channels, FloatArray, IntArray
from gpsim.errors import UsageError
from gpsim.limits import TABLE_BYTES, TABLE_COLUMNS, TABLE_GROWTH, allowed, more
from gpsim.recordings.guessing import UNITS, alike, dated, likely_unit
from gpsim.recordings.recording import UNSEEN, Clock, Episode, HeldOut, Recording, Velocities, pose_channels
from gpsim.recordings.values import (
    LARGEST,
    LONGEST_LINE,
    Columns,
    Number,
    Numbers,
    Sound,
    Text,
    check_channels,
    check_columns,
    check_name,
    checked,
    one_line,
)
from gpsim.recordings.yaml_data import read_yaml

if TYPE_CHECKING:
    import pandas as pd

TableFormat = Literal["csv", "parquet"]
META_NAME = "recording.yaml"
MOVING = ("m", "rad", "deg", "m/s", "rad/s", "deg/s")  # units of what is looked at many times a second
PARQUET: dict[str, Any] = {"thrift_string_size_limit": 16 << 20, "thrift_container_size_limit": 1 << 20}
"""What of a file's own description is believed."""
NUMBER = 8  # bytes


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


def _of_kind(kind: type, expected: str, shown: int = 0) -> Sound:
    """What YAML made as a value of this type; ValueError says what was expected."""

    def by(raw: object) -> Any:
        if not isinstance(raw, kind) or raw == "":
            raise ValueError(f"expected {expected}, got {one_line(repr(raw), shown) if shown else repr(raw)}")
        return raw

    return Sound(by)


_UNITS = _of_kind(dict, "channels with units, as {x: m, x_dot: m/s}")


@dataclass(frozen=True)
class _Metadata:
    """What recording.yaml says."""

    system: Text
    dt: Number
    state: Annotated[dict[str, str], _UNITS]
    action: Annotated[dict[str, str], _UNITS] = field(default_factory=dict)
    parameters: Numbers = field(default_factory=dict)
    integrator: Text = "euler"
    velocities: Velocities | None = None
    clock: Clock = "episode"
    noise: Numbers = field(default_factory=dict)
    held_out: HeldOut | None = None
    wraps: Annotated[Sequence[str], _of_kind(list, "a list of channels")] = ()
    provenance: Annotated[Mapping[str, Any], _of_kind(dict, "keys and values", 60)] = field(
        default_factory=dict
    )
    model: Annotated[str, _of_kind(str, "the file of a MuJoCo model, as robot.xml")] | None = None

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
                raise ValueError(f"noise.{name}: a standard deviation must be at least 0, got {deviation:g}")


def read_recording(path: Path) -> Recording:
    """Read a recording folder; every fault ends in a UsageError that says what, where and what to do."""
    folder = path if path.is_dir() else path.parent
    meta = _read_metadata(folder / META_NAME)
    parquet, text = folder / "recording.parquet", folder / "recording.csv"
    table = parquet if parquet.is_file() else text
    if not table.is_file():
        raise UsageError(f"{folder}: neither recording.csv nor recording.parquet")
    columns = _columns_of(read_frame(table, "round_trip"))
    if not any(map(len, columns.values())):
        raise UsageError(f"{table}: no rows")
    units = [{name: str(unit) for name, unit in one.items()} for one in (meta.state, meta.action)]
    state, action = Channels.of(units[0], wraps=meta.wraps), Channels.of(units[1])
    missing = [name for name in ("episode", "t", *state.names, *action.names) if name not in columns]
    if missing:
        raise UsageError(f"{table}: column(s) {', '.join(missing)} missing; {META_NAME} names them")
    poses = _numeric_poses(columns, (*state.names, *action.names))
    same = {key: value for key, value in vars(meta).items() if key not in ("state", "action", "wraps")}
    episodes = _episodes_of(columns, str(table), state, action, poses)
    return Recording(state=state, action=action, poses=poses, episodes=episodes, **same)


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
    held = raw.get("held_out") or {}
    rule = checked(HeldOut, held, f"{path}: held_out")
    if isinstance(held, Mapping) and len(held) > 1:
        raise UsageError(f"{path}: held_out: use only one of episodes_from, time_from and share")
    raw["held_out"] = rule if held else None
    meta = checked(_Metadata, raw, str(path), top=True)
    check_channels(meta.state, f"{path}: state")
    check_channels(meta.action, f"{path}: action")
    return meta


@dataclass(frozen=True)
class Described:
    """What a bare table is of. Its columns are t [s], the channels and, if there are several, episode.

    optional: states that may be absent, as all actions may of something that nobody commands; stand_ins: of an action
    the columns that may stand for it.
    """

    system: str
    state: Channels
    action: Channels
    parameters: Mapping[str, float]
    optional: Collection[str] = ()
    integrator: str = "euler"
    stand_ins: Mapping[str, tuple[str, ...]] = field(default_factory=dict)


def read_bare_table(path: Path, described: Described) -> Recording:
    """The recording of a CSV or Parquet table; every fault is a UsageError that names file, episode, row and column."""
    return recording_of(read_frame(path), path, described)


def recording_of(
    frame: pd.DataFrame, path: Path | str, described: Described, dt: float | None = None
) -> Recording:
    """The same of a table that is there already; path: what messages call it.

    dt: the usual step [s] where it is known, which says that t is in seconds; else the median step.
    """
    table, system, state, action = _columns_of(frame), described.system, described.state, described.action
    optional, stand_ins = described.optional, described.stand_ins
    held = Channels(tuple(c for c in state if c.name in table or c.name not in optional))
    held = held if len(held) else state
    stood = {
        next(name for name in others if name in table): channel
        for channel, others in stand_ins.items()
        if channel not in table and not {*others}.isdisjoint(table)
    }
    table = {stood.get(name, name): values for name, values in table.items()}
    names = (*state.names, *action.names)
    poses = _numeric_poses(table, names)
    others = [column for column in table if column not in ("t", "episode", *names)]
    for name in names:  # a column that is nearly called as a channel that is absent would be passed over
        if name not in table and (near := alike(name, others)):
            raise UsageError(
                f"{path}: column(s) {name} missing; '{near}' is similar: rename it to {name}, or clearly differently"
            )
    action = action if set(action.names) & set(table) else Channels(())
    needed = ("t", *held.names, *action.names)
    if missing := [name for name in needed if name not in table]:
        wants = f"{system} needs {', '.join(needed)}"
        raise UsageError(f"{path}: column(s) {', '.join(missing)} missing; {wants}")
    if dates := [name for name in needed if table[name].dtype.kind in "mM"]:
        raise UsageError(f"{path}: column(s) {', '.join(dates)} hold dates; write numbers (t in seconds)")
    table = {"episode": np.full(len(table["t"]), "0")} | table
    episodes = _episodes_of(table, str(path), held, action, poses)
    steps = np.concatenate([np.zeros(0), *(np.diff(e.t) for e in episodes)])
    if not len(steps):
        raise UsageError(f"{path}: too short: every episode has less than two rows")
    usual = float(np.median(steps))
    if dt is None:
        _check_seconds(path, np.concatenate([e.t for e in episodes]), usual, held + action)
    step = usual if dt is None else dt
    base = described.parameters, described.integrator
    return Recording(system, held, action, episodes, step, *base, poses=poses)


def _check_seconds(path: Path | str, t: FloatArray, step: float, channels: Channels) -> None:
    """Refuse a clock that counts something else than seconds: a date says so, or what moves and is seen so seldom."""
    unit = likely_unit(t, step)
    if unit is None or not (dated(t) or any(channel.unit in MOVING for channel in channels)):
        return
    count = str(round(1 / UNITS[unit]))
    seconds = f"if it is in seconds, add dt={step:g}"
    if isinstance(path, Path):
        seconds = f"if it is in seconds, write dt: {step:g} in a recording.yaml beside it"
        count = f"{count}, or `gpsim import` the table with time.scale={UNITS[unit]:.0e}"
    raise UsageError(
        f"{path}: t looks like {unit}: its usual step is {step:g}, and t is read in seconds; divide the column by "
        f"{count}; {seconds}"
    )


def check_parquet(path: Path, metadata: Any) -> None:
    """Refuse a file whose values take more memory than one of its size should; raises UsageError."""
    columns, groups = metadata.num_columns, range(metadata.num_row_groups)
    check_width(path, columns)
    values = written = 0
    for group in map(metadata.row_group, groups):
        values += sum(group.column(i).num_values for i in range(columns))
        written += group.total_byte_size
    made = max(NUMBER * max(values, metadata.num_rows * columns), written)
    limit = TABLE_BYTES + TABLE_GROWTH * path.stat().st_size
    if made > allowed(limit):
        raise UsageError(
            f"{path}: its values take {made} bytes or more, the limit for a file of its size is {allowed(limit)}; "
            f"{more(made, limit)}"
        )


def check_width(path: Path, columns: int) -> None:
    """Refuse a table of more columns than anything measures."""
    if columns > allowed(TABLE_COLUMNS):
        raise UsageError(
            f"{path}: it has {columns} columns, the limit is {allowed(TABLE_COLUMNS)}; {more(columns, TABLE_COLUMNS)}"
        )


def is_text(kind: Any) -> bool:
    """Whether an Arrow type is text; pandas' categories are a dictionary."""
    import pyarrow as pa  # here, as pandas below: who reads a small table of numbers need not wait for them

    held = kind.value_type if pa.types.is_dictionary(kind) else kind
    return str(held) in ("string", "large_string", "string_view")


def _is_plain(kind: Any) -> bool:
    """Whether an Arrow type is numbers, times or text: no lists, tables or bytes, which nothing is measured in."""
    import pyarrow.types as types

    return bool(types.is_primitive(kind) or types.is_boolean(kind) or is_text(kind))


def read_frame(path: Path, precision: Literal["round_trip"] | None = None) -> pd.DataFrame:
    """A CSV or Parquet table; UsageError where it cannot be read or two columns have one name.

    Episodes are called letter by letter what the table says: NA and 007 are names, too. precision: pandas'
    float_precision, for CSV.
    """
    import pandas as pd

    if path.exists() and not path.is_file():
        raise UsageError(f"{path}: is not a regular file; name a CSV or Parquet table")
    try:
        if path.suffix == ".parquet":
            return _read_parquet(path)
        with path.open("rb") as file:
            if len(file.readline(LONGEST_LINE + 1)) > LONGEST_LINE:
                long = f"its first line is longer than {LONGEST_LINE} bytes"
                raise UsageError(f"{path}: {long}; write a table with line breaks")
        with path.open(newline="", encoding="utf-8-sig", errors="replace") as text:
            first = next((row for row in csv.reader(text) if row), [])
        check_width(path, len(first))
        check_columns([name.strip() or f"column_{i}" for i, name in enumerate(first)], str(path))
        frame = pd.read_csv(path, dtype={"episode": str}, float_precision=precision)
        if "episode" in frame.columns and frame["episode"].isna().any():
            said = pd.read_csv(path, usecols=["episode"], dtype=str, keep_default_na=False)["episode"]
            frame["episode"] = said.where(said != "")
        return frame
    except UsageError:
        raise
    except Exception as error:  # pandas and pyarrow raise a dozen kinds on a damaged file
        raise UsageError(f"{path}: cannot be read: {one_line(error, 160)}") from error


def _read_parquet(path: Path) -> pd.DataFrame:
    """A file's columns of numbers, times and text; a text that is there many times is held once."""
    import pandas as pd
    import pyarrow.parquet as pq

    with pq.ParquetFile(path, **PARQUET) as file:
        check_parquet(path, file.metadata)
        check_columns([str(name) for name in file.schema_arrow.names], str(path))
        fields = [field for field in file.schema_arrow if _is_plain(field.type)]
    texts = [field.name for field in fields if is_text(field.type)]
    frame = pd.read_parquet(path, columns=[field.name for field in fields], read_dictionary=texts)
    for name in texts:
        frame[name] = frame[name].astype("category").astype(object)
    return frame


def _columns_of(frame: pd.DataFrame) -> Columns:
    """The columns of a table that is there already; an episode without a name is called ""."""
    columns = {str(name): _values(frame[name]) for name in frame.columns}
    if "episode" in columns:
        columns["episode"] = np.where(frame["episode"].isna(), "", frame["episode"].to_numpy(object))
    return columns


def _values(column: pd.Series[Any]) -> NDArray[Any]:
    """What is missing among numbers is NaN."""
    kind = column.dtype.kind
    if isinstance(column.dtype, np.dtype):
        return column.to_numpy()
    if kind in "fiub":
        return column.to_numpy(np.float64, na_value=np.nan)
    return column.to_numpy(f"{kind}8[ns]" if kind in "mM" else object)


def _episodes_of(
    table: Columns, where: str, state: Channels, action: Channels, poses: Channels = UNSEEN
) -> tuple[Episode, ...]:
    """The episodes of a table with the columns episode, t, `state`, `action` and `poses`; where: its name in messages.

    The last row's action of an episode never acted, and may be empty. UsageError names episode, row and column.
    """
    named = table["episode"].tolist()
    if "" in named:
        raise UsageError(f"{where}: row {named.index('')}: no episode; give every row its episode name")
    places = {name: place for place, name in enumerate(dict.fromkeys(named))}
    of = np.array([places[name] for name in named], dtype=np.int64)
    each = np.split(np.argsort(of, kind="stable"), np.cumsum(np.bincount(of))[:-1])
    columns = ("t", *state.names, *action.names)
    return tuple(
        replace(
            _episode(str(name), table, columns, rows, 1 + len(state), where),
            poses=_pose_values(table, rows, poses),
        )
        for name, rows in zip(places, each if places else [], strict=True)
    )


def _numbers_of(table: Columns, names: Sequence[str], rows: IntArray) -> FloatArray:
    return np.stack([np.asarray(table[name][rows], dtype=np.float64) for name in names]).T


def _numeric_poses(table: Columns, taken: Collection[str]) -> Channels:
    """The poses of a table, of its columns of numbers."""
    return pose_channels([name for name, values in table.items() if values.dtype.kind in "fiu"], taken)


def _pose_values(table: Columns, rows: IntArray, poses: Channels) -> FloatArray | None:
    """(K + 1, P) of an episode's rows, NaN where nothing was seen; None where nobody looked."""
    if not len(poses):
        return None
    values = _numbers_of(table, poses.names, rows)
    return np.where(np.isfinite(values) & (np.abs(values) <= LARGEST), values, np.nan)


def _episode(
    name: str, table: Columns, columns: Sequence[str], rows: IntArray, states: int, where: str
) -> Episode:
    check_name(name, f"{where}: column episode")
    try:
        values = _numbers_of(table, columns, rows)
    except (ValueError, TypeError) as error:
        raise UsageError(f"{where}: episode {name}: a value is not a number: {error}") from error
    used = np.ones(values.shape, dtype=np.bool_)
    used[-1, states:] = False
    finite, huge = np.isfinite(values), f"is not a valid measurement; the limit is {LARGEST:g}"
    for kind, bad, why in (
        ("channel", ~finite, "is not finite"),
        ("column", finite & (np.abs(values) > LARGEST), huge),
    ):
        if (bad & used).any():
            row, column = (int(i) for i in np.argwhere(bad & used)[0])
            raise UsageError(
                f"{where}: episode {name}, row {rows[row]}, {kind} {columns[column]}: {values[row, column]:g} {why} "
                f"({int((bad & used).sum())} such value(s)); drop or repair the rows"
            )
    t = values[:, 0]
    back = np.flatnonzero(np.diff(t) <= 0)
    if back.size:
        row = int(back[0]) + 1
        raise UsageError(
            f"{where}: episode {name}, row {rows[row]}: t does not increase ({t[row - 1]:g}, then {t[row]:g}); "
            "sort the rows, or give every run an episode of its own"
        )
    return Episode(name, t, values[:, 1:states], values[:-1, states:])
