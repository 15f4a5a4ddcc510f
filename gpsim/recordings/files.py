"""Recordings on disk: recording.csv or recording.parquet beside recording.yaml (the format is a contract)."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pandas as pd
import yaml

from gpsim.channels import Channels, FloatArray
from gpsim.errors import UsageError
from gpsim.recordings import values
from gpsim.recordings.recording import Episode, HeldOut, Recording
from gpsim.recordings.table_files import check_size, read_frame
from gpsim.recordings.values import check_channels, check_name, one_line
from gpsim.recordings.yaml_data import read_yaml

TableFormat = Literal["csv", "parquet"]
META_NAME = "recording.yaml"
_KNOWN = {
    "system", "parameters", "integrator", "dt", "state", "action", "velocities", "clock", "noise", "held_out",
    "wraps", "provenance", "model",
}  # fmt: skip


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


def read_recording(path: Path) -> Recording:
    """Read a recording folder; every fault ends in a UsageError that says what, where and what to do."""
    folder = path if path.is_dir() else path.parent
    meta = _read_metadata(folder / META_NAME)
    frame, table = _read_table(folder)
    where = str(folder / META_NAME)
    state = Channels.of(_units(meta["state"], f"{where}: state"), wraps=_wraps(meta, where))
    action = Channels.of(_units(meta.get("action") or {}, f"{where}: action"))
    needed = ("episode", "t", *state.names, *action.names)
    missing = [name for name in needed if name not in frame.columns]
    if missing:
        raise UsageError(f"{table}: column(s) {', '.join(missing)} missing; {META_NAME} names them")
    unnamed = np.flatnonzero(frame["episode"].isna() | (frame["episode"] == ""))
    if unnamed.size:
        raise UsageError(f"{table}: row {unnamed[0]}: no episode; give every row its episode's name")
    episodes = tuple(
        _episode(str(name), rows, state, action, table) for name, rows in frame.groupby("episode", sort=False)
    )
    return Recording(
        system=str(meta["system"]),
        state=state,
        action=action,
        episodes=episodes,
        dt=values.number(meta["dt"], f"{where}: dt"),
        parameters=values.numbers(meta.get("parameters") or {}, f"{where}: parameters"),
        integrator=str(meta.get("integrator", "euler")),
        velocities=values.choice(
            meta.get("velocities"), (None, "measured", "differentiated"), f"{where}: velocities"
        ),
        clock=values.choice(meta.get("clock", "episode"), ("session", "episode"), f"{where}: clock"),
        noise=_noise(meta, state + action, where),
        held_out=_held_out(meta, where),
        provenance=_provenance(meta.get("provenance"), where),
        model=_model(meta, where),
    )


def _read_metadata(path: Path) -> Mapping[str, Any]:
    if not path.is_file():
        raise UsageError(
            f"{path.parent}: no {META_NAME}; a recording is a folder with {META_NAME} and recording.csv"
        )
    meta = read_yaml(path)
    if not isinstance(meta, dict):
        raise UsageError(f"{path}: expected a mapping with system, dt, state and action")
    lacking = [key for key in ("system", "dt", "state") if key not in meta]
    if lacking:
        raise UsageError(f"{path}: {', '.join(lacking)} missing")
    unknown = sorted(set(meta) - _KNOWN)
    if unknown:
        raise UsageError(
            f"{path}: unknown key(s) {', '.join(unknown)}; known are {', '.join(sorted(_KNOWN))}"
        )
    return meta


def _units(raw: object, where: str) -> dict[str, str]:
    if not isinstance(raw, Mapping):
        raise UsageError(f"{where}: expected channels with units, as {{x: m, x_dot: m/s}}, got {raw!r}")
    check_channels(raw, where)
    return {str(name): str(unit) for name, unit in raw.items()}


def _provenance(raw: object, where: str) -> Mapping[str, Any]:
    if not isinstance(raw, Mapping | None):
        raise UsageError(f"{where}: provenance: expected keys and values, got {one_line(repr(raw), 60)}")
    return raw or {}


def _model(meta: Mapping[str, Any], where: str) -> str | None:
    model = meta.get("model")
    if model is not None and not (isinstance(model, str) and model):
        raise UsageError(f"{where}: model: expected the file of a MuJoCo model, as robot.xml, got {model!r}")
    return model


def _wraps(meta: Mapping[str, Any], where: str) -> tuple[str, ...]:
    names = meta.get("wraps") or []
    if not isinstance(names, list):
        raise UsageError(f"{where}: wraps: expected a list of channels, got {names!r}")
    return tuple(values.choice(name, tuple(meta["state"]), f"{where}: wraps") for name in names)


def _noise(meta: Mapping[str, Any], channels: Channels, where: str) -> dict[str, float]:
    noise = values.numbers(meta.get("noise") or {}, f"{where}: noise")
    for name, deviation in noise.items():
        values.choice(name, channels.names, f"{where}: noise")
        if deviation < 0:
            raise UsageError(
                f"{where}: noise.{name}: a standard deviation is no less than 0, got {deviation:g}"
            )
    return noise


def _held_out(meta: Mapping[str, Any], where: str) -> HeldOut | None:
    if not meta.get("held_out"):
        return None
    where = f"{where}: held_out"
    rule = values.table(meta["held_out"], where, ("episodes_from", "time_from", "share"))
    if len(rule) > 1:
        raise UsageError(f"{where}: episodes_from, time_from or share, not two of them")
    if "time_from" in rule:
        return HeldOut(None, values.number(rule["time_from"], f"{where}.time_from"))
    if "share" in rule:
        share = values.number(rule["share"], f"{where}.share")
        if not 0.0 <= share < 1.0:
            raise UsageError(f"{where}.share: expected a number in [0, 1), got {share:g}")
        return HeldOut(share=share)
    first = values.number(rule["episodes_from"], f"{where}.episodes_from")
    if not first.is_integer():
        raise UsageError(f"{where}.episodes_from: expected a whole number, got {first:g}")
    return HeldOut(int(first), None)


def _read_table(folder: Path) -> tuple[pd.DataFrame, Path]:
    parquet, csv = folder / "recording.parquet", folder / "recording.csv"
    table = parquet if parquet.is_file() else csv
    if not table.is_file():
        raise UsageError(f"{folder}: neither recording.csv nor recording.parquet")
    frame = read_frame(table, "round_trip")
    if frame.empty:
        raise UsageError(f"{table}: no rows")
    return frame, table


def _episode(name: str, rows: pd.DataFrame, state: Channels, action: Channels, table: Path) -> Episode:
    check_name(name, f"{table}: column episode")
    try:
        t = rows["t"].to_numpy(dtype=np.float64)
        states = rows[list(state.names)].to_numpy(dtype=np.float64)
        actions = rows[list(action.names)].to_numpy(dtype=np.float64).reshape(len(rows), len(action))[:-1]
    except (ValueError, TypeError) as error:
        raise UsageError(f"{table}: episode {name}: a value is not a number: {error}") from error
    _check_finite(t[:, None], ("t",), name, rows, table)
    _check_finite(states, state.names, name, rows, table)
    _check_finite(actions, action.names, name, rows, table)
    samples = np.column_stack([t, states])
    check_size(samples, ("t", *state.names), f"{table}: episode {name}", list(rows.index))
    check_size(actions, action.names, f"{table}: episode {name}", list(rows.index))
    backwards = np.flatnonzero(np.diff(t) <= 0)
    if backwards.size:
        row = int(rows.index[int(backwards[0]) + 1])
        raise UsageError(
            f"{table}: episode {name}, row {row}: t does not increase; sort or re-import the log"
        )
    return Episode(name, t, states, actions)


def _check_finite(
    values: FloatArray, names: tuple[str, ...], episode: str, rows: pd.DataFrame, table: Path
) -> None:
    bad = np.argwhere(~np.isfinite(values))
    if bad.size:
        row, column = (int(i) for i in bad[0])
        value = values[row, column]
        raise UsageError(
            f"{table}: episode {episode}, row {int(rows.index[row])}, channel {names[column]}: {value} is not finite"
            f" ({len(bad)} such value(s)); drop or repair the rows and import again"
        )
