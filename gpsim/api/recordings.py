"""What really happened: read_recording, recording_from_frame, and what is handed over to be diagnosed."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from gpsim.api.simulators import folder_of, load_simulator, simulator_of
from gpsim.channels import Channels
from gpsim.errors import UsageError, near_path
from gpsim.mjcf import in_its_columns
from gpsim.recordings import LONGEST_STEP, HeldOut, Recording, Velocities, gaps, joined
from gpsim.recordings import read_recording as read_folder
from gpsim.residuals import OWN_DT, read_table, table_recording
from gpsim.settings import choice, number
from gpsim.simulators import INTEGRATORS, Integrator, Simulator
from gpsim.trust import trusting

TABLES = (".csv", ".parquet")
FRAME = "the frame"


def read_recording(
    path: str | Path | Sequence[str | Path],
    simulator: Any = None,
    *,
    mapping: str | Path | Mapping[str, Any] | None = None,
    changes: Sequence[str] = (),
    salvage: bool = False,
) -> Recording:
    """A recording from disk.

    Args:
        path: a recording's folder, as `gpsim import` makes it (recording.yaml beside recording.csv or .parquet);
            a CSV or Parquet table with columns `t` [s], the states, the actions, and `episode` if there are several;
            or, with a mapping, logs: ROS 1 and 2 bags, MCAP, MATLAB files, tables, or a folder of them, or a list.
        simulator: whose channels and units the columns of a bare table are, as for `load_simulator`. A folder and a
            mapping say that themselves.
        mapping: which topic and field is which channel: a name that comes with gpsim (`limo_optitrack`), a YAML
            file, or its content. `gpsim import --inspect LOG` proposes one.
        changes: of the mapping, as on the command line: `["rate=50"]`.
        salvage: whether to import what is readable of a damaged log.

    Returns:
        Episodes of states (K + 1, S) and actions (K, A) on one clock [s]; `provenance` holds the import's report.
        What an import asks to be looked at is a Python warning.

    Raises:
        UsageError: not there, not readable, a column or topic is missing, or a value is no number.

    Example:
        >>> import gpsim
        >>> recording = gpsim.read_recording("slider.csv", "slider")
        >>> recording.transition_count, round(recording.dt, 6)
        (299, 0.02)
    """
    if mapping is not None:
        if simulator is not None:
            raise UsageError("read_recording: a mapping names its system; remove simulator")
        from gpsim.stages.import_log import read_logs

        paths = [Path(one) for one in ([path] if isinstance(path, str | Path) else path)]
        given = str(mapping) if isinstance(mapping, Path) else mapping
        recording, report, _ = read_logs(paths, given, changes, salvage, say=_warn)
        for text in report.warnings:
            _warn(text)
        return recording
    if changes or salvage:
        raise UsageError("read_recording: changes and salvage go with a mapping")
    if not isinstance(path, str | Path):
        raise UsageError("read_recording: several logs need a mapping, which makes one recording of them")
    place = Path(path)
    if not place.exists():
        raise UsageError(
            f"{place}: no such recording{near_path(place)}; give a folder made by `gpsim import`, or a table"
        )
    folder = place if place.is_dir() else place.parent
    if (folder / "recording.yaml").is_file() and (place.is_dir() or place.stem == "recording"):
        return read_folder(folder)
    if place.is_dir() or place.suffix not in TABLES:
        raise UsageError(
            f"{place}: no recording.yaml and no table: a raw log needs a mapping=, which "
            f"`gpsim import --inspect {place}` proposes"
        )
    if simulator is None:
        raise UsageError(f"{place}: a plain table needs a simulator, which defines its columns")
    return read_table(place, load_simulator(simulator))


def _warn(text: str) -> None:
    warnings.warn(text, UserWarning, stacklevel=3)


def recording_from_frame(
    frame: pd.DataFrame,
    units: Mapping[str, str],
    simulator: Any,
    *,
    time: str = "t",
    episode: str | None = None,
    dt: float | None = None,
    parameters: Mapping[str, float] | None = None,
    integrator: Integrator | None = None,
    velocities: Velocities | None = None,
    noise: Mapping[str, float] | None = None,
    held_out: float | None = None,
    wraps: Iterable[str] = (),
) -> Recording:
    """A recording from a pandas DataFrame: one row a sample, one column a channel.

    Args:
        frame: the samples, in order. The action of a row is what was commanded from its time to the next row's; that
            of an episode's last row is not used.
        units: column: unit, of the columns that are channels of the simulator. Others are passed over.
        simulator: what it will be compared with, as for `load_simulator`.
        time: the column of the time [s], or the name of the index.
        episode: the column that says which episode a row is of; the column `episode` if there is one, else one episode.
        dt: the control step [s]; the usual step of the time by default.
        parameters: of the base simulator, where they are not its defaults, in its units.
        integrator: of the base simulator: `euler`, `semi_implicit` or `rk4`; its own by default.
        velocities: `measured`, or `differentiated` from positions, whose smoothing is no physics.
        noise: channel: known standard deviation of its measurement, in its unit.
        held_out: the last share of it that is kept for judging, in [0, 1); a fifth by default.
        wraps: angles in rad that are known modulo 2 pi, beside those of the simulator.

    Returns:
        The recording: episodes of states (K + 1, S) and actions (K, A) on one clock [s].

    Raises:
        UsageError: a column is missing, a unit is not the simulator's, a value is no finite number, time does not
            increase or has no usual step. The message names column and row.

    Example:
        >>> import numpy as np, pandas as pd
        >>> import gpsim
        >>> t = 0.02 * np.arange(100)
        >>> frame = pd.DataFrame({"t": t, "q": 0.1 * t**2, "q_dot": 0.2 * t, "force": 0.3})
        >>> units = {"q": "m", "q_dot": "m/s", "force": "N"}
        >>> recording = gpsim.recording_from_frame(frame, units, "slider")
        >>> recording.state.names, recording.action.names, recording.transition_count
        (('q', 'q_dot'), ('force',), 99)
    """
    model = load_simulator(simulator)
    table = _chosen(frame, units, time, episode)
    _check_units(units, model)
    if dt is not None and not (math.isfinite(number(dt, "dt")) and dt > 0):
        raise UsageError(f"dt: expected seconds, more than 0, got {dt:g}")
    recording = table_recording(table, FRAME, model, dt)
    _check_steps(recording)
    every = recording.state + recording.action
    for name, deviation in (noise or {}).items():
        choice(name, every.names, "noise")
        if not number(deviation, f"noise: {name}") >= 0.0:
            raise UsageError(f"noise: {name}: a standard deviation must be at least 0, got {deviation:g}")
    if held_out is not None and not 0.0 <= number(held_out, "held_out") < 1.0:
        raise UsageError(f"held_out: expected a share in [0, 1), got {held_out:g}")
    if velocities is not None:
        choice(velocities, ("measured", "differentiated"), "velocities")
    angles = [c.name for c in recording.state if c.wraps]
    for name in [wraps] if isinstance(wraps, str) else wraps:
        angles.append(choice(name, recording.state.names, "wraps"))
    return replace(
        recording,
        state=Channels.of(recording.state.units, wraps=angles),
        parameters=model.defaults(parameters),
        integrator=choice(integrator or recording.integrator, INTEGRATORS, "integrator"),
        velocities=velocities,
        noise={name: float(deviation) for name, deviation in (noise or {}).items()},
        held_out=None if held_out is None else HeldOut(share=float(held_out)),
    )


MOST_GAPS = 0.2
"""Share of a clock's steps that may be gaps. Lost rows are a few in a hundred; of steps drawn at random, 0.29 are."""


