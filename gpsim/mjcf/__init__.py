"""MuJoCo models as simulators: what a robot.xml, a URDF or a Gymnasium environment left out. Needs gpsim[mujoco]."""

from gpsim.mjcf.exporting import Exported, export_model, planned
from gpsim.mjcf.facts import Checked, Declared, checked, declared
from gpsim.mjcf.geometry import Moved, Place
from gpsim.mjcf.kinematics import Kinematics
from gpsim.mjcf.layout import Layout
from gpsim.mjcf.loading import is_mujoco, new_environment, notes_of, source_of
from gpsim.mjcf.opening import SYSTEM, files_digest, in_its_columns, open_simulator, simulator_name
from gpsim.mjcf.optional import mujoco
from gpsim.mjcf.patching import Correction
from gpsim.mjcf.rendering import rendered
from gpsim.mjcf.simulator import MjcfSimulator, load_mjcf
from gpsim.trust import GYM

__all__ = [
    "GYM",
    "SYSTEM",
    "Checked",
    "Correction",
    "Declared",
    "Exported",
    "Kinematics",
    "Layout",
    "MjcfSimulator",
    "Moved",
    "Place",
    "checked",
    "declared",
    "export_model",
    "files_digest",
    "gym_task",
    "in_its_columns",
    "is_mujoco",
    "load_mjcf",
    "mujoco",
    "new_environment",
    "notes_of",
    "open_simulator",
    "planned",
    "rendered",
    "simulator_name",
    "source_of",
]
