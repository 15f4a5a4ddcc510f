"""Friction under load: -s abs(u) sgn(q'), holding a body at rest up to s abs(u): it grows with what a gear transmits.

Definition: Coulomb friction whose normal force is the transmitted one, as in a worm gear or a harmonic drive (Hamon,
Gautier and Garrec 2010, "Dynamic identification of robots with a dry friction model depending on load and velocity").
Where a drive has a law of its own, u is what it gives. On a MuJoCo model it is asked as what friction rises by
(`RISE`), of all joints together.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from gpsim.effects.effect import RISE, ForceEffect, FunctionOf, Law
from gpsim.effects.place import EffectParameter, Place, Plausible
from gpsim.simulators import Simulator


def most(q: Any, speed: Any, load: Any, share: Any) -> Any:
    """The most that it can resist with."""
    return share * load


class LoadFriction(ForceEffect):
    """Friction under load: -s abs(u) sgn(q'), holding a body at rest up to s abs(u)."""

    family: ClassVar[str] = "load_friction"
    function_of: ClassVar[FunctionOf] = "nothing"
    noun: ClassVar[str] = "friction under load"
    sentence: ClassVar[str] = "friction on {on} of {share} times what drives it was left out"
    variants: ClassVar[tuple[str, ...]] = ("", RISE)
    loaded_by_command: ClassVar[bool] = True
    gated: ClassVar[bool] = False
    takes: ClassVar[Mapping[str, float]] = {"share": np.nan}
    dry_law: ClassVar[Law] = staticmethod(most)
    plausible: ClassVar[Mapping[str, Plausible]] = {
        "share": Plausible(
            0.0,
            0.4,
            "1",
            "gears: 2 % (one spur stage) to 40 % (four of them) of what they transmit (data sheets)",
        ),
    }

    def places(self, simulator: Simulator) -> tuple[str, ...]:
        """Coordinates of which it is known what drives them, of simulators that do not own their integration."""
        return () if callable(getattr(simulator, "rolled", None)) else super().places(simulator)

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Share, of what drives the coordinate."""
        return (EffectParameter("share", "1", 0.0, 2.0, (0.1,), 0.1),)
