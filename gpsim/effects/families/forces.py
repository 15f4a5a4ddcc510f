"""Forces on a coordinate: smooth ones of its position and speed, and dry friction, which holds what rests."""

from __future__ import annotations

import numpy as np

from gpsim.effects.effect import RISE, BristleEffect, Each, ForceEffect
from gpsim.effects.place import EffectParameter, Place, Plausible
from gpsim.simulators import Simulator

TURN = 2.0 * np.pi
INSIDE = 0.03  # of the way that was visited: where an edge is first looked for that no scan has found
WAYS = (0.003, 0.01, 0.03)  # of the way that was visited: by how much bristles bend, where a fit starts
WIDER = 10.0  # times as stiff as the stiffest start, or as soft as the softest


class ViscousFriction(ForceEffect):
    """Viscous friction: -b q'.

    Stokes' law; Armstrong-Helouvry et al. (1994), section 2.
    """

    family = "viscous_friction"
    sentence = "viscous friction on {on} with damping {damping} is missing"
    function_of = "speed"
    plausible = {
        "damping": Plausible(
            0.0,
            3.0,
            "size / speed",
            "larger friction would prevent any motion (EMPS axis: 203 N s/m; Janot, Gautier and Brunot 2019)",
        )
    }

    @staticmethod
    def law(speed: Each, damping: Each) -> Each:
        return -damping * speed

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Damping [force per speed]."""
        typical, unit = place.span / place.speed, f"{place.unit} s/{place.position_unit}"
        low, high = -place.damping, 100 * typical
        return (EffectParameter("damping", unit, low, high, (0.2 * typical,), 0.2 * typical),)


class QuadraticDrag(ForceEffect):
    """Quadratic drag: -c |q'| q'.

    Rayleigh's drag of a blunt body in a fluid (Batchelor 1967, section 5.11).
    """

    family = "quadratic_drag"
    sentence = "quadratic drag on {on} of {drag} is missing"
    function_of = "speed"
    plausible = {
        "drag": Plausible(
            0.0,
            3.0,
            "size / speed^2",
            "drag larger than the driving force would stop the body (Batchelor 1967, section 5.11)",
        )
    }

    @staticmethod
    def law(speed: Each, drag: Each) -> Each:
        return -drag * np.abs(speed) * speed

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Drag [force per squared speed]."""
        typical, unit = place.span / place.speed**2, f"{place.unit} s^2/{place.position_unit}^2"
        return (EffectParameter("drag", unit, 0.0, 100 * typical, (0.2 * typical,), 0.2 * typical),)


class Spring(ForceEffect):
    """A spring: -k (q - q0).

    Hooke's law (1678).
    """

    family = "spring"
    sentence = "a spring on {on} of {stiffness} resting at {rest_position} is missing"
    function_of = "position"
    plausible = {
        "stiffness": Plausible(
            0.0,
            10.0,
            "size / reach",
            "estimate: a much stiffer spring would prevent any motion",
        )
    }

    @staticmethod
    def law(q: Each, stiffness: Each, rest_position: Each) -> Each:
        return -stiffness * (q - rest_position)

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Stiffness [force per displacement] and rest_position; fitted where it rests within reach."""
        typical, unit = place.span / place.reach, f"{place.unit}/{place.position_unit}"
        stiffness = EffectParameter("stiffness", unit, 0.0, 100 * typical, (0.3 * typical,), 0.3 * typical)
        return stiffness, place.rest_position


class CubicSpring(ForceEffect):
    """A cubic spring: -k x - k3 x^3 for x = q - q0; it hardens where k3 > 0 and softens where k3 < 0.

    Duffing (1918), Erzwungene Schwingungen bei veränderlicher Eigenfrequenz.
    """

    family = "cubic_spring"
    function_of = "position"
    sentence = (
        "a spring on {on} of {stiffness} and {cubic}, which grows with the cube, resting at {rest_position} "
        "is missing"
    )
    plausible = {
        "stiffness": Plausible(0.0, 10.0, "size / reach", "as a spring"),
        "cubic": Plausible(0.0, 10.0, "size / reach^3", "as a spring, at the end of its range"),
    }

    @staticmethod
    def law(q: Each, stiffness: Each, cubic: Each, rest_position: Each) -> Each:
        x = q - rest_position
        return -(stiffness + cubic * x * x) * x

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Stiffness [force per displacement], cubic [force per cubed displacement] and rest_position."""
        typical, unit = place.span / place.reach, f"{place.unit}/{place.position_unit}"
        curved, most = typical / place.reach**2, 100 * typical
        high = 100 * curved
        return (
            EffectParameter("stiffness", unit, -most, most, (0.1 * typical,), 0.3 * typical),
            EffectParameter("cubic", f"{unit}^3", -high, high, (0.3 * curved,), 0.3 * curved),
            place.rest_position,
        )


