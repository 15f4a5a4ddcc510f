"""A measured curve in the place of a law: its knots, its band, the named laws that are nearest to it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from gpsim.diagnosis.report.codec import OMITTED

Claims = tuple[tuple[str, str], ...]


@dataclass(frozen=True, kw_only=True)
class NearestLaw:
    """A law of the catalogue, or two together, fitted to a curve.

    effects: family and place of each; parameters: by `family.name`; misses: the share of what the curve does, on
    squares over what was visited, that it misses; differs: the part of the input, in its unit, that holds most of that;
    values: the law at the curve's knots.
    """

    effects: Claims
    parameters: Mapping[str, float]
    misses: float
    differs: tuple[float, float] | None = None
    values: tuple[float, ...] = ()


@dataclass(frozen=True, kw_only=True)
class FoundForm:
    """A closed form that follows a curve, and that is in no catalogue: form found, not known.

    form: its name; formula: of `x`, the input, with its numbers; parameters: by name; misses: as of `NearestLaw`.
    """

    form: str
    formula: str
    parameters: Mapping[str, float]
    misses: float


@dataclass(frozen=True, kw_only=True)
class MeasuredCurve:
    """A law that was measured: piecewise linear between its knots.

    quantity: what it gives (`force on q`), in `unit`; input: of what, in `input_unit`; at: (K,) the knots; values: (K,)
    the curve there, low, high its 90 % band; visited: from where to where the recording went: outside, what the curve
    adds to the base is held, which is extrapolation; freedom: its effective parameters. second, second_at: the other
    input of a map and its (M,) knots; values are then (M * K,), those of the first second knot first. nearest: the
    catalogue's laws that come nearest, the best first; found: a closed form that follows it.
    """

    quantity: str
    unit: str
    input: str
    input_unit: str
    at: tuple[float, ...]
    values: tuple[float, ...]
    low: tuple[float, ...] = ()
    high: tuple[float, ...] = ()
    visited: tuple[float, float]
    freedom: float
    second: str | None = field(default=None, metadata=OMITTED)
    second_unit: str | None = field(default=None, metadata=OMITTED)
    second_at: tuple[float, ...] | None = field(default=None, metadata=OMITTED)
    nearest: tuple[NearestLaw, ...] = ()
    found: FoundForm | None = field(default=None, metadata=OMITTED)
