"""Whether a size is one that machines have."""

from __future__ import annotations

from dataclasses import replace

from gpsim.effects.effect import Effect
from gpsim.effects.place import EffectParameter, Place

LEAST = 1e-6  # of the usual range's lower end: a size of 0 is no further out


def declared(effect: Effect, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
    """What has to be known of an effect at a place, with the sizes that are usual there."""
    return tuple(
        replace(p, plausible=effect.plausible[p.name].at(place)) if p.name in effect.plausible else p
        for p in effect.parameters(place, variant)
    )


def times_beyond(parameter: EffectParameter, value: float) -> float:
    """By which factor a size lies outside of the usual ones; 1 within them, and where nobody says what is usual."""
    if parameter.plausible is None:
        return 1.0
    low, high = parameter.plausible
    size = value if low > 0.0 else abs(value - parameter.none)  # a ratio below 0 turns things round
    if size > high:
        return size / high
    return low / max(size, LEAST * low) if size < low else 1.0
