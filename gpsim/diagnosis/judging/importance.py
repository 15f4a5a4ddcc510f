"""Importance and need: how much of the explained share is an effect's, and what it loses without it.

Importance is the Shapley value (Shapley 1953) of the effects as players, a subset's worth being the share that it
explains with its own effects on and the others off, parameters as fitted: effects that explain the same share it, and
the values add up to what all explain. Alone it ranks redundant effects too high, so that need stands beside it: the
share that goes when an effect goes and the others are fitted anew.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from math import factorial

import numpy as np

from gpsim.channels import FloatArray
from gpsim.diagnosis.fitting import Hypothesis
from gpsim.diagnosis.judging.judges import LossEvaluator

MOST = 6  # players at most: 64 subsets


def importances(
    judge: LossEvaluator,
    account: Hypothesis,
    whole: FloatArray,
    explained: FloatArray,
    needed: FloatArray,
    *,
    dear: bool = False,
) -> FloatArray:
    """(T, 1 + D) the Shapley values of the account's T terms, on all blocks and on each draw.

    whole: (1 + D,) the worth of all terms; explained: (1 + D,) what they are to add up to: a little less where the
    account is judged in parts of the recording that its parameters have not seen. Of a large account the families are
    the players, and what a family is worth its terms share as they are needed, (T,). dear: every subset costs
    simulations of a robot; of many players the mean of coming first and coming last then stands for all orders.
    """
    groups = players(account)
    count = len(groups)
    few = dear and count > ALL_ORDERS
    sizes = sorted({1, count - 1}) if few else range(1, count)
    subsets = [s for n in sizes if 0 < n < count for s in combinations(range(count), n)]
    worth = {frozenset[int](): np.zeros_like(whole), frozenset(range(count)): whole}
    if subsets:
        kept = [[term for i in subset for term in groups[i]] for subset in subsets]
        found = judge.mismatch.overall(judge.squares([[_only(account, terms)] for terms in kept]))
        worth |= dict(zip(map(frozenset, subsets), found, strict=True))
    shares = np.array([(_ends if few else _shapley)(i, count, worth) for i in range(count)])
    total = shares.sum(axis=0) if few else whole
    shares *= explained / np.where(total > 0.0, total, 1.0)
    out = np.empty((len(account.terms), *whole.shape))
    for share, group in zip(shares, groups, strict=True):
        weights = np.maximum(needed[list(group)], LEAST_WEIGHT)
        out[list(group)] = np.outer(weights / weights.sum(), share)
    return out


ALL_ORDERS = 3  # players of a robot's account of which all orders are asked: six subsets
LEAST_WEIGHT = 1e-9  # of a term that nothing needs: a family's parts add up all the same


def players(account: Hypothesis) -> list[tuple[int, ...]]:
    """The terms of each player: every term by itself, or those of a family, or of a site, so that few play."""
    terms = account.terms
    keys: list[list[str]] = [[str(i) for i in range(len(terms))], [t.family for t in terms]]
    keys.append([t.effect.site for t in terms])
    names = next((names for names in keys if len(set(names)) <= MOST), keys[-1])
    return [tuple(i for i, n in enumerate(names) if n == name) for name in dict.fromkeys(names)]


def _shapley(player: int, count: int, worth: dict[frozenset[int], FloatArray]) -> FloatArray:
    """(K,) of worths (K,) of every subset."""
    total = np.zeros_like(worth[frozenset()])
    for subset, value in worth.items():
        if player not in subset:
            size = len(subset)
            weight = factorial(size) * factorial(count - size - 1) / factorial(count)
            total = total + weight * (worth[subset | {player}] - value)
    return total


def _ends(player: int, count: int, worth: dict[frozenset[int], FloatArray]) -> FloatArray:
    """(K,) the mean of what a player brings before all others and after them, none of it less than nothing."""
    every = frozenset(range(count))
    return np.maximum(worth[frozenset({player})] + worth[every] - worth[every - {player}], 0.0) / 2.0


def _only(hypothesis: Hypothesis, kept: Sequence[int]) -> Hypothesis:
    """The hypothesis with some of its terms."""
    for index in reversed(range(len(hypothesis.terms))):
        if index not in kept:
            hypothesis = hypothesis.without(index)
    return hypothesis
