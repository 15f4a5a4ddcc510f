"""What a simulator has otherwise than was believed: its parameters, bodies of a model, and rates of a vessel."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from gpsim.channels import FloatArray
from gpsim.effects.effect import Each, ModelEffect, ParameterEffect, RateEffect, Values
from gpsim.effects.place import EffectParameter, Place, Plausible
from gpsim.simulators import Simulator

STEEPEST = 1.5  # rad
EDGE = 0.02  # of a rim, below it, within which a vessel begins to spill: a sharp one gives a fit no slope
RIMS, HIGHEST = (1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0), 50.0
"""Times the guess of a level that nobody measured, at which its rim is looked for, and the highest."""


class ParameterOffset(ParameterEffect):
    """A parameter of the simulator that differs from what was believed: p = ratio * p_believed.

    Definition: a ratio; for a parameter that may be 0, such as a position, an `offset`: p = p_believed + offset.
    """

    family = "parameter_offset"
    sentence = "{on} is {ratio} times its value in the simulator"
    function_of = "nothing"
    plausible = {
        "ratio": Plausible(
            0.25,
            4.0,
            "1",
            "mass errors are tens of per cent (Armstrong, Khatib and Burdick 1986); a neglected drive doubles a mass",
        )
    }

    @staticmethod
    def law(believed: Each, ratio: Each) -> Each:
        return believed * ratio

    @staticmethod
    def shifted(believed: Each, offset: Each) -> Each:
        """Of what may be 0."""
        return believed + offset

    laws = {"offset": "shifted"}

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Ratio [1]; for a parameter that may be 0, such as a position, the offset [its own]."""
        if place.additive:
            span, (low, high) = place.span, place.bounds
            return (EffectParameter("offset", place.unit, low, high, (0.1 * span,), 0.1 * span),)
        low, high = max(0.05, place.bounds[0]), min(20.0, place.bounds[1])
        start = 1.1 if high >= 1.1 else max(low, 0.9)
        return (EffectParameter("ratio", "1", low, high, (start,), 0.2, none=1.0),)


class Payload(ModelEffect):
    """A payload: a point mass carried by a body, which nobody told the simulator of.

    Steiner's theorem (1840) gives mass, centre of mass and moments of inertia of both together.
    """

    family = "payload"
    acts_on = "a body"
    sentence = "a payload of {mass} on {on}, at ({x}, {y}, {z}) in its frame, is missing"
    function_of = "nothing"
    plausible = {
        "mass": Plausible(
            0.0,
            5.0,
            "size",
            "payloads in data sheets: five times the mass of the last body, or half of the moving mass",
        )
    }

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Mass [kg], and where it sits in the body's frame: x, y, z [m]."""
        span, wide, near = place.span, 4 * place.reach, 0.3 * place.reach
        centre = place.centre or (0.0, 0.0, 0.0)
        return (
            EffectParameter("mass", "kg", 0.0, 20 * span, (0.2 * span,), 0.2 * span),
            *(
                EffectParameter(axis, "m", at - wide, at + wide, (at,), near, none=at, place=True)
                for axis, at in zip("xyz", centre, strict=True)
            ),
        )


