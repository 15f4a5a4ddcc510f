"""Any simulator by its name: a registered one, a user's own, or a MuJoCo model."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from gpsim.errors import UsageError
from gpsim.files import file_digest
from gpsim.mjcf.loading import is_mujoco, source_of
from gpsim.mjcf.matching import matched
from gpsim.mjcf.simulator import MjcfSimulator, load_mjcf
from gpsim.mjcf.stability import check_stable
from gpsim.recordings import Recording
from gpsim.simulators import Simulator, make_simulator, source_file
from gpsim.trust import GYM

SYSTEM = "mjcf"
"""What recordings call a system that a MuJoCo model simulates."""


def open_simulator(name: str) -> Simulator:
    """The simulator of a name; raises UsageError."""
    if name == SYSTEM:
        raise UsageError(
            "system: mjcf: a MuJoCo model simulates it; say which by --simulator robot.xml, or model: in recording.yaml"
        )
    return load_mjcf(name) if is_mujoco(name) else make_simulator(name)


def simulator_name(given: str | None, recording: Recording, folder: Path) -> str:
    """The simulator that is asked for: the one given, or what the recording in this folder says."""
    if given is not None:
        return given
    model = recording.model
    if recording.system != SYSTEM or model is None:
        return recording.system
    file = model.rpartition(":")[0] if model.rpartition(":")[0].endswith(".py") else model
    beside = folder / file
    there = not model.startswith(GYM) and not Path(file).is_absolute() and beside.is_file()
    return str(folder / model) if there else model


def in_its_columns(recording: Recording, simulator: Simulator) -> Recording:
    """The recording in the columns of a MuJoCo model; as it is for any other simulator.

    Raises UsageError for what the log lacks, and where the model runs away in it.
    """
    if not isinstance(simulator, MjcfSimulator):
        return recording
    made = matched(recording, simulator)
    check_stable(made, simulator)
    return made


def files_digest(name: str) -> str | Mapping[str, str] | None:
    """Hashes of a simulator's files: one of a user's own, one a file of a MuJoCo model; None of a registered one."""
    if is_mujoco(name):
        return dict(source_of(name).files)
    source = source_file(name)
    return file_digest(source) if source else None
