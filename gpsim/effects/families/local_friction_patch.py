"""A friction patch: Coulomb friction on an interval of q only (a dirty or bent piece of the track).

Coulomb (1785); the interval is the effect's region.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from gpsim.channels import FloatArray
from gpsim.effects.effect import ForceEffect, FunctionOf, Values
from gpsim.effects.place import EffectParameter, Place, Plausible


class LocalFrictionPatch(ForceEffect):
    """A friction patch: Coulomb friction on an interval of q only (a dirty or bent piece of the track)."""

    family: ClassVar[str] = "local_friction_patch"
    sentence: ClassVar[str] = "a patch of {on} brakes with a friction of {force}"
    function_of: ClassVar[FunctionOf] = "position"
    needs_region: ClassVar[bool] = True
    patch_of: ClassVar[str | None] = "coulomb_friction"
    plausible: ClassVar[Mapping[str, Plausible]] = {
        "force": Plausible(0.0, 5.0, "size", "as Coulomb friction, where motion carries a body through"),
    }

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Force [the coordinate's] inside the region."""
        return (
            EffectParameter("force", place.unit, 0.0, 20 * place.span, (0.3 * place.span,), 0.2 * place.span),
        )

    def grip(
        self, position: FloatArray, speed: FloatArray, values: Values, load: FloatArray | None
    ) -> FloatArray | None:
        """The sliding force, which is also the most it can hold."""
        return values["force"] + 0.0 * speed
