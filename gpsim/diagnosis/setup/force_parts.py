"""What may be missing of the forces that a robot's motion took, and the least squares that sizes it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.optimize import lsq_linear

from gpsim.channels import FloatArray
from gpsim.diagnosis.fitting import Candidate
from gpsim.effects import RISE, EffectParameter, Term

ROUNDS, WAIT, SURE = 7, 2, 1e12
"""Rounds of weights by what is left at each joint; in the first of them gains stay as believed, or what rows have not
yet explained would pass for noise that a smaller gain makes less."""
NARROW = 1e-9  # of what a joint lacks, below which it is known without noise
NOTHING = 1e-6  # of its usual size, which is none
HELD, GAIN = "gravity_compensation", "actuator_gain"
MASS, STIFF = ".mass", ".kp"
"""How the parameters of a MuJoCo model end that are masses of bodies, and gains of position servos."""
SLIGHT = 0.01  # of a gain, below which filters and a clock's grid explain it as well


@dataclass(frozen=True)
class Offer:
    """A candidate, and what else it acts on alike: the servos of an arm are of one make.

    fixed: values of its last parameters, which are not asked.
    """

    candidate: Candidate
    also: tuple[str, ...] = ()
    fixed: tuple[float, ...] = ()

    @property
    def declared(self) -> tuple[EffectParameter, ...]:
        """Its parameters that are asked."""
        return self.candidate.declared[: len(self.candidate.declared) - len(self.fixed)]

    @property
    def family(self) -> str:
        """Its family."""
        return self.candidate.family

    @property
    def places(self) -> frozenset[tuple[str, str]]:
        """Family and place of all that it claims."""
        return frozenset((self.family, on) for on in (self.candidate.place.on, *self.also))

    @property
    def rises(self) -> bool:
        """Whether it is by how much a joint's dry friction grows."""
        return self.candidate.variant == RISE

    @property
    def of_command(self) -> bool:
        """Whether it scales what a motor makes of its command."""
        return self.family == GAIN or self.candidate.place.on.endswith(STIFF)

    def term(self, values: Sequence[float]) -> Term:
        """The term with these values."""
        return replace(self.candidate.term((*values, *self.fixed)), also=self.also)


def offered(candidates: Sequence[Candidate]) -> list[Offer]:
    """Each by itself, and the gains of all position servos together; no share of a target, which no servo mistakes."""
    stiff = [c for c in candidates if c.place.on.endswith(STIFF)]
    together = [Offer(stiff[0], tuple(c.place.on for c in stiff[1:]))] if len(stiff) > 1 else []
    servos = {(GAIN, c.place.on.removesuffix(STIFF)) for c in stiff}
    return [*together, *(Offer(c) for c in candidates if c.identity not in servos)]


@dataclass(frozen=True, eq=False)
class Part:
    """What may be missing: columns (P, K, C) of forces of size 1, bounds and usual sizes (P,), whence its values.

    centre: where a payload's moments are counted from. gain: whether it scales what was measured.
    """

    offer: Offer | None
    columns: FloatArray
    low: FloatArray
    high: FloatArray
    usual: FloatArray
    centre: FloatArray = field(default_factory=lambda: np.empty(0))
    gain: bool = False

    def sensible(self, sizes: FloatArray) -> bool:
        """Whether it is not slight nor held by a bound: a payload has its mass where its moments say, near its body."""
        assert self.offer is not None
        if self.gain and abs(sizes[0]) < SLIGHT:
            return False
        held = (sizes <= self.low + NOTHING * self.usual) | (sizes >= self.high)
        if held.any() or not len(self.centre):
            return not held.any()
        at, declared = self.centre + sizes[1:] / sizes[0], self.offer.declared[1:]
        return all(p.low < x < p.high for x, p in zip(at, declared, strict=True))

    def values(self, sizes: FloatArray) -> tuple[float, ...]:
        """The candidate's values, within its bounds."""
        assert self.offer is not None
        declared = self.offer.declared
        said = np.array([p.none for p in declared]) + sizes
        if len(self.centre):
            said = np.concatenate([sizes[:1], self.centre + sizes[1:] / max(sizes[0], np.finfo(float).tiny)])
        return tuple(float(np.clip(v, p.low, p.high)) for v, p in zip(said, declared, strict=True))


@dataclass(frozen=True)
class Sized:
    """A least squares: sizes of columns, what is left at each joint (variances), log evidence, covariance (P, P)."""

    sizes: FloatArray
    left: FloatArray
    evidence: float
    covariance: FloatArray


def split(parts: Sequence[Part], fit: Sized) -> list[tuple[Part, FloatArray]]:
    """Every part with its own sizes."""
    ends = np.cumsum([len(part.usual) for part in parts])
    return list(zip(parts, np.split(fit.sizes, ends[:-1]), strict=True))


def least_squares(lacks: FloatArray, parts: Sequence[Part], left: FloatArray | None = None) -> Sized:
    """Sizes of all parts by what is lacking (K, C), each joint weighed by what is left there.

    A gain scales its motors' noise along with all that they are asked for: the density of what was measured counts as
    often, or a smaller gain would always explain more.
    """
    columns = np.concatenate([part.columns for part in parts])
    low, high, usual = (np.concatenate([getattr(p, n) for p in parts]) for n in ("low", "high", "usual"))
    count = np.maximum((lacks != 0.0).sum(axis=0), 1)  # rows that tell of each joint
    whole = (lacks**2).sum(axis=0) / count
    least = NARROW * whole + np.finfo(float).tiny
    left = whole + least if left is None else left
    scaled = columns * usual[:, None, None]
    grams, ways = np.einsum("pkc,qkc->cpq", scaled, scaled), np.einsum("pkc,kc->cp", scaled, lacks)
    gains = np.concatenate([np.full(len(p.usual), p.gain) for p in parts])
    largest = np.abs(columns).max(axis=1)
    scales = np.where(gains, (largest > NOTHING * largest.max(axis=1, keepdims=True)) @ count, 0.0)
    sizes, precision = np.zeros(len(usual)), np.eye(len(usual))
    for round_ in range(ROUNDS):
        waits = SURE * (scales > 0) * (round_ < WAIT)
        slope = usual / (1.0 + np.where(scales > 0, sizes * usual, 0.0))  # of the logarithm of a gain
        precision = (
            np.eye(len(usual)) + np.tensordot(1.0 / left, grams, 1) + np.diag(scales * slope**2 + waits)
        )
        root = np.linalg.cholesky(precision)
        wanted = (ways / left[:, None]).sum(axis=0) + scales * slope * (1.0 + slope * sizes)
        said = np.linalg.solve(root, wanted)
        sizes = np.linalg.solve(root.T, said)
        if (sizes * usual < low).any() or (sizes * usual > high).any():
            sizes = lsq_linear(root.T, said, (low / usual, high / usual)).x
        left = ((lacks - np.tensordot(sizes, scaled, 1)) ** 2).sum(axis=0) / count + least
    more = scales[scales > 0] @ np.log1p((sizes * usual)[scales > 0])
    noise = count @ np.log(left) - 2.0 * more
    evidence = -0.5 * (noise + sizes @ sizes + np.linalg.slogdet(precision)[1])
    covariance = np.asarray(np.linalg.inv(precision) * np.outer(usual, usual), dtype=np.float64)
    return Sized(sizes * usual, left, float(evidence), covariance)
