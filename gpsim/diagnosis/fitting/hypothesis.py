"""A hypothesis: the terms that are said to be missing, how the truth is integrated, and its sizes as a fit has them.

In a fit's coordinates 0 does nothing, and sizes have a prior: what multiplies is fitted as a log ratio, what limits as
an inverse, all else as a difference from what does nothing. A mass of five times and a motor's gain of 0.002 then cost
evidence in the fit, and need no veto after it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from gpsim.channels import FloatArray
from gpsim.effects import (
    Chain,
    EffectParameter,
    Gate,
    Place,
    Scheme,
    Term,
    base_name,
    effect_of,
    own_name,
    owner_of,
    times_beyond,
)
from gpsim.simulators import Simulator

LOG_SIZE = (
    0.4  # standard deviation of a ratio's logarithm a priori: masses and gains are off by tens of per cent
)
WIDE = 15.0  # scales, the standard deviation of every other parameter a priori: it keeps open directions from running
SMALLEST_RATIO = 0.02  # of what multiplies: no machine has less
DIFFERENCE, RATIO, LIMIT = range(3)  # what a coordinate is: see above
SPELT_OUT = 4  # terms that a label names one by one; of more it counts those of a family


@dataclass(frozen=True)
class Hypothesis:
    """Terms with their parameter declarations (flattened, they are theta), and the integration scheme."""

    terms: tuple[Term, ...] = ()
    declared: tuple[tuple[EffectParameter, ...], ...] = ()
    scheme: Scheme = "fine"
    _made: dict[tuple[int, int, float], Chain] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )

    @property
    def parameters(self) -> tuple[EffectParameter, ...]:
        """All parameters in the order of theta (P,)."""
        return tuple(p for group in self.declared for p in group)

    @property
    def theta(self) -> FloatArray:
        """(P,) the terms' values."""
        return np.array(
            [t.values[p.name] for t, group in zip(self.terms, self.declared, strict=True) for p in group],
            dtype=float,
        )

    def times_beyond(self, index: int) -> float:
        """By which factor a term's sizes lie outside of what machines of the kind have, at most; 1 within."""
        values = self.terms[index].values
        return max((times_beyond(p, values[p.name]) for p in self.declared[index]), default=1.0)

    @property
    def claims(self) -> frozenset[tuple[str, str]]:
        """Family and place of every term."""
        return frozenset((term.family, on) for term in self.terms for on in term.places)

    @property
    def label(self) -> str:
        """A few words for progress and rankings."""
        if len(self.terms) > SPELT_OUT:
            counted = Counter(t.family for t in self.terms)
            return " + ".join(f"{count} {family}" for family, count in counted.items())
        return " + ".join(f"{t.family} on {t.on}" for t in self.terms) or "nothing missing"

    @property
    def names(self) -> tuple[str, ...]:
        """What each term claims, and behind which gate."""
        return tuple(
            f"{t.family} on {'+'.join(t.places)}{_behind(t.gate)}{_of_its_own(t)}" for t in self.terms
        )

    def having(self, theta: FloatArray) -> Hypothesis:
        """The same terms with the values theta (P,)."""
        value = iter(theta.tolist())
        terms = tuple(
            replace(term, values={**term.values, **{p.name: next(value) for p in group}})
            for term, group in zip(self.terms, self.declared, strict=True)
        )
        other = replace(self, terms=terms)
        other._made.update(self._made)  # what simulates it does not depend on its values
        return other

    def plus(self, term: Term, declared: tuple[EffectParameter, ...]) -> Hypothesis:
        """One term more."""
        return replace(self, terms=(*self.terms, term), declared=(*self.declared, declared))

    def without_all(self, indices: Collection[int]) -> Hypothesis:
        """Several terms less."""
        keep = [i for i in range(len(self.terms)) if i not in indices]
        return replace(
            self, terms=tuple(self.terms[i] for i in keep), declared=tuple(self.declared[i] for i in keep)
        )

    def without(self, index: int) -> Hypothesis:
        """One term less."""
        return self.without_all((index,))

    def gated(self, index: int, gate: Gate) -> Hypothesis:
        """One term behind another gate."""
        return self._changed(index, replace(self.terms[index], gate=gate), self.declared[index])

    def with_own(self, index: int, recording: int) -> Hypothesis:
        """One term with values of its own in one of several recordings, which begin as they are there now."""
        term, declared = self.terms[index], self.declared[index]
        own = tuple(
            replace(p, name=own_name(name, recording))
            for name, p in {base_name(p.name): p for p in declared}.items()
        )
        values = {p.name: term.values[base_name(p.name)] for p in own}
        return self._changed(index, replace(term, values={**term.values, **values}), (*declared, *own))

    def without_shared(self, index: int) -> Hypothesis:
        """One term that does nothing but in the recordings that have values of their own."""
        term, declared = self.terms[index], self.declared[index]
        nothing = {p.name: p.none for p in declared if owner_of(p.name) is None}
        own = tuple(p for p in declared if owner_of(p.name) is not None)
        return self._changed(index, replace(term, values={**term.values, **nothing}), own)

    def in_recording(self, recording: int | None) -> Hypothesis:
        """What it says of one of several recordings, without what does nothing there; None: of any other one."""
        terms = tuple(term.in_recording(recording) for term in self.terms)
        declared = tuple(
            tuple({base_name(p.name): replace(p, name=base_name(p.name)) for p in group}.values())
            for group in self.declared
        )
        nothing = [
            i
            for i, (term, group) in enumerate(zip(terms, declared, strict=True))
            if group and all(abs(term.values[p.name] - p.none) <= 1e-6 * p.scale for p in group)
        ]
        return replace(self, terms=terms, declared=declared).without_all(nothing)

    def _changed(self, index: int, term: Term, declared: tuple[EffectParameter, ...]) -> Hypothesis:
        terms, groups = list(self.terms), list(self.declared)
        terms[index], groups[index] = term, declared
        return replace(self, terms=tuple(terms), declared=tuple(groups))

    def frozen(self) -> Hypothesis:
        """The same terms with nothing left to fit."""
        return replace(self, declared=tuple(() for _ in self.terms))

    def chain(self, simulator: Simulator, parameters: Mapping[str, float], dt: float) -> Chain:
        """What simulates it, made once for all values of its parameters."""
        key = id(simulator), id(parameters), dt
        if key not in self._made:
            self._made[key] = Chain(simulator, parameters, self.terms, self.scheme, dt)
        return self._made[key]  # it holds the two, so that nothing else gets their id

    def spread(self, thetas: FloatArray, repeat: int) -> list[dict[str, FloatArray]]:
        """Thetas (C, P) -> one mapping a term of (C * repeat,) arrays: every copy's values for all its windows."""
        columns, out = np.repeat(thetas, repeat, axis=0), []
        column = iter(columns.T)
        for term, group in zip(self.terms, self.declared, strict=True):
            held = {name: np.full(len(columns), value) for name, value in term.values.items()}
            out.append(held | {p.name: next(column) for p in group})
        return out


