"""What one drive does to two joints in a row, because it turns with the sum or the difference of their speeds.

So turn the last motor of many wrists, whose gears are carried by the joint before, belts that run past an elbow, both
motors of a differential, and the tendons of a finger. What brakes such a motor brakes both joints: with s = q1' + q2'
its torque acts on both alike, with s = q1' - q2' on the second one the other way round.
"""

from __future__ import annotations

from gpsim.effects.effect import ModelEffect
from gpsim.effects.place import EffectParameter, Place, Plausible


class CoupledFriction(ModelEffect):
    """Coupled dry friction: -Fc sgn(s) of a drive that turns with s = q1' + q2', or q1' - q2', on both joints.

    Coulomb (1785) and virtual work, as of a coupled wrist in Janot, Vandanjon and Gautier (2014), Control Engineering
    Practice 25.
    """

    family = "coupled_friction"
    acts_on = "two joints in a row"
    sentence = (
        "dry friction of {force} in a drive that turns with {on}, and so brakes both joints, is missing"
    )
    function_of = "nothing"
    noun = "coupled dry friction"
    gated = False
    plausible = {
        "force": Plausible(0.0, 3.0, "size", "as Coulomb friction on the stronger of the two joints")
    }

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Force [the joints']."""
        span = place.span
        return (EffectParameter("force", place.unit, 0.0, 20 * span, (0.2 * span,), 0.2 * span),)


class CoupledDamping(ModelEffect):
    """Coupled viscous friction: -b s of a drive that turns with s = q1' + q2', or q1' - q2', on both joints.

    Stokes' law and virtual work, as of a coupled wrist in Janot, Vandanjon and Gautier (2014), Control Engineering
    Practice 25.
    """

    family = "coupled_damping"
    acts_on = "two joints in a row"
    sentence = (
        "viscous friction with damping {damping} in a drive that turns with {on}, and so brakes both joints, "
        "is missing"
    )
    function_of = "nothing"
    noun = "coupled viscous friction"
    gated = False
    plausible = {
        "damping": Plausible(
            0.0, 3.0, "size / speed", "as viscous friction on the stronger of the two joints"
        )
    }

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Damping [force per speed]."""
        typical, unit = place.span / place.speed, f"{place.unit} s/{place.position_unit}"
        return (EffectParameter("damping", unit, 0.0, 100 * typical, (0.2 * typical,), 0.2 * typical),)


class CoupledArmature(ModelEffect):
    """Coupled rotor inertia: what turns with s = q1' + q2', or q1' - q2', resists the acceleration of both joints.

    Featherstone (2008), "Rigid Body Dynamics Algorithms", section 9.6, with the speed of a rotor that two joints turn.
    """

    family = "coupled_armature"
    acts_on = "two joints in a row"
    sentence = (
        "rotor inertia of {inertia} in a drive that turns with {on}, and so loads both joints, is missing"
    )
    function_of = "nothing"
    noun = "coupled rotor inertia"
    gated = False
    plausible = {
        "inertia": Plausible(0.0, 3.0, "size", "as a rotor on the heavier of the two joints", least=1.0)
    }

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Inertia [the joints': kg m^2 of hinges, kg of slides]."""
        span = place.span
        return (EffectParameter("inertia", place.unit, 0.0, 20 * span, (0.2 * span,), 0.2 * span),)
