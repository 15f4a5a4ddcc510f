"""A flexible coupling: J w' = u - T, T = k z + d z', z' = w - q', and the load gets T in the place of u.

Definition: two inertias with a spring and a damper between them, as a motor and what it drives through a belt, a
harmonic drive or a long shaft (Spong 1987, "Modeling and control of elastic joint robots", Journal of Dynamic Systems,
Measurement, and Control 109(4)). The motor is ahead of the load by z. A very stiff one leaves a rotor of inertia J on
the load, one without J leaves nothing. It moves by itself, so that the load goes on when the command is gone.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from gpsim.effects.effect import ElasticDrive
from gpsim.effects.place import EffectParameter, Place
from gpsim.simulators import Simulator

SLOWEST, FASTEST = 0.01, 2.5  # of what a sample shows: radians a step at which motor and load may swing
USUAL = 0.3  # radians a step
STARTS = tuple(0.07 * 1.305**k for k in range(13))  # the same: far from how it swings a start shows nothing
LIGHT = 0.3  # of the load's inertia: a motor to begin with


class FlexibleCoupling(ElasticDrive):
    """A flexible coupling: J w' = u - T, T = k z + d z', z' = w - q', and the load gets T in the place of u."""

    family: ClassVar[str] = "flexible_coupling"
    noun: ClassVar[str] = "flexible coupling"
    sentence: ClassVar[str] = (
        "{on} turns its load through a spring ({stiffness}) and a damper ({damping}), with a motor of {inertia}"
    )
    takes: ClassVar[Mapping[str, float]] = {
        "stiffness": float("nan"),
        "damping": float("nan"),
        "inertia": float("nan"),
    }
    asked: ClassVar[bool] = False  # three numbers and ringing: lags, delays and sprung masses look like it
    of_robots: ClassVar[bool] = True

    def places(self, simulator: Simulator) -> tuple[str, ...]:
        """Every action that drives a coordinate by itself; of a MuJoCo model motors, no servos."""
        return tuple(simulator.coupled())

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Stiffness, damping and inertia of the motor, in the action's unit."""
        unit, length, load, rate = place.unit, place.position_unit, place.inertia, 1.0 / place.dt
        light = LIGHT / (1.0 + LIGHT) * load  # of both, as they swing against each other
        return (
            EffectParameter(
                "stiffness",
                f"{unit}/{length}",
                LIGHT * load * (SLOWEST * rate) ** 2,
                load * (FASTEST * rate) ** 2,
                tuple(light * (start * rate) ** 2 for start in STARTS),
                0.1 * light * (USUAL * rate) ** 2,
                place=True,
            ),
            EffectParameter(
                "damping",
                f"{unit} s/{length}",
                0.0,
                load * FASTEST * rate,
                (0.1 * light * USUAL * rate,),
                0.1 * light * rate,
                place=True,
            ),
            EffectParameter(
                "inertia", f"{unit} s^2/{length}", 1e-3 * load, 10.0 * load, (LIGHT * load,), 0.1 * load
            ),
        )
