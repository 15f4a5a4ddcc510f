"""An account: the laws that stand, fitted; what they cost, what leaving some of them out would, and how it is told."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from gpsim.channels import FloatArray, IntArray
from gpsim.diagnosis.fitting import Fit, Hypothesis, coordinates
from gpsim.diagnosis.ladder.laws import Law
from gpsim.effects import RISE, Place, declared, effect_of

OPEN = 1e-13  # of the largest curvature: a direction that is flatter is open


@dataclass(frozen=True)
class Account:
    """Laws, in the order of the hypothesis's terms, and where their fit stands."""

    laws: tuple[Law, ...]
    fit: Fit

    @property
    def hypothesis(self) -> Hypothesis:
        """The laws with their sizes."""
        return self.fit.hypothesis

    @property
    def rows(self) -> list[slice]:
        """Of each law its coordinates."""
        ends = np.cumsum([0, *(len(group) for group in self.hypothesis.declared)])
        return [slice(int(a), int(b)) for a, b in pairwise(ends)]

    def sizes(self, index: int) -> IntArray:
        """The coordinates of a law at which it does nothing when they are 0."""
        first, group = self.rows[index].start, self.hypothesis.declared[index]
        sizes = [first + i for i, p in enumerate(group) if not p.place]
        return np.array(sizes or range(first, first + len(group)))

    def holds(self, law: Law) -> bool:
        """Whether a law stands in it."""
        return any(law.key == own.key for own in self.laws)

    def plus(self, law: Law, values: Sequence[float]) -> tuple[tuple[Law, ...], Hypothesis]:
        """With a law more, at these values of its parameters; not yet fitted."""
        return (*self.laws, law), self.hypothesis.plus(law.term(values), law.candidate.declared)

    def without(self, gone: Sequence[int]) -> tuple[tuple[Law, ...], Hypothesis]:
        """Without some laws, the others as they are."""
        laws = tuple(law for i, law in enumerate(self.laws) if i not in set(gone))
        return laws, self.hypothesis.without_all(gone)


def bill(laws: Sequence[Law], effective: float, per_law: float) -> float:
    """Nats that an account costs by its laws: the BIC of their parameters (Schwarz 1978), and what each must bring."""
    return sum(price(law, effective, per_law) for law in laws)


def price(law: Law, effective: float, per_law: float) -> float:
    """Nats that one law must bring; what every joint of a robot has costs one (Akaike 1974)."""
    if law.of_row:
        return 1.0
    return (
        float(0.5 * law.parameters * np.log(max(effective, 2.0))) + (0.0 if law.free else per_law) + law.price
    )


@dataclass(frozen=True)
class Less:
    """A law that may go: which, what that costs by the quadratic [nats], and where the others then are, z (P,)."""

    index: int
    cost: float
    z: FloatArray


class Quadratic:
    """An account's cost around its fit, as the quadratic that its information makes (Wald 1943)."""

    def __init__(self, account: Account) -> None:
        self.account = account
        h = account.fit.information
        scale = 1.0 / np.sqrt(np.maximum(np.diag(h), 1e-300)) if len(h) else np.empty(0)
        self._inverse = (
            np.linalg.pinv(h * scale[:, None] * scale, rcond=OPEN) * scale[:, None] * scale if len(h) else h
        )

    def cost(self, index: int) -> float:
        """Nats that leaving out one law would cost, all others adapted."""
        return self._cost(self.account.sizes(index), self.account.fit.z, self._inverse)

    def _cost(self, at: IntArray, z: FloatArray, inverse: FloatArray) -> float:
        block = inverse[np.ix_(at, at)]
        return float(0.5 * z[at] @ np.linalg.lstsq(block, z[at], rcond=1e-12)[0])

    def without(self, gone: Sequence[int]) -> FloatArray:
        """(P,) coordinates without some laws: theirs at nothing, the others where the cost is least then."""
        z = self.account.fit.z.copy()
        if gone:
            at = np.concatenate([self.account.sizes(i) for i in gone])
            block = self._inverse[np.ix_(at, at)]
            z -= self._inverse[:, at] @ np.linalg.lstsq(block, z[at], rcond=1e-12)[0]
        return z

    def taken_away(
        self, prices: Sequence[float], kept: Sequence[bool], first: int | None = None
    ) -> list[Less]:
        """The laws that cost less than their prices, one by one, the cheapest against its price first.

        first: one that goes before them.
        """
        account, h = self.account, self.account.fit.information
        rows = account.rows
        z, left, gone = account.fit.z.copy(), [i for i in range(len(rows)) if not kept[i]], list[Less]()
        alive = np.ones(len(z), dtype=bool)
        while left:
            at = np.flatnonzero(alive)
            scale = 1.0 / np.sqrt(np.maximum(np.diag(h)[at], 1e-300))
            inverse = (
                np.linalg.pinv(h[np.ix_(at, at)] * scale[:, None] * scale, rcond=OPEN)
                * scale[:, None]
                * scale
            )
            place = {int(i): k for k, i in enumerate(at)}
            costs = {}
            for i in left:
                own = np.array([place[int(k)] for k in account.sizes(i)])
                costs[i] = self._cost(own, z[at], inverse)
            best = first if first in left else min(left, key=lambda i: costs[i] - prices[i])
            if costs[best] > prices[best]:
                break
            own = np.array([place[int(k)] for k in account.sizes(best)])
            block = inverse[np.ix_(own, own)]
            z[at] -= inverse[:, own] @ np.linalg.lstsq(block, z[at][own], rcond=1e-12)[0]
            alive[rows[best]] = False
            z[rows[best]] = 0.0
            left.remove(best)
            gone.append(Less(best, max(costs[best], 0.0), z.copy()))
        return gone


def placed(hypothesis: Hypothesis, z: FloatArray) -> Hypothesis:
    """The hypothesis at coordinates z (P,), within its bounds."""
    own = coordinates(hypothesis.parameters)
    return hypothesis.having(own.natural(np.clip(z, own.low, own.high)))


def told(account: Account) -> Hypothesis:
    """The account's laws as they are told.

    What Stribeck friction adds and the dry friction beside it are one law, where that may be simulated at once.
    """
    hypothesis = account.hypothesis
    for law in account.laws:
        place = law.candidate.place
        if law.candidate.family == "stribeck_friction" and law.candidate.variant == RISE:
            hypothesis = _with_stribeck(hypothesis, place)
    return hypothesis


def _index(hypothesis: Hypothesis, family: str, on: str) -> int | None:
    return next(
        (i for i, t in enumerate(hypothesis.terms) if t.identity == (family, on) and not t.gate), None
    )


def _with_stribeck(hypothesis: Hypothesis, place: Place) -> Hypothesis:
    index, dry = (_index(hypothesis, f, place.on) for f in ("stribeck_friction", "coulomb_friction"))
    if index is None or (dry is not None and "force" not in hypothesis.terms[dry].values):
        return hypothesis
    rise = hypothesis.terms[index]
    force = hypothesis.terms[dry].values["force"] if dry is not None else 0.0
    values = {"force": force, "static_force": force + rise.values[RISE]}
    values["stribeck_velocity"] = rise.values["stribeck_velocity"]
    own = declared(effect_of("stribeck_friction"), place)
    rest = hypothesis.without_all([i for i in (index, dry) if i is not None])
    return rest.plus(replace(rise, values=values, variant=""), own)