def _chosen(frame: Any, units: Any, time: str, episode: str | None) -> pd.DataFrame:
    """The columns that count, under the names that a recording gives them."""
    if not isinstance(frame, pd.DataFrame):
        raise UsageError(f"recording_from_frame: expected a pandas DataFrame, got {type(frame).__name__}")
    if not isinstance(units, Mapping) or not units or not all(isinstance(u, str) for u in units.values()):
        raise UsageError(
            f'recording_from_frame: units: expected column: unit, as {{"q": "m", "force": "N"}}, got {units!r}'
        )
    if frame.index.name == time and time not in frame.columns:
        frame = frame.reset_index()
    of_episodes = "episode" if episode is None and "episode" in frame.columns else episode
    renamed = {time: "t"} | ({of_episodes: "episode"} if of_episodes is not None else {})
    for name in (*renamed, *units):
        if name not in frame.columns:
            there = ", ".join(map(str, frame.columns[:20]))
            raise UsageError(f"{FRAME}: no column '{name}'; it has: {there or 'none'}")
        if (frame.columns == name).sum() > 1:
            raise UsageError(f"{FRAME}: several columns are called '{name}'; give each its own name")
    taken = [name for name in units if name in (*renamed, *renamed.values())]
    if taken:
        raise UsageError(f"{FRAME}: '{taken[0]}' is time or episode, and cannot be a channel too")
    if frame.empty:
        raise UsageError(f"{FRAME}: no rows")
    return pd.DataFrame(frame[[*renamed, *units]]).rename(columns=renamed)


