"""MuJoCo models as simulators: what a robot.xml, a URDF or a Gymnasium environment left out. Needs gpsim[mujoco]."""

from gpsim.mjcf.exporting import Exported, export_model, files_of
from gpsim.mjcf.facts import Checked, Declared, checked, declared
from gpsim.mjcf.gym_task import GymTask
from gpsim.mjcf.loading import is_mujoco, source_of
from gpsim.mjcf.opening import SYSTEM, files_digest, in_its_columns, open_simulator, simulator_name
from gpsim.mjcf.patching import Correction
from gpsim.mjcf.simulator import MjcfSimulator, load_mjcf

__all__ = [
    "SYSTEM",
    "Checked",
    "Correction",
    "Declared",
    "Exported",
    "GymTask",
    "MjcfSimulator",
    "checked",
    "declared",
    "export_model",
    "files_of",
    "files_digest",
    "in_its_columns",
    "is_mujoco",
    "load_mjcf",
    "open_simulator",
    "simulator_name",
    "source_of",
]
