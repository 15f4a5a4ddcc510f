"""Armature: what turns with a motor behind its gear weighs on the joint, and on nothing else.

Featherstone (2008), "Rigid Body Dynamics Algorithms", section 9.6: gear ratio squared times the rotor's inertia.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from gpsim.effects.effect import FunctionOf, ModelEffect
from gpsim.effects.place import EffectParameter, Place, Plausible


class Armature(ModelEffect):
    """Inertia of a rotor, reflected to its joint."""

    family: ClassVar[str] = "armature"
    acts_on: ClassVar[str] = "a joint"
    sentence: ClassVar[str] = "rotor inertia of {inertia} on {on} was left out"
    function_of: ClassVar[FunctionOf] = "nothing"
    noun: ClassVar[str] = "rotor inertia"
    plausible: ClassVar[Mapping[str, Plausible]] = {
        "inertia": Plausible(
            0.0,
            3.0,
            "size",
            "some 0.1 kg m^2 on small arms (MuJoCo Menagerie), as much as the load where gears are matched",
            least=1.0,
        ),
    }

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Inertia [the joint's: kg m^2 of a hinge, kg of a slide]."""
        span = place.span
        return (
            EffectParameter("inertia", place.unit, place.bounds[0], 20 * span, (0.2 * span,), 0.2 * span),
        )
