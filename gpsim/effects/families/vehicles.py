"""What becomes of a vehicle's twist: its speed, sideways speed and turn rate."""

from __future__ import annotations

import numpy as np

from gpsim.effects.effect import Each, VehicleEffect
from gpsim.effects.place import EffectParameter, Place, Plausible

Twist = tuple[Each, Each, Each]


class WheelSaturation(VehicleEffect):
    """Wheels that turn no faster than their motors can: v - w b/2 and v + w b/2 of a differential drive, clipped.

    Definition: the kinematics of two driven wheels a track b apart (Siegwart, Nourbakhsh and Scaramuzza 2011,
    Introduction to Autonomous Mobile Robots, 2nd ed., section 3.2), each clipped by itself: in a fast curve the outer
    wheel is held back, and the vehicle turns less and drives slower.
    """

    family = "wheel_saturation"
    noun = "wheel saturation"
    sentence = "no wheel (track width {track}) rolls faster than {limit}"
    function_of = "nothing"
    order = 5
    plausible = {
        "track": Plausible(
            0.05, 1.5, "1", "differential drives: 0.05 m (e-puck) to 1 m (warehouse robots), data sheets"
        )
    }

    @staticmethod
    def law(v: Each, lateral: Each, w: Each, limit: Each = np.inf, track: Each = 1.0) -> Twist:
        half = 0.5 * track * w
        left = np.minimum(np.maximum(v - half, -limit), limit)
        right = np.minimum(np.maximum(v + half, -limit), limit)
        return 0.5 * (left + right), lateral, (right - left) / track

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Limit [m/s] of a wheel and track [m]; a limit out of reach has no gradient."""
        return (
            EffectParameter("limit", "m/s", 0.01, 10.0, (1.0, 0.5, 0.25), 0.1, falls=True),
            EffectParameter("track", "m", 0.05, 1.5, (0.3, 0.3, 0.3), 0.1, none=0.3, paired=True),
        )


class MinimumTurningRadius(VehicleEffect):
    """A minimum turning radius: |w| <= |v| / R, as a steering angle that ends makes it.

    Dubins (1957), "On curves of minimal length with a constraint on average curvature", American Journal of
    Mathematics 79(3); LaValle (2006), Planning Algorithms, section 13.1.2.1 (a simple car).
    """

    family = "minimum_turning_radius"
    sentence = "the vehicle turns no tighter than a radius of {radius}"
    function_of = "twist"
    order = 10

    @staticmethod
    def law(v: Each, lateral: Each, w: Each, radius: Each) -> Twist:
        most = np.abs(v) / radius
        return v, lateral, np.minimum(np.maximum(w, -most), most)

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Radius [m]; from several starts."""
        return (EffectParameter("radius", "m", 1e-3, 20.0, (0.1, 0.2, 0.3, 0.45, 0.7, 1.2, 2.5, 5.0), 0.2),)


class Understeer(VehicleEffect):
    """Understeer: w / (1 + K v^2).

    Gillespie (1992), Fundamentals of Vehicle Dynamics, chapter 6.
    """

    family = "understeer"
    sentence = "the vehicle understeers with a gradient of {gradient}"
    function_of = "twist"
    order = 20
    plausible = {
        "gradient": Plausible(
            0.0,
            5.0,
            "1",
            "1/V^2, V the characteristic speed: for cars 20 to 30 m/s (Gillespie 1992), for models about 0.5 m/s",
        )
    }

    @staticmethod
    def law(v: Each, lateral: Each, w: Each, gradient: Each) -> Twist:
        return v, lateral, w / np.maximum(1.0 + gradient * (v * v), 0.05)

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Gradient [s^2/m^2]."""
        return (EffectParameter("gradient", "s^2/m^2", -0.5, 50.0, (0.1,), 0.2),)


class SteeringBias(VehicleEffect):
    """A steering bias: w + kappa v, as a wheel that points aside makes it.

    Definition: a constant added to the curvature w / v.
    """

    family = "steering_bias"
    sentence = "the steering has a curvature offset of {curvature}"
    function_of = "twist"
    order = 30
    plausible = {
        "curvature": Plausible(
            0.0, 2.0, "1", "estimate: small robots have curvatures up to 2/m (a Limo: 1/0.46 m)"
        )
    }

    @staticmethod
    def law(v: Each, lateral: Each, w: Each, curvature: Each) -> Twist:
        return v, lateral, w + curvature * v

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Curvature [1/m]."""
        return (EffectParameter("curvature", "1/m", -20.0, 20.0, (0.1,), 0.1),)


class CorneringDrag(VehicleEffect):
    """Cornering drag: v / (1 + k (v w)^2), the speed that a vehicle loses in a curve; its way stays the same.

    A tyre that carries the lateral force m v w at a slip angle holds the vehicle back by that force times the angle;
    with a linear tyre both grow with the lateral acceleration v w (Milliken and Milliken 1995, Race Car Vehicle
    Dynamics, chapter 2, induced drag; Gillespie 1992, chapter 6). The loss of speed of the motor is taken as
    proportional.
    """

    family = "cornering_drag"
    sentence = "the vehicle slows down in curves by {drag} times its squared lateral acceleration"
    function_of = "twist"
    order = 30
    changes = "v"
    plausible = {"drag": Plausible(0.0, 1.0, "1", "estimate: model cars lose half of their speed at 1 m/s^2")}

    @staticmethod
    def law(v: Each, lateral: Each, w: Each, drag: Each) -> Twist:
        left = 1.0 / (1.0 + drag * (v * w) * (v * w))
        return v * left, lateral, w * left

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Drag [s^4/m^2]."""
        return (EffectParameter("drag", "s^4/m^2", 0.0, 20.0, (0.1,), 0.1),)


class LateralSlip(VehicleEffect):
    """Lateral slip: v_lateral = -s v w, sliding outwards in a curve in proportion to its lateral acceleration.

    Definition: one number for every speed. A linear tyre (Rajamani 2012, Vehicle Dynamics and Control, 2nd ed.,
    section 2.3) makes the slip angle, not the sideways speed, proportional to the lateral acceleration v w.
    """

    family = "lateral_slip"
    sentence = "the vehicle slips sideways by {slip} times its lateral acceleration"
    function_of = "twist"
    order = 40
    changes = "v_lateral"
    plausible = {
        "slip": Plausible(
            0.0, 1.0, "1", "m l_f / (L C) v at low slip: cars 0.01 to 0.1 s (Gillespie 1992, chapter 6)"
        )
    }

    @staticmethod
    def law(v: Each, lateral: Each, w: Each, slip: Each) -> Twist:
        return v, lateral - slip * v * w, w

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Slip [s]."""
        return (EffectParameter("slip", "s", -2.0, 5.0, (0.05,), 0.05),)