class Armature(ModelEffect):
    """Armature: what turns with a motor behind its gear weighs on the joint, and on nothing else.

    Featherstone (2008), "Rigid Body Dynamics Algorithms", section 9.6: gear ratio squared times the rotor's inertia.
    """

    family = "armature"
    acts_on = "a joint"
    sentence = "rotor inertia of {inertia} on {on} is missing"
    function_of = "nothing"
    noun = "rotor inertia"
    plausible = {
        "inertia": Plausible(
            0.0,
            3.0,
            "size",
            "about 0.1 kg m^2 on small arms (MuJoCo Menagerie); equal to the load for a matched gear",
            least=1.0,
        )
    }

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Inertia [the joint's: kg m^2 of a hinge, kg of a slide]."""
        span, low = place.span, place.bounds[0]
        return (EffectParameter("inertia", place.unit, low, 20 * span, (0.2 * span,), 0.2 * span),)


class GravityTilt(ModelEffect):
    """A tilted base: gravity does not pull along the axis that the simulator believes.

    Definition: gravity in a base that was turned by roll about its x, then by pitch about its y.
    """

    family = "gravity_tilt"
    acts_on = "`gravity`"
    sentence = "the base is tilted by a roll of {roll} and a pitch of {pitch}"
    function_of = "nothing"
    noun = "a tilt of gravity"

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Roll and pitch [rad]."""
        return (
            EffectParameter("roll", "rad", -STEEPEST, STEEPEST, (0.05,), 0.05),
            EffectParameter("pitch", "rad", -STEEPEST, STEEPEST, (0.05, -0.05), 0.05),
        )


class GravityCompensation(ModelEffect):
    """Gravity compensation: a controller holds a robot against gravity, and its commands leave that torque out.

    Definition: the joints get u + s g(q) for the command u and what gravity asks of them, g(q), with a share s near 1.
    """

    family = "gravity_compensation"
    acts_on = "`gravity`"
    sentence = "the controller adds {share} times the torque against gravity to its commands"
    function_of = "nothing"
    noun = "gravity compensation"
    plausible = {
        "share": Plausible(0.8, 1.2, "1", "compensated by a model with mass errors of about ten per cent")
    }

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """The share [1], most of gravity at least: less is another gravity, or other masses."""
        return (EffectParameter("share", "1", 0.75, 1.25, (1.0,), 0.05),)


class Overflow(RateEffect):
    """An overflow: at its rim a level rises no further, whatever flows in.

    Definition: inflow above the rim is lost, as in a vessel that spills (the cascaded tanks of Schoukens,
    Mattsson, Wigren and Noel 2016 do). It acts on states of the first order, and is asked of channels whose readings
    stand at their highest value.
    """

    family = "overflow"
    sentence = "{on} overflows at {rim}"
    gated = False
    passes_on = False  # does what flows over reach what the vessel drains into?

    def places(self, simulator: Simulator) -> tuple[str, ...]:
        """States whose rate is their own: neither a coordinate nor its velocity."""
        return simulator.levels

    def offers(self, place: Place, variant: str) -> bool:
        """Where readings stand at the highest."""
        return variant == "" and place.read and place.stands[1]

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Rim [the channel's]; of a level that nobody measured it is looked for from the guess of it onwards."""
        if place.read:
            return (place.reading_end("rim", highest=True),)
        guess, starts = place.span, tuple(times * place.span for times in RIMS)
        return (
            EffectParameter("rim", place.unit, 0.0, HIGHEST * guess, starts, guess, place=True, falls=True),
        )

    def added(
        self, simulator: Simulator, state: FloatArray, action: FloatArray,
        parameters: Mapping[str, float | FloatArray], values: Values, on: str,
    ) -> FloatArray:  # fmt: skip
        """Minus what the full vessel would rise by, gradually over its edge; the same goes where it drains to."""
        column, row = simulator.rate.index(f"{on}_rate"), simulator.state.index(on)
        edge = EDGE * np.maximum(np.abs(values["rim"]), 1e-9)
        full = np.clip((state[:, row] - values["rim"]) / edge + 1.0, 0.0, 1.0)
        out = np.zeros((len(state), len(simulator.rate)))
        if not full.any():
            return out
        rates = simulator.rates(state, action, parameters)
        if self.passes_on:
            out = passed_on(simulator, state, action, parameters, on, edge)
        out[:, column] = -1.0
        return out * (full * np.maximum(rates[:, column], 0.0))[:, None]


class Spillover(Overflow):
    """A spillover: what flows over a rim reaches what the vessel drains into, in the proportion of what drains.

    Definition: as of an overflow, whose water is lost; a part of that of the cascaded tanks is not (Schoukens,
    Mattsson, Wigren and Noel 2016). It is asked where another level rises with this one, of channels whose readings
    stand at their highest value, and of levels that were not measured.
    """

    family = "spillover"
    sentence = "{on} overflows at {rim} into what it drains into"
    passes_on = True

    def offers(self, place: Place, variant: str) -> bool:
        """Where there is a next vessel: nobody knows of a hidden level where it stands."""
        return variant == "" and place.feeds and (place.stands[1] or not place.read)


def passed_on(
    simulator: Simulator, state: FloatArray, action: FloatArray,
    parameters: Mapping[str, float | FloatArray], on: str, step: FloatArray,
) -> FloatArray:  # fmt: skip
    """(B, R) what every rate gains of each unit by which a level drains faster once it is a step higher."""
    higher = np.array(state)
    higher[:, simulator.state.index(on)] += step
    gained = simulator.rates(higher, action, parameters) - simulator.rates(state, action, parameters)
    drained = -gained[:, simulator.rate.index(f"{on}_rate")]
    return np.maximum(gained / np.where(drained > 0.0, drained, np.inf)[:, None], 0.0)
