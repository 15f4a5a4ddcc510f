"""What truly happens in a concealed world, what its sensors say, and how visible each of its effects is.

Command, actuators, body, sensors, noise. Nothing here, nor what it imports, is of `gpsim.effects`, `gpsim.simulators`
or `gpsim.diagnosis`.
"""

from gpsim.trials.truth.body import Moving, mujoco, native
from gpsim.trials.truth.replay import OneStep, Replay, one_step, picked
from gpsim.trials.truth.running import Frame, driven, noise_of, run
from gpsim.trials.truth.shares import Shares, visibilities

__all__ = [
    "Frame",
    "Moving",
    "OneStep",
    "Replay",
    "Shares",
    "driven",
    "mujoco",
    "native",
    "noise_of",
    "one_step",
    "picked",
    "run",
    "visibilities",
]
