"""The cart-pole with Coulomb friction between cart and track: the thesis's target (equations 4.11 to 4.13).

Florian (2007), "Correct equations for the dynamics of the cart-pole system", (21)-(22), with the pole's joint
frictionless. The thesis prints cos^2 theta (1 - mu sin theta sgn) in the denominator of (4.11); Newton's equations give
cos theta (cos theta - mu sin theta sgn), which is used here (the test solves the equations directly).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from gpsim.channels import Channels, FloatArray
from gpsim.simulators import Memory

Contact = Literal["chatter", "stick"]
CONTACTS: tuple[Contact, ...] = ("chatter", "stick")

PARAMETERS = ("gravity", "cart_mass", "pole_mass", "pole_half_length")


def cart_pole_accelerations(
    state: FloatArray, force: FloatArray, direction: FloatArray, p: Mapping[str, float], friction: float
) -> FloatArray:
    """(B, 2) accelerations when friction of the given coefficient acts against `direction` (B,) in {-1, 0, 1}."""
    g, m, half = p["gravity"], p["pole_mass"], p["pole_half_length"]
    total = p["cart_mass"] + m
    sin, cos = np.sin(state[:, 2]), np.cos(state[:, 2])
    spin = state[:, 3] ** 2
    mu = friction * direction
    delta = (-force - m * half * spin * (sin + mu * cos)) / total
    theta_acc = (g * sin + cos * (delta + mu * g)) / (half * (4.0 / 3.0 - m * cos * (cos - mu * sin) / total))
    normal = total * g - m * half * (theta_acc * sin + spin * cos)
    x_acc = (force + m * half * (spin * sin - theta_acc * cos) - mu * normal) / total
    return np.stack([x_acc, theta_acc], axis=1)


@dataclass(frozen=True)
class FrictionCartPole:
    """A frictional cart-pole that can be driven.

    contact `chatter`: explicit Euler at dt with sgn(x_dot), as in the thesis; near rest the friction overshoots zero
    speed and reverses the cart. contact `stick`: semi-implicit Euler at dt / substeps; friction that would reverse
    the cart within a substep stops it instead, and a cart at rest stays there while friction can hold it.
    """

    parameters: Mapping[str, float]
    friction: float
    dt: float
    contact: Contact = "chatter"
    substeps: int = 20

    state: ClassVar[Channels] = Channels.of({"x": "m", "x_dot": "m/s", "theta": "rad", "theta_dot": "rad/s"})
    action: ClassVar[Channels] = Channels.of({"force": "N"})

    def __post_init__(self) -> None:
        for name in PARAMETERS:
            if not self.parameters.get(name, 0.0) > 0.0:
                raise ValueError(
                    f"parameters.{name} must be a positive number, got {self.parameters.get(name)}"
                )
        if not self.friction >= 0.0:
            raise ValueError(f"friction must be at least 0, got {self.friction:g}")
        if not self.dt > 0.0:
            raise ValueError(f"dt must be positive, got {self.dt:g}")
        if self.substeps < 1:
            raise ValueError(f"substeps must be at least 1, got {self.substeps}")

    def begin(self, count: int, rng: np.random.Generator) -> Memory:
        """Nothing to remember."""
        return {}

    def step(
        self, state: FloatArray, action: FloatArray, memory: Memory, rng: np.random.Generator
    ) -> FloatArray:
        """(B, 4): the state after one control step with the force held."""
        force = action[:, 0]
        if self.contact == "chatter":
            return self._chatter(state, force)
        for _ in range(self.substeps):
            state = self._slide_or_stick(state, force, self.dt / self.substeps)
        return state

    def measure(self, state: FloatArray, memory: Memory, rng: np.random.Generator) -> FloatArray:
        """The state itself: nothing in the thesis's cart-pole is measured with noise."""
        return state

    def _chatter(self, state: FloatArray, force: FloatArray) -> FloatArray:
        acc = cart_pole_accelerations(state, force, np.sign(state[:, 1]), self.parameters, self.friction)
        return state + self.dt * np.stack([state[:, 1], acc[:, 0], state[:, 3], acc[:, 1]], axis=1)

    def _slide_or_stick(self, state: FloatArray, force: FloatArray, h: float) -> FloatArray:
        moving = np.sign(state[:, 1])
        # At rest friction opposes the motion that would start without it.
        free = cart_pole_accelerations(state, force, np.zeros_like(force), self.parameters, 0.0)
        direction = np.where(moving != 0, moving, np.sign(free[:, 0]))
        slide = cart_pole_accelerations(state, force, direction, self.parameters, self.friction)
        speed = state[:, 1] + h * slide[:, 0]
        held = np.where(moving != 0, speed * moving < 0, speed * direction <= 0)
        # A held cart feels whatever friction keeps its speed at zero; the pole swings about a fixed pivot.
        pivot = (
            self.parameters["gravity"]
            * np.sin(state[:, 2])
            / (4.0 / 3.0 * self.parameters["pole_half_length"])
        )
        stop = -state[:, 1] / h
        pole = np.where(
            held, pivot - 0.75 * np.cos(state[:, 2]) / self.parameters["pole_half_length"] * stop, slide[:, 1]
        )
        x_dot = np.where(held, 0.0, speed)
        theta_dot = state[:, 3] + h * pole
        return np.stack([state[:, 0] + h * x_dot, x_dot, state[:, 2] + h * theta_dot, theta_dot], axis=1)
