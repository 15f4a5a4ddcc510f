"""What a kind of physics outside the catalogue is: a class, whose base says at which site it acts.

An instance is one effect of its kind, with its parameters `k`, during one run. Sites are those of a simulator's chain:
a force (a function of its own coordinate, or with a hidden state, or on all coordinates at once), an inertia, an
actuator, a vehicle's twist (with or without a hidden state), a sensor.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials.worlds import Dial, Scales, System, Values, rounded

Systems = tuple[str, ...]
MECHANICAL: Systems = ("cartpole", "slider", "pendulum")
VEHICLE: Systems = ("unicycle",)
EVERY: Systems = (*MECHANICAL, *VEHICLE)
Draw = Callable[..., dict[str, float]]
"""draw(scales, on, dial) -> parameters on a place, as strong as the dial says, as a share of what the system does."""


class Kind:
    """One kind. Its law is a method of its site; `strength` draws its parameters.

    A class that has its own `strength` is listed, under its name in lower case (`PositionGain`: position_gain), which
    is what answers call it. family: what the catalogue calls it, where it has become a word. since: the first seed
    whose worlds may hold it; None: those of every seed may. systems: where it makes sense. on: what it acts on where
    the site does not say it. needs_levels: only commands of many values show it. unseen_under: excitations that cannot
    show it. of_body: whether it acts in the body itself, not before it (actuators) or after it (sensors).
    """

    listed: ClassVar[dict[str, type[Kind]]] = {}
    name: ClassVar[str]
    strength: ClassVar[Draw]
    since: ClassVar[int | None] = None
    family: ClassVar[str] = ""
    systems: ClassVar[Systems] = MECHANICAL
    on: ClassVar[tuple[str, ...]] = ()
    needs_levels: ClassVar[bool] = False
    unseen_under: ClassVar[tuple[str, ...]] = ()
    of_body: ClassVar[bool] = True

    def __init_subclass__(cls, **facts: Any) -> None:
        """facts: any of the above, as in `class Carpet(Twist, since=0)`."""
        for fact, value in facts.items():
            setattr(cls, fact, value)
        cls.name = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", cls.__name__).lower()
        if "strength" in vars(cls):
            if cls.name in Kind.listed:
                raise ValueError(f"two kinds are called {cls.name}")
            Kind.listed[cls.name] = cls

    def __init__(self, k: Values) -> None:
        self.k = k

    @classmethod
    def drawn(cls, s: Scales, on: str, d: Dial) -> dict[str, float]:
        """The parameters with as many digits as an answer shows."""
        return {name: rounded(value) for name, value in cls.strength(s, on, d).items()}

    @classmethod
    def places(cls, system: System, velocities: str | None) -> list[str]:
        """What it can act on in a system, so that a recording can show it."""
        return list(cls.on or cls._of_site(system)) if system.name in cls.systems else []

    @classmethod
    def _of_site(cls, system: System) -> tuple[str, ...]:
        return system.coordinates


class Force(Kind):
    """A force that is a function of its own coordinate and the time."""

    def force(self, q: FloatArray, v: FloatArray, wall: FloatArray) -> FloatArray:
        """(B,) on its coordinate, of position, velocity and the clock on the wall [s]."""
        raise NotImplementedError


class HiddenForce(Kind):
    """A force, and perhaps an inertia, with a hidden state z (B, 2) of its own, which begins at (first, 0)."""

    first: ClassVar[float] = 0.0

    def begin(self, q: FloatArray, v: FloatArray) -> FloatArray:
        """(B, 2) at the start."""
        return np.stack([np.full_like(q, self.first), np.zeros_like(q)], axis=1)

    def force(self, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        """(B,) on its coordinate."""
        raise NotImplementedError

    def drift(self, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        """(B, 2): dz / dt."""
        raise NotImplementedError

    def inertia(self, z: FloatArray) -> FloatArray | None:
        """(B,) by how much its coordinate's inertia differs from the base's; None: it does not."""
        return None


class CoupledForce(Kind, systems=("cartpole",), on=("x",)):
    """A force on all coordinates at once."""

    def forces(self, s: FloatArray) -> FloatArray:
        """(B, C) of the state (B, S)."""
        raise NotImplementedError


class Inertia(Kind):
    """An inertia that differs from the base's and varies with position."""

    def inertia(self, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(B,) by how much its coordinate's differs, and (B,) that one's slope in q."""
        raise NotImplementedError


class Actuator(Kind, systems=EVERY, of_body=False):
    """What happens to a command on its way to the body, with memory: `gpsim.trials.catalogue.Actuator`.

    level: what it remembers where that is one number, 0 at an episode's start.
    """

    level: FloatArray | float = 0.0

    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        """(B,) what acts during the next h s; u (B,) command, s (B, S) state, t (B,) s of the recording's clock."""
        raise NotImplementedError

    @classmethod
    def _of_site(cls, system: System) -> tuple[str, ...]:
        return tuple(system.action)


class Twist(Kind, systems=VEHICLE, on=("vehicle",)):
    """What becomes of a vehicle's twist."""

    def twist(self, v: FloatArray, w: FloatArray, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(B,) v and w, of the commanded ones and the pose (B, 3)."""
        raise NotImplementedError


class HiddenTwist(Kind, systems=VEHICLE, on=("vehicle",)):
    """What becomes of a vehicle's twist, with a hidden state z (B, 1) of its own, which begins at 0."""

    def begin(self, s: FloatArray) -> FloatArray:
        """(B, 1) at the start."""
        return np.zeros((len(s), 1))

    def twist(self, v: FloatArray, w: FloatArray, z: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(B,) v and w, and dz / dt (B, 1)."""
        raise NotImplementedError


class _Sensor(Kind, systems=EVERY, of_body=False):
    """Of a heading, or of a coordinate's position."""

    @classmethod
    def _of_site(cls, system: System) -> tuple[str, ...]:
        return ("yaw",) if system.vehicle else system.coordinates


class Distortion(_Sensor):
    """A sensor that reads a function of what is there now; the last thing that happens to a reading."""

    def read(self, y: FloatArray) -> FloatArray:
        """What is read: (E,) of a channel, (E, 2) of a pose's place."""
        raise NotImplementedError


class SensorWithMemory(_Sensor):
    """A sensor that reads a function of what was there until now; the first thing that happens to a reading."""

    def read(self, past: FloatArray, h: float) -> FloatArray:
        """(E,) what is read; past: (K, E) all true values of its channel every h s, the last is now."""
        raise NotImplementedError


def middle(s: Scales, on: str, d: Dial, far: float) -> float:
    """A place near the mean of a channel, no farther from it than `far` times its standard deviation."""
    return float(np.mean(s.column(on))) + d.any(-far, far) * s.reach(on)


def seconds(s: Scales, share: float) -> float:
    """A share of an episode [s]."""
    return share * s.world.steps * s.world.dt