@dataclass(frozen=True)
class Candidate:
    """A term that may be added, not yet fitted: where, with which law, and what its parameters are."""

    family: str
    place: Place
    variant: str
    declared: tuple[EffectParameter, ...]

    @property
    def identity(self) -> tuple[str, str]:
        """Family and place."""
        return self.family, self.place.on

    @property
    def name(self) -> str:
        """What it claims, in words."""
        return f"{self.family} on {self.place.on}"

    @property
    def gateable(self) -> bool:
        """Whether a region or an onset may limit it."""
        return effect_of(self.family).gated and self.variant == ""

    @property
    def only_gated(self) -> bool:
        """Whether it makes sense in a region only."""
        return effect_of(self.family).needs_region

    def term(self, values: Sequence[float]) -> Term:
        """The term with parameter values in declared order."""
        named = {p.name: float(v) for p, v in zip(self.declared, values, strict=True)}
        return Term(self.family, self.place.on, named, variant=self.variant)


def _behind(gate: Gate) -> str:
    """Where and since when a term acts, in a few words; empty where always and everywhere."""
    said = [f" for {name} in [{low:.4g}, {high:.4g}]" for name, (low, high) in gate.region.items()]
    if gate.since is not None:
        said.append(f" since {gate.since:.4g} s")
    if gate.since_episode is not None:
        said.append(f" since episode {gate.since_episode}")
    return "".join(said)


