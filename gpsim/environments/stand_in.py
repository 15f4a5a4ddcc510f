"""Driving the stand-in of a robot by a plan, and logging what the robot's own software would log."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gpsim.channels import FloatArray
from gpsim.recordings.export import DriveLog
from gpsim.simulators import Memory
from gpsim.targets import Limo

PAUSE = 2.0
"""Seconds without a pose while the car is carried back to the middle of the floor."""


@dataclass(frozen=True)
class Sweep:
    """A grid over the action space, each point held for `hold` control steps (thesis, section 4.4.2).

    The speeds are the outer loop and ascend, the turn rates the inner one.
    """

    speeds: int = 10
    turns: int = 10
    hold: int = 30

    def commands(self, low: FloatArray, high: FloatArray) -> FloatArray:
        """(speeds * turns * hold, 2): the command of every control step; low, high (2,) bound speed and turn rate."""
        speeds = np.linspace(low[0], high[0], self.speeds)
        turns = np.linspace(low[1], high[1], self.turns)
        grid = np.stack(np.meshgrid(speeds, turns, indexing="ij"), axis=-1).reshape(-1, 2)
        return np.repeat(grid, self.hold, axis=0)


class _Log:
    """A motion capture and a command line, written down as the drive goes on."""

    def __init__(self, car: Limo, rng: np.random.Generator) -> None:
        self._car, self._rng = car, rng
        self._command_t: list[float] = []
        self._commands: list[FloatArray] = []
        self._pose_t: list[FloatArray] = []
        self._poses: list[FloatArray] = []

    def place(self, t: float, state: FloatArray) -> None:
        """The car stands at state (1, 3) at t."""
        self._pose_t.append(np.array([t]))
        self._poses.append(self._car.measure(state, {}, self._rng))

    def send(self, t: float, command: FloatArray) -> None:
        """The command (2,) goes out at t."""
        self._command_t.append(t)
        self._commands.append(command)

    def step(self, t: float, state: FloatArray, command: FloatArray, memory: Memory) -> FloatArray:
        """Send the command and drive for a control step; returns the true pose (1, 3)."""
        self.send(t, command)
        true: FloatArray = self._car.glimpses(state, command[None], memory)[0]
        self._pose_t.append(t + self._car.dt * np.arange(1, len(true) + 1) / len(true))
        self._poses.append(self._car.measure(true, {}, self._rng))
        return np.asarray(true[-1:])

    def log(self) -> DriveLog:
        return DriveLog(
            np.array(self._command_t),
            np.stack(self._commands),
            np.concatenate(self._pose_t),
            np.concatenate(self._poses),
        )


def drive_plan(car: Limo, plan: FloatArray, floor: float, rng: np.random.Generator) -> tuple[DriveLog, int]:
    """Play a plan (K, 2) on a square floor of edge `floor` [m]; returns the log and how often the car was put back.

    Where the car leaves the floor it is stopped and carried to the middle, facing anywhere, out of the motion
    capture's sight for PAUSE seconds; then the plan goes on where it was.
    """
    log, t, returns = _Log(car, rng), 0.0, 0
    state, memory = _middle(rng), car.begin(1, rng)
    log.place(t, state)
    for command in plan:
        if np.abs(state[0, :2]).max() > floor / 2.0:
            log.send(t, np.zeros(2))
            t = round(t + PAUSE, 6)
            returns += 1
            state, memory = _middle(rng), car.begin(1, rng)
            log.place(t, state)
        state = log.step(t, state, command, memory)
        t = round(t + car.dt, 6)
    log.send(t, np.zeros(2))
    return log.log(), returns


def _middle(rng: np.random.Generator) -> FloatArray:
    return np.array([[0.0, 0.0, rng.uniform(-np.pi, np.pi)]])