def _check_units(units: Mapping[str, str], simulator: Simulator) -> None:
    known = {**simulator.state.units, **simulator.action.units}
    for name, unit in units.items():
        if name not in known:
            raise UsageError(
                f"units: {simulator.name} has no channel '{name}'; it has {simulator.state.listed()} and "
                f"{simulator.action.listed()}: rename the column, or leave it out of units"
            )
        if unit != known[name]:
            raise UsageError(
                f"units: {name} is in {unit}, {simulator.name}'s in {known[name]}: convert the column and its unit"
            )


def _check_steps(recording: Recording) -> None:
    steps = recording.transitions().dt
    usual = float(np.median(steps))
    if abs(usual - recording.dt) > OWN_DT * recording.dt:
        raise UsageError(
            f"{FRAME}: dt={recording.dt:g} s, but the usual step of its time is {usual:g} s: correct one of them"
        )
    over = float(np.mean(gaps(np.concatenate([[0.0], np.cumsum(steps)]), recording.dt)))
    if over > MOST_GAPS:
        raise UsageError(
            f"{FRAME}: its time has no usual step: {100 * over:.0f} % of the steps are longer than {LONGEST_STEP:g} "
            f"times the median of {usual:.3g} s; resample it to even steps"
        )


Recordings = Recording | str | Path | Sequence[Recording | str | Path] | Mapping[str, Recording | str | Path]
"""One recording, or several of one machine."""


def opened(given: Recordings, model: Simulator | None, trust: bool = False) -> tuple[Recording, Simulator]:
    """What is to be diagnosed, several recordings as one, and the simulator.

    trust: whether code that only a recording names may run.
    """
    if isinstance(given, Mapping) and any(isinstance(one, Recording | str | Path) for one in given.values()):
        named = {str(name): one for name, one in given.items()}
    elif isinstance(given, Sequence) and not isinstance(given, str):
        named = dict(zip(_names_of(given), given, strict=True))
    else:
        named = {"": given}  # type: ignore[dict-item]  # `taken_of` says what it is instead
    if not named:
        raise UsageError("diagnose: expected a recording, or several, got none")
    found = []
    for one in named.values():
        taken = taken_of(one, model)
        with trusting(trust):
            own = model or simulator_of(taken, folder_of(one))
        found.append((in_its_columns(taken, own), own))
    if len(found) == 1:
        return found[0]
    return joined([recording for recording, _ in found], list(named)), found[0][1]


def _names_of(given: Sequence[Recording | str | Path]) -> list[str]:
    """What recordings are called: as their folders or files, numbered where these are alike or there are none."""
    names = [Path(one).stem if isinstance(one, str | Path) else "" for one in given]
    told = all(names) and len(set(names)) == len(names)
    return names if told else [str(i + 1) for i in range(len(given))]


def taken_of(recording: Recording | str | Path, simulator: Simulator | None) -> Recording:
    """A recording, or the one that a path names; raises UsageError for anything else."""
    if isinstance(recording, str | Path):
        return read_recording(recording, simulator)
    if not isinstance(recording, Recording):
        raise UsageError(
            f"expected a recording, got {type(recording).__name__}: make one by read_recording or "
            "recording_from_frame"
        )
    return recording
