"""Whether the data know how large an effect is: what is not told from nothing is no size."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

from gpsim.diagnosis.report.effects import Estimate
from gpsim.effects import FAMILIES, EffectParameter, Place, base_name

WIDEST = 2.0  # times a size: an interval that is wider does not know it
NOTHING = 3 * WIDEST  # times a size: of one that is as wide nothing is known at all


def sized(family: str, parameters: Mapping[str, Estimate]) -> bool:
    """Whether some parameter's interval excludes what does nothing, and is not wider than twice the size.

    One is enough: of two gains one may be as it should, of a law's shape little need be known.
    """
    return _some(family, parameters, WIDEST)


def no_size(family: str, parameters: Mapping[str, Estimate]) -> bool:
    """Whether nothing is known of any parameter: 0 +- 1100 N."""
    return not _some(family, parameters, NOTHING)


def _some(family: str, parameters: Mapping[str, Estimate], widest: float) -> bool:
    known = _declared(family)
    sizes = [(p, known.get(base_name(name))) for name, p in parameters.items()]
    asked = [(p, d.none if d else 0.0) for p, d in sizes if d is None or not d.place]
    return not asked or any(_known(p, none, widest) for p, none in asked)


def _known(size: Estimate, none: float, widest: float) -> bool:
    if size.low is None or size.high is None:
        return False
    outside = widest > WIDEST or not size.low <= none <= size.high
    return outside and size.high - size.low <= widest * abs(size.value - none)


@cache
def _declared(family: str) -> Mapping[str, EffectParameter]:
    """The parameters of a family of the catalogue by name; none of another's."""
    if family not in FAMILIES:
        return {}
    effect, place = FAMILIES[family], Place("q", "1", loaded=True)
    return {p.name: p for variant in effect.variants for p in effect.parameters(place, variant)}
