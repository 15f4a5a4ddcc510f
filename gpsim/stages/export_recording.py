"""export recording: measured beside simulated channels, for Foxglove, PlotJuggler or a spreadsheet."""

from __future__ import annotations

from pathlib import Path
from typing import cast

import numpy as np

from gpsim.channels import FloatArray, wrap_angle
from gpsim.errors import UsageError
from gpsim.files import written_whole
from gpsim.mjcf import open_simulator
from gpsim.recordings import Episode, Predictions, Recording, read_recording, write_mcap, write_table
from gpsim.simulators import SIMULATORS, Integrator, Simulator

FORMATS = ("mcap", "csv", "parquet")


def export_recording(path: Path, form: str, out: Path) -> list[str]:
    """Write the recording at `path` to the new file `out`; returns sentences about what is in it."""
    if form not in FORMATS:
        raise UsageError(f"--format {form}: not one of {', '.join(FORMATS)}")
    if out.exists():
        raise UsageError(f"{out}: exists already; choose another --out")
    if not out.parent.is_dir():
        raise UsageError(f"{out.parent}: no such folder; make it first")
    if not path.exists() or (path.is_file() and path.stem != "recording"):
        raise UsageError(
            f"{path}: no such recording; give a folder with recording.yaml, as `gpsim import` makes"
        )
    recording = read_recording(path)
    predictions, notes = predict(recording)
    try:
        with written_whole(out, ".parquet" if form == "parquet" else "") as made:
            (write_mcap if form == "mcap" else write_table)(recording, predictions, made)
    except OSError as error:
        raise UsageError(f"{out}: cannot be written: {error.strerror or error}") from error
    samples = sum(len(e.t) for e in recording.episodes)
    return [f"{len(recording.episodes)} episode(s), {samples} samples", *notes]


def predict(recording: Recording) -> tuple[Predictions, list[str]]:
    """The base simulator's one-step (`simulated`) and open-loop (`open_loop`) states, where there is one."""
    if recording.system not in SIMULATORS:
        return {}, [
            f"measured channels only: no simulator '{recording.system}' (there are: {', '.join(SIMULATORS)})"
        ]
    simulator = open_simulator(recording.system)
    names = (recording.state.names, recording.action.names)
    if names != (simulator.state.names, simulator.action.names):
        return {}, [f"measured channels only: not the channels of the simulator {recording.system}"]
    parameters = simulator.defaults(recording.parameters)
    pairs = [_predicted(simulator, parameters, recording, episode) for episode in recording.episodes]
    notes = [
        "simulated: the base simulator, one step from the measured state; open_loop: from the first state on"
    ]
    return {"simulated": [one for one, _ in pairs], "open_loop": [run for _, run in pairs]}, notes


def _predicted(
    simulator: Simulator, parameters: dict[str, float], recording: Recording, episode: Episode
) -> tuple[FloatArray, FloatArray]:
    """(K + 1, S) each; the first row of the one-step prediction is unknown."""
    dt, integrator = np.diff(episode.t), cast(Integrator, recording.integrator)
    wraps = recording.state.wraps
    one_step = np.full_like(episode.states, np.nan)
    run = np.full_like(episode.states, np.nan)
    run[0] = episode.states[0]
    with np.errstate(all="ignore"):  # an open loop may run away; what is not finite is left out
        if len(episode):
            one_step[1:] = simulator.step(episode.states[:-1], episode.actions, parameters, dt, integrator)
        for k in range(len(episode)):
            run[k + 1] = simulator.step(
                run[k : k + 1], episode.actions[k : k + 1], parameters, dt[k : k + 1], integrator
            )
        for states in (one_step, run):
            states[:, wraps] = wrap_angle(states[:, wraps])
    return one_step, run