def _of_its_own(term: Term) -> str:
    """In which recordings, the first is 1, its values are their own."""
    return f" (own in recording {', '.join(str(k + 1) for k in term.owners)})" if term.owners else ""


@dataclass(frozen=True)
class Coordinates:
    """The coordinates (P,) of some parameters: kinds, and per coordinate its bounds, scale and prior deviation."""

    parameters: tuple[EffectParameter, ...]
    kind: FloatArray
    low: FloatArray
    high: FloatArray
    scale: FloatArray
    prior: FloatArray
    centre: FloatArray

    def natural(self, z: FloatArray) -> FloatArray:
        """(..., P) parameters in their units, of coordinates (..., P)."""
        out, ratio, limit = self.none + z, self.kind == RATIO, self.kind == LIMIT
        out[..., ratio] = np.exp(z[..., ratio])
        out[..., limit] = 1.0 / np.maximum(z[..., limit], self.tiny[limit])
        return np.asarray(out)

    def of(self, theta: FloatArray) -> FloatArray:
        """(P,) coordinates of parameters in their units."""
        out, ratio, limit = np.asarray(theta) - self.none, self.kind == RATIO, self.kind == LIMIT
        out[ratio] = np.log(np.maximum(theta[ratio], SMALLEST_RATIO))
        out[limit] = 1.0 / np.maximum(theta[limit], 1e-300)
        return np.asarray(np.clip(out, self.low, self.high))

    def slope(self, z: FloatArray) -> FloatArray:
        """(P,) by how much each parameter changes with its coordinate."""
        value = self.natural(z)
        return np.select([self.kind == RATIO, self.kind == LIMIT], [value, -(value**2)], 1.0)

    @property
    def none(self) -> FloatArray:
        """(P,) the parameters at which nothing happens."""
        return np.array([0.0 if p.falls else p.none for p in self.parameters])

    @property
    def tiny(self) -> FloatArray:
        """(P,) below which a limit's coordinate is taken for no limit at all."""
        return np.maximum(1e-6 * self.scale, 1e-300)


def coordinates(parameters: Sequence[EffectParameter]) -> Coordinates:
    """The fit coordinates of parameters, in their order."""
    rows = [_row(p) for p in parameters]
    table = np.array(rows, dtype=float).reshape(len(rows), 6)
    return Coordinates(tuple(parameters), *table.T)


def _row(p: EffectParameter) -> tuple[float, ...]:
    """Kind, low, high, scale, prior deviation and the prior's centre."""
    if p.falls:
        typical = p.starts[0] if p.starts[0] > 0 else p.scale
        return LIMIT, 0.0, 1.0 / max(p.low, 0.05 * typical), 0.3 / typical, WIDE / typical, 0.0
    if p.none == 1.0 and p.high > 0.0:
        low = max(p.low, SMALLEST_RATIO)
        prior, centre = LOG_SIZE, 0.0
        if p.believed is not None:
            prior, centre = p.believed[1] / max(p.believed[0], low), float(np.log(max(p.believed[0], low)))
        return RATIO, np.log(low), np.log(max(p.high, 2 * low)), 0.3, prior, centre
    prior, centre = WIDE * p.scale, p.starts[0] - p.none if p.place else 0.0
    if p.believed is not None:
        prior, centre = p.believed[1], p.believed[0] - p.none
    return DIFFERENCE, p.low - p.none, p.high - p.none, p.scale, prior, centre
