"""Parameters that only act together: what of them the data fix, and which direction they leave open.

In logarithms a product of powers is a line. Where the covariance of the parameters' logarithms is long in some
directions and short in all others, the short ones are the products that the data fix. Asked are the parameters of the
leading account, and those that its rivals would change instead: who names a gain where another one names a mass says
that only their ratio is known.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction

import numpy as np
from scipy.linalg import qr
from scipy.special import stdtrit

from gpsim.channels import BoolArray, FloatArray, IntArray
from gpsim.diagnosis.assessment.estimates import informed, stopped
from gpsim.diagnosis.fitting import Fit, Hypothesis, Problem
from gpsim.findings import Combination

WIDE = 0.2
"""Standard deviation of a parameter's logarithm that leaves it open: its interval is a third to either side (a cart-
pole rig: a mass of 7.8 to 18.9 times, and a gain of 3 to its bound of 5, that only act together)."""
SHARPER = 5.0  # times better than its loosest parameter, that the data must know a product
FOLLOWS_BOUND = 10.0
"""Times what a value at its bound would vary with all others held, from which these follow it."""
TAKES_PART = 0.05  # of the largest component, below which a parameter takes no part
SIMPLE_EXPONENT = 0.08  # within which an exponent is the nearest whole number, half or third
LARGEST_DENOMINATOR = 3  # of an exponent that physics knows

UNITY = 1.0  # at which a factor does nothing: a gain, a ratio, a scale


def identifiable_combinations(
    problem: Problem, leader: Fit, rivals: Sequence[Fit]
) -> tuple[Combination, ...]:
    """What the data fix where they do not fix each parameter; empty where they do."""
    if not leader.hypothesis.terms:
        return ()
    own = len(leader.hypothesis.parameters)
    hypothesis = _with_factors_of(rivals, leader.hypothesis)
    theta = hypothesis.theta
    logs = np.flatnonzero(theta != 0.0)  # what is 0 has no logarithm, and may stand at any place
    if len(logs) < 2 or own == 0:
        return ()
    information = informed(problem, replace(leader, hypothesis=hypothesis)) * np.outer(theta, theta)
    if not np.isfinite(information).all():
        return ()  # a simulation ran away
    held = np.array([stopped(v, p.low, p.high) for p, v in zip(hypothesis.parameters, theta, strict=True)])
    freedom = max(len(problem.windows) - len(theta), 2)
    half = float(stdtrit(freedom, 0.5 + problem.run.settings.intervals.level / 2))
    found = [
        _product(hypothesis, logs[members], simple(powers), half * deviation)
        for members, products in open_groups(information[np.ix_(logs, logs)], held[logs])
        if (logs[members] < own).any()
        for powers, deviation in products
    ]
    return tuple(product for product in found if product is not None)


def open_groups(
    information: FloatArray, held: BoolArray
) -> list[tuple[IntArray, list[tuple[FloatArray, float]]]]:
    """Groups of parameters that leave a direction open, and the products that they fix.

    Of each product the exponents (K,) and the standard deviation of its logarithm. information: (P, P) on the
    logarithms; held: (P,) at a bound, which is no measurement however sure it looks.
    """
    values, vectors = np.linalg.eigh(information)
    # Of the logarithms each is as wide as its part in an open direction makes it.
    widths = np.abs(vectors) / np.sqrt(np.maximum(values, np.finfo(float).tiny))
    open_ = np.where(widths > WIDE, vectors, 0.0).T
    directions = [direction for direction in open_ if np.count_nonzero(direction) > 1]
    for i in np.flatnonzero(held):
        followed = _followed(information, int(i))
        if followed is not None and not any(direction[i] for direction in directions):
            directions.append(followed)
    if not directions:
        return []
    basis = np.stack(directions).T
    basis = basis * (np.abs(basis) >= TAKES_PART * np.abs(basis).max(axis=0))
    linked = (np.abs(basis) @ np.abs(basis).T > 0.0) | np.eye(len(basis), dtype=np.bool_)
    for _ in range(len(basis)):
        linked = linked @ linked
    label = linked.argmax(axis=1)  # the first of those that it is linked with
    closed = np.eye(len(basis)) - basis @ np.linalg.pinv(basis)
    known = np.linalg.pinv(closed @ information @ closed, hermitian=True)
    out = []
    for group in (np.flatnonzero(label == i) for i in np.unique(label)):
        part = basis[group][:, np.abs(basis[group]).sum(axis=0) > 0.0]
        if len(group) > part.shape[1] > 0:
            inside, loosest = known[np.ix_(group, group)], float(np.linalg.norm(widths[group], axis=1).max())
            products = [(w, float(np.sqrt(max(w @ inside @ w, 0.0)))) for w in _complement(part)]
            out.append((group, [(w, sd) for w, sd in products if SHARPER * sd < loosest]))
    return out


def _followed(information: FloatArray, index: int) -> FloatArray | None:
    """(P,) how the others go with one that is held at its bound; None where they would hold it, too."""
    others = np.arange(len(information)) != index
    follow = -np.linalg.lstsq(information[np.ix_(others, others)], information[others, index], rcond=None)[0]
    alone = information[index, index]
    left = alone + float(information[index, others] @ follow)
    if alone < FOLLOWS_BOUND**2 * max(left, 0.0):
        return None
    out = np.ones(len(information))
    out[others] = follow
    return out


def simple(exponents: FloatArray) -> FloatArray:
    """(K,) exponents, each rounded to a whole number, a half or a third where that is near."""
    near = [float(Fraction(float(e)).limit_denominator(LARGEST_DENOMINATOR)) for e in exponents]
    close = np.abs(near - exponents) <= SIMPLE_EXPONENT * np.maximum(1.0, np.abs(exponents))
    return np.where(close, near, exponents)


def _complement(directions: FloatArray) -> FloatArray:
    """(K - R, K): exponents of the products that do not change along `directions` (K, R), as simple as may be.

    Each product has one parameter of its own with the exponent 1, and those that all share.
    """
    count, rank = directions.shape
    order = qr(directions.T, mode="r", pivoting=True)[1]  # those that move most, and each by itself
    shared, rest = np.sort(order[:rank]), np.sort(order[rank:])
    out = np.zeros((count - rank, count))
    out[np.arange(count - rank), rest] = 1.0
    out[:, shared] = -np.linalg.lstsq(directions[shared].T, directions[rest].T, rcond=None)[0].T
    return out


def _product(
    hypothesis: Hypothesis, group: IntArray, exponents: FloatArray, half: float
) -> Combination | None:
    """The product of powers, its logarithm known to +- `half`; None of a parameter that stands alone."""
    used = np.flatnonzero(exponents)
    columns, powers = group[used], exponents[used]
    theta = hypothesis.theta[columns]
    whole = np.equal(np.mod(powers, 1.0), 0.0).all()
    if len(used) < 2 or (not whole and (theta < 0.0).any()):  # a root of what is negative
        return None
    value = float(np.prod(theta**powers))
    low, high = sorted((value * np.exp(-half), value * np.exp(half)))
    named = [
        f"{term.family} on {term.on}: {p.name}"
        for term, declared in zip(hypothesis.terms, hypothesis.declared, strict=True)
        for p in declared
    ]
    return Combination(
        of=tuple(named[i] for i in columns),
        fixed="",
        open="",
        exponents=tuple(map(float, powers)),
        value=value,
        low=float(low),
        high=float(high),
        unit=_unit([hypothesis.parameters[i].unit for i in columns], powers),
    )


def _unit(units: Sequence[str], powers: FloatArray) -> str:
    """The unit of a product, as `(N s/m) (N)^-1`; "1" where none is left."""
    total = {unit: float(powers[[other == unit for other in units]].sum()) for unit in dict.fromkeys(units)}
    left = {unit: power for unit, power in total.items() if power and unit != "1"}
    if list(left.values()) == [1.0]:
        return next(iter(left))
    parts = (f"({unit})" + ("" if power == 1.0 else f"^{power:g}") for unit, power in left.items())
    return " ".join(parts) or "1"


def _with_factors_of(rivals: Sequence[Fit], leader: Hypothesis) -> Hypothesis:
    """The leader, and at 1 the gains, ratios and scales that its rivals would change instead."""
    out = leader
    for rival in rivals:
        for term, declared in zip(rival.hypothesis.terms, rival.hypothesis.declared, strict=True):
            factor = len(declared) == 1 and declared[0].none == UNITY and not term.gate
            if factor and term.identity not in out.claims:
                out = out.plus(replace(term, values={declared[0].name: UNITY}), declared)
    return out