class ConstantForce(ForceEffect):
    """A constant force: F0, as a tilted track or a steady wind makes it.

    Definition: m g sin(angle) of a tilt, for one.
    """

    family = "constant_force"
    sentence = "a constant force of {force} on {on} is missing"
    function_of = "position"
    plausible = {
        "force": Plausible(
            0.0, 3.0, "size", "estimate: a force larger than that of the drive would carry the body away"
        )
    }

    @staticmethod
    def law(force: Each) -> Each:
        return force

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Force [the coordinate's]."""
        span = place.span
        return (EffectParameter("force", place.unit, -20 * span, 20 * span, (0.1 * span,), 0.1 * span),)


class CoggingForce(ForceEffect):
    """Cogging: A sin(2 pi q / P + phase), the ripple of magnets and teeth that a body passes.

    Jahns and Soong (1996), "Pulsating torque minimization techniques for permanent magnet AC motor drives - a review",
    IEEE Transactions on Industrial Electronics 43(2).
    """

    family = "cogging_force"
    function_of = "position"
    noun = "cogging"
    sentence = "a cogging force of {amplitude} on {on} with a period of {period} is missing"
    plausible = {
        "amplitude": Plausible(0.0, 3.0, "size", "estimate: a larger force would hold the body in one tooth")
    }

    @staticmethod
    def law(q: Each, amplitude: Each, period: Each, phase: Each) -> Each:
        return amplitude * np.sin(6.283185307179586 * q / period + phase)

    def offers(self, place: Place, variant: str) -> bool:
        """Where a scan found a ripple, or nobody has scanned."""
        return variant == "" and (bool(place.ripples) or place.visited is None)

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Amplitude [the coordinate's force], period [position] and phase [rad], from the ripples that a scan found."""
        length, span = place.position_unit, place.span
        periods, phases = zip(*(place.ripples or ((place.reach, 0.0),)), strict=True)
        # Far beyond the longest it would not be seen to repeat.
        low, high = 0.2 * min(periods), 1.1 * max(periods)
        return (
            EffectParameter("amplitude", place.unit, 0.0, 20 * span, (0.3 * span,), 0.2 * span),
            EffectParameter("period", length, low, high, periods, 0.02 * min(periods)),
            EffectParameter("phase", "rad", -2 * TURN, 2 * TURN, phases, 0.3, place=True, paired=True),
        )


class EndStop(ForceEffect):
    """End stops: a spring and a damper beyond an edge, -K d - c d' for a depth d > 0, and they never pull.

    Definition: Kelvin's and Voigt's contact (Hunt and Crossley 1975, Coefficient of restitution interpreted as damping
    in vibroimpact, Journal of Applied Mechanics 42(2), section 1, whose own law has no jump at the edge).
    """

    family = "end_stop"
    function_of = "nothing"
    variants = ("", "lower", "upper")
    gated = False

    @staticmethod
    def law(
        q: Each, speed: Each, stiffness: Each, damping: Each, low: Each = -np.inf, high: Each = np.inf
    ) -> Each:
        above, below = np.maximum(q - high, 0.0), np.maximum(low - q, 0.0)
        down = np.sign(above) * np.maximum(stiffness * above + damping * speed, 0.0)
        up = np.sign(below) * np.maximum(stiffness * below - damping * speed, 0.0)
        return up - down

    def offers(self, place: Place, variant: str) -> bool:
        """Those at whose edge something pushed back."""
        lower, upper = (edge is not None for edge in place.edges)
        return {"": lower and upper, "lower": lower and not upper, "upper": upper and not lower}[variant]

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """The edges low and high [position], or one of them; stiffness and damping of what stands there."""
        length, unit = place.position_unit, place.unit
        lowest, highest = place.visited or (place.middle - place.reach, place.middle + place.reach)
        way = max(highest - lowest, 1e-9)
        usual, near = (lowest + INSIDE * way, highest - INSIDE * way), 0.02 * way
        low, high = (
            at if edge is None or np.isnan(edge) else edge
            for edge, at in zip(place.edges, usual, strict=True)
        )
        edges = {
            "low": EffectParameter("low", length, lowest - 0.1 * way, highest, (low,), near, place=True),
            "high": EffectParameter("high", length, lowest, highest + 0.1 * way, (high,), near, place=True),
        }
        kept = {"": ("low", "high"), "lower": ("low",), "upper": ("high",)}[variant]
        typical, brake = place.span / way, place.span / place.speed
        hard, stiff = 1e5 * typical, (10 * typical, 100 * typical)
        return (
            *(edges[name] for name in kept),
            EffectParameter("stiffness", f"{unit}/{length}", 0.0, hard, stiff, 10 * typical),
            EffectParameter("damping", f"{unit} s/{length}", 0.0, 1e3 * brake, (0.3 * brake,), 0.3 * brake),
        )


class CoulombFriction(ForceEffect):
    """Coulomb friction: -Fc sgn(q'), holding a body at rest up to Fc; Fc = mu N where the normal force N is known.

    Coulomb (1785); Armstrong-Helouvry, Dupont and Canudas de Wit (1994), Automatica 30(7), section 2.
    """

    family = "coulomb_friction"
    function_of = "speed"
    noun = "Coulomb friction"
    variants = ("", "coefficient")
    dry = True
    plausible = {
        "force": Plausible(
            0.0,
            3.0,
            "size",
            "the drive exceeds the friction, or nothing would move (EMPS axis: 20 N; Janot, Gautier and Brunot 2019)",
        ),
        "coefficient": Plausible(
            0.0,
            1.5,
            "1",
            "dry metals 0.4 to 0.8, rubber about 1 (Popov 2010, Contact Mechanics and Friction)",
        ),
    }

    @staticmethod
    def law(force: Each) -> Each:
        return force

    @staticmethod
    def by_load(load: Each, coefficient: Each) -> Each:
        """Of the normal force."""
        return coefficient * np.maximum(load, 0.0)

    laws = {"coefficient": "by_load"}

    def offers(self, place: Place, variant: str) -> bool:
        """The coefficient where the simulator knows the normal force."""
        return variant == "" or place.loaded

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Force [the coordinate's], or the dimensionless coefficient of the normal force."""
        if variant == "coefficient":
            return (EffectParameter("coefficient", "1", 0.0, 5.0, (0.1, 0.5), 0.1),)
        span = place.span
        return (EffectParameter("force", place.unit, -place.friction, 20 * span, (0.2 * span,), 0.2 * span),)


class LocalFrictionPatch(ForceEffect):
    """A friction patch: Coulomb friction on an interval of q only (a dirty or bent piece of the track).

    Coulomb (1785); the interval is the effect's region.
    """

    family = "local_friction_patch"
    sentence = "a patch of {on} brakes with a friction of {force}"
    function_of = "position"
    needs_region = True
    patch_of = "coulomb_friction"
    dry = True
    plausible = {"force": Plausible(0.0, 5.0, "size", "as Coulomb friction, if the motion overcomes it")}
    law = staticmethod(CoulombFriction.law)

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Force [the coordinate's] inside the region."""
        span = place.span
        return (EffectParameter("force", place.unit, 0.0, 20 * span, (0.3 * span,), 0.2 * span),)


class StribeckFriction(ForceEffect):
    """Stribeck friction: -(Fc + (Fs - Fc) exp(-(q'/vs)^2)) sgn(q'), holding a body at rest up to Fs.

    Stribeck (1902); Armstrong-Helouvry, Dupont and Canudas de Wit (1994), equation (6). At a robot's joint, whose
    sliding friction Fc is an effect of its own, `rise` is Fs - Fc.
    """

    family = "stribeck_friction"
    sentence = (
        "Stribeck friction on {on} ({static_force} at rest, {force} sliding, "
        "falling over {stribeck_velocity}) is missing"
    )
    function_of = "speed"
    noun = "Stribeck friction"
    variants = ("", RISE)
    dry = True
    plausible = {
        "force": Plausible(0.0, 3.0, "size", "as Coulomb friction"),
        "static_force": Plausible(
            0.0, 3.0, "size", "at rest at most twice the sliding force (Armstrong-Helouvry et al. 1994)"
        ),
        "rise": Plausible(0.0, 3.0, "size", "at rest at most twice the sliding force (same reference)"),
        "stribeck_velocity": Plausible(
            0.0, 0.5, "speed", "lubricated steel: some mm/s, a small part of the usual speed (same reference)"
        ),
    }

    @staticmethod
    def law(speed: Each, force: Each, static_force: Each, stribeck_velocity: Each) -> Each:
        """The sliding force, which grows to the static one, where that is larger, as the speed falls."""
        slow = speed / stribeck_velocity
        return force + np.maximum(static_force - force, 0.0) * np.exp(-(slow * slow))

    @staticmethod
    def rising(speed: Each, rise: Each, stribeck_velocity: Each) -> Each:
        """What it grows by, beside what slides."""
        slow = speed / stribeck_velocity
        return rise * np.exp(-(slow * slow))

    laws = {RISE: "rising"}

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Force (sliding), static_force or rise [the coordinate's], and stribeck_velocity [speed]."""
        span, speed, unit = place.span, place.speed, f"{place.position_unit}/s"
        name, most, near = "stribeck_velocity", 20 * span, 0.2 * speed
        if variant == RISE:  # what grows at lower speeds still nobody sees: bodies stick there
            starts = (0.1 * speed, 0.25 * speed, 0.5 * speed)
            return (
                EffectParameter(RISE, place.unit, 0.0, most, (0.1 * span,), 0.1 * span),
                EffectParameter(name, unit, 0.05 * speed, speed, starts, near),
            )
        return (
            EffectParameter("force", place.unit, 0.0, most, (0.15 * span,), 0.2 * span),
            EffectParameter("static_force", place.unit, 0.0, most, (0.4 * span,), 0.2 * span),
            EffectParameter(name, unit, 0.01 * speed, 2 * speed, (0.1 * speed, 0.4 * speed), near),
        )


class LoadFriction(ForceEffect):
    """Friction under load: -s abs(u) sgn(q'), holding a body at rest up to s abs(u): it grows with what a gear transmits.

    Definition: Coulomb friction whose normal force is the transmitted one, as in a worm gear or a harmonic drive
    (Hamon, Gautier and Garrec 2010, "Dynamic identification of robots with a dry friction model depending on load and
    velocity"). If a drive has its own law, u is its output. On a MuJoCo model it is asked as what friction
    rises by (`RISE`), of all joints together.
    """  # noqa: E501

    family = "load_friction"
    function_of = "nothing"
    noun = "friction under load"
    sentence = "friction on {on} of {share} times the driving force is missing"
    variants = ("", RISE)
    dry = True
    loaded_by_command = True
    gated = False
    plausible = {
        "share": Plausible(
            0.0,
            0.4,
            "1",
            "gears lose 2 % (one spur stage) to 40 % (four stages) of the transmitted force (data sheets)",
        )
    }

    @staticmethod
    def law(load: Each, share: Each) -> Each:
        return share * load

    def places(self, simulator: Simulator) -> tuple[str, ...]:
        """Coordinates of which it is known what drives them, of simulators that do not own their integration."""
        return () if callable(getattr(simulator, "rolled", None)) else super().places(simulator)

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Share, of what drives the coordinate."""
        return (EffectParameter("share", "1", 0.0, 2.0, (0.1,), 0.1),)


class LugreFriction(BristleEffect):
    """LuGre friction: -(k z + d z'), z' = v - k abs(v) z / g(v), g(v) = Fc + (Fs - Fc) exp(-(v/vs)^2).

    Canudas de Wit, Olsson, Astrom and Lischinsky (1995), "A new model for control of systems with friction", IEEE
    Transactions on Automatic Control 40(3). Bristles of stiffness k bend by z before anything slides; d = sqrt(k m), as
    in their example. Without Fs and vs it is Dahl's friction (1968) with that damping.
    """

    family = "lugre_friction"
    noun = "LuGre friction"
    sentence = "friction on {on} of {force} with presliding ({stiffness}) is missing"
    variants = ("", "stribeck")
    takes = {"force": np.nan, "static_force": 0.0, "stribeck_velocity": 1.0, "stiffness": np.nan}
    plausible = {
        "force": Plausible(0.0, 3.0, "size", "as Coulomb friction"),
        "static_force": Plausible(0.0, 3.0, "size", "as Stribeck friction"),
        "stribeck_velocity": Plausible(0.0, 0.5, "speed", "as Stribeck friction"),
    }
    asked = False  # a start in every way it may bend is dear, and it bends to other friction
    of_robots = True

    def offers(self, place: Place, variant: str) -> bool:
        """Both variants."""
        return True

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Force (sliding) and stiffness of the bristles; static_force and stribeck_velocity of the whole law."""
        span, speed, length = place.span, place.speed, place.position_unit
        low, high = place.visited or (place.middle - place.reach, place.middle + place.reach)
        force, whole, most = 0.2 * span, max(high - low, 1e-9), 20 * span
        stiff = tuple(force / (way * whole) for way in WAYS)
        ends = stiff[-1] / WIDER, stiff[0] * WIDER
        unit = f"{place.unit}/{length}"
        sliding = EffectParameter("force", place.unit, 0.0, most, (force,), 0.2 * span)
        bristles = EffectParameter("stiffness", unit, *ends, stiff, 0.3 * stiff[1], place=True)
        if not variant:
            return sliding, bristles
        still = EffectParameter("static_force", place.unit, 0.0, most, (1.5 * force,), 0.2 * span)
        slow = EffectParameter(
            "stribeck_velocity", f"{length}/s", 0.01 * speed, 2 * speed, (0.2 * speed,), 0.2 * speed
        )
        return sliding, still, slow, bristles
