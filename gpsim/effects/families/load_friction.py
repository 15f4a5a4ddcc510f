"""Friction under load: -mu abs(u) sgn(q'), holding a body at rest up to mu abs(u): it grows with what the gear transmits.

Definition: Coulomb friction whose normal force is the transmitted one, as in a worm gear or a harmonic drive (Hamon,
Gautier and Garrec 2010, Dynamic identification of robots with a dry friction model depending on load and velocity, IROS).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from gpsim.effects.effect import ForceEffect, FunctionOf, Law
from gpsim.effects.place import EffectParameter, Place, Plausible


def most(q: Any, speed: Any, load: Any, coefficient: Any) -> Any:
    """The most that it can resist with."""
    return coefficient * load


class LoadFriction(ForceEffect):
    """Friction under load: -mu abs(u) sgn(q'), holding a body at rest up to mu abs(u)."""

    family: ClassVar[str] = "load_friction"
    function_of: ClassVar[FunctionOf] = "nothing"
    noun: ClassVar[str] = "friction under load"
    sentence: ClassVar[str] = "friction on {on} of {coefficient} times what drives it was left out"
    loaded_by_command: ClassVar[bool] = True
    gated: ClassVar[bool] = False
    takes: ClassVar[Mapping[str, float]] = {"coefficient": np.nan}
    dry_law: ClassVar[Law] = staticmethod(most)
    plausible: ClassVar[Mapping[str, Plausible]] = {
        "coefficient": Plausible(0.0, 0.9, "1", "gears: 2 % (spur) to 70 % (worm) of what they transmit (data sheets)"),
    }

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Coefficient, of the command that drives the coordinate."""
        return (EffectParameter("coefficient", "1", 0.0, 2.0, (0.1,), 0.1),)
