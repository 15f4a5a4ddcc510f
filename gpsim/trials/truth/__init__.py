"""What truly happens in a concealed world, what its sensors say, and how visible each of its effects is.

Command, actuators, body, sensors, noise. Nothing here, nor what it imports, is of `gpsim.effects`, `gpsim.simulators`
or `gpsim.diagnosis`.
"""

from gpsim.trials.truth.curves import true_curve
from gpsim.trials.truth.mujoco_body import native
from gpsim.trials.truth.replay import OneStep, one_step
from gpsim.trials.truth.running import run
from gpsim.trials.truth.shares import MainShare, Shares, Visibility, visibilities

__all__ = [
    "MainShare",
    "OneStep",
    "Shares",
    "Visibility",
    "native",
    "one_step",
    "run",
    "true_curve",
    "visibilities",
]
