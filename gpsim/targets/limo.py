"""An AgileX Limo in Ackermann mode on a floor: a stand-in for the robot, stepped finely and knowing nothing of effects.

The maker's driver turns a commanded twist (v, w) into a steering angle atan(wheelbase w / v) and stops at an inner
wheel angle of 28 degrees; the car then does what wheels do. The figures and their sources: conf/target/limo.yaml.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gpsim.channels import Channels, FloatArray
from gpsim.simulators import Memory, Unicycle


@dataclass(frozen=True)
class Limo:
    """State (x, y [m], yaw [rad]) of the rear axle's middle; command (v [m/s], w [rad/s]) once a control step.

    wheelbase, track [m]; inner_angle [degree] of the inner front wheel at the stop; scale_left, scale_right: what
    the wheels make of a steering angle, of it; delay [s] from command to motor; steering_lag, motor_lag [s]: time
    constants; position_noise [m], yaw_noise [degree]: of one motion-capture sample; mocap_rate [Hz], a
    whole number of samples in dt; substeps of dt, a multiple of it.
    """

    wheelbase: float
    track: float
    inner_angle: float
    scale_left: float
    scale_right: float
    delay: float
    steering_lag: float
    motor_lag: float
    position_noise: float
    yaw_noise: float
    mocap_rate: float
    dt: float
    substeps: int

    def __post_init__(self) -> None:
        if (
            min(self.track, self.position_noise, self.yaw_noise) < 0
            or min(self.scale_left, self.scale_right) <= 0
        ):
            raise ValueError("track and noises must be at least 0, the scales positive")
        if not self.inner_angle < 90:
            raise ValueError(f"inner_angle must be less than 90 degrees, got {self.inner_angle:g}")
        if min(self.wheelbase, self.inner_angle, self.dt, self.mocap_rate) <= 0 or self.delay < 0:
            raise ValueError("lengths, angles, rates and dt must be positive, the delay at least 0")
        if min(self.steering_lag, self.motor_lag) <= 0 or self.substeps < 1:
            raise ValueError("lags must be positive and substeps at least 1")
        samples = self.mocap_rate * self.dt
        if not math.isclose(samples, max(round(samples), 1), rel_tol=1e-9):
            raise ValueError(
                f"mocap_rate * dt must be a whole number of motion-capture samples in a step of {self.dt:g} s, got "
                f"{samples:g}; the nearest mocap_rate is {max(round(samples), 1) / self.dt:g} Hz"
            )
        if self.substeps % self.glimpse_count:
            raise ValueError(
                f"substeps must be a multiple of the {self.glimpse_count} motion-capture samples in a step"
            )

    @property
    def glimpse_count(self) -> int:
        """How often the motion capture looks in a control step."""
        return round(self.mocap_rate * self.dt)

    @property
    def state(self) -> Channels:
        """The unicycle's pose."""
        return Unicycle.state

    @property
    def action(self) -> Channels:
        """The unicycle's command."""
        return Unicycle.action

    @cached_property
    def turning_radius(self) -> float:
        """The smallest [m], of the rear axle's middle: the inner wheel at its stop."""
        return float(self.wheelbase / np.tan(np.deg2rad(self.inner_angle)) + self.track / 2.0)

    def begin(self, count: int, rng: np.random.Generator) -> Memory:
        """At rest, wheels straight, nothing commanded."""
        held = int(np.ceil(self.delay / self.dt)) + 1
        return {"steering": np.zeros(count), "speed": np.zeros(count), "wanted": np.zeros(count),
                "commands": np.zeros((count, held, 2))}  # fmt: skip

    def step(
        self, state: FloatArray, action: FloatArray, memory: Memory, rng: np.random.Generator
    ) -> FloatArray:
        """(B, 3): the true pose one control step later."""
        *_, last = self._substeps(state, action, memory)
        return last

    def glimpses(self, state: FloatArray, action: FloatArray, memory: Memory) -> FloatArray:
        """(B, G, 3): the true poses at the motion capture's instants of a control step, its end included."""
        every = self.substeps // self.glimpse_count
        poses = list(self._substeps(state, action, memory))
        return np.stack(poses[every - 1 :: every], axis=1)

    def measure(self, state: FloatArray, memory: Memory, rng: np.random.Generator) -> FloatArray:
        """(..., 3): what the motion capture says of true poses."""
        spread = np.array([self.position_noise, self.position_noise, np.deg2rad(self.yaw_noise)])
        return state + spread * rng.standard_normal(state.shape)

    def _substeps(self, state: FloatArray, action: FloatArray, memory: Memory) -> Iterator[FloatArray]:
        """The pose after each substep; the command that reaches the motors is the one sent `delay` ago."""
        sent = memory["commands"]
        sent[:] = np.concatenate([action[:, None], sent[:, :-1]], axis=1)
        h = self.dt / self.substeps
        blend = 1.0 - np.exp(-h / np.array([self.steering_lag, self.motor_lag]))
        for k in range(self.substeps):
            age = int(np.ceil((self.delay - (k + 0.5) * h) / self.dt - 1e-9))
            v, w = sent[:, max(age, 0)].T
            memory["wanted"][:] = self._steering(v, w, memory["wanted"])
            before = memory["steering"].copy(), memory["speed"].copy()
            memory["steering"] += blend[0] * (memory["wanted"] - memory["steering"])
            memory["speed"] += blend[1] * (v - memory["speed"])
            steering, speed = 0.5 * (before[0] + memory["steering"]), 0.5 * (before[1] + memory["speed"])
            turn = speed * np.tan(steering) / self.wheelbase
            middle = state[:, 2] + 0.5 * h * turn
            ahead = h * speed
            change = np.column_stack([ahead * np.cos(middle), ahead * np.sin(middle), h * turn])
            state = state + change
            yield state

    def _steering(self, v: FloatArray, w: FloatArray, last: FloatArray) -> FloatArray:
        """The wheels' angle [rad] that a twist asks for; a command without speed leaves them as they are."""
        moving = v != 0.0
        angle = np.arctan(self.wheelbase * w / np.where(moving, v, 1.0))
        angle = angle * np.where(angle > 0.0, self.scale_left, self.scale_right)
        stop = np.arctan(self.wheelbase / self.turning_radius)
        return np.where(moving, np.clip(angle, -stop, stop), last)
