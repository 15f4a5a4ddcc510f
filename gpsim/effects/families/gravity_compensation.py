"""Gravity compensation: a controller holds a robot against gravity, and its commands leave that torque out.

Definition: the joints get u + s g(q) for the command u and what gravity asks of them, g(q), with a share s near 1.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from gpsim.effects.effect import FunctionOf, ModelEffect
from gpsim.effects.place import EffectParameter, Place, Plausible


class GravityCompensation(ModelEffect):
    """Torque against gravity that a controller adds to its commands, as a share of what gravity asks for.

    Most of gravity at least: less is another gravity, or other masses.
    """

    family: ClassVar[str] = "gravity_compensation"
    acts_on: ClassVar[str] = "`gravity`"
    sentence: ClassVar[str] = "the controller adds {share} times the torque against gravity to its commands"
    function_of: ClassVar[FunctionOf] = "nothing"
    noun: ClassVar[str] = "gravity compensation"
    plausible: ClassVar[Mapping[str, Plausible]] = {
        "share": Plausible(0.8, 1.2, "1", "compensated by a model whose masses are off by some ten per cent"),
    }

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """The share [1]."""
        return (EffectParameter("share", "1", 0.75, 1.25, (1.0,), 0.05),)
