"""Importance and need: how much of the explained share is an effect's, and what it loses without it.

Importance is the Shapley value (Shapley 1953) of the effects as players, a subset's worth being the share that it
explains with its own effects on and the others off, parameters as fitted: effects that explain the same share it, and
the values add up to what all explain. Alone it ranks redundant effects too high, so that need stands beside it: the
share that goes when an effect goes and the others are fitted anew.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain, combinations
from math import factorial

import numpy as np

from gpsim.channels import FloatArray
from gpsim.diagnosis.attribution.judges import Judge
from gpsim.diagnosis.fitting import Hypothesis

MOST = 6  # terms of which every subset is asked, 64; of more, random orders
ORDERS = 6  # drawn, each taken forwards and backwards
SEED = 2009  # of the orders: the same account is judged alike, whoever asks


def importances(judge: Judge, account: Hypothesis, whole: FloatArray, explained: FloatArray) -> FloatArray:
    """(T, 1 + D) the Shapley values of the account's T terms, on all blocks and on each draw.

    whole: (1 + D,) the worth of all terms; explained: (1 + D,) what they are to add up to: a little less where the
    account is judged in parts of the recording that its parameters have not seen.
    """
    count = len(account.terms)
    if count > MOST:
        return _sampled(judge, account, whole) * (explained / np.where(whole > 0.0, whole, 1.0))
    subsets = list(chain.from_iterable(combinations(range(count), n) for n in range(1, count)))
    worth: dict[frozenset[int], FloatArray] = {frozenset(): np.zeros_like(whole)}
    worth[frozenset(range(count))] = whole
    if subsets:
        found = judge.mismatch.overall(judge.squares([[_only(account, subset)] for subset in subsets]))
        worth |= dict(zip(map(frozenset, subsets), found, strict=True))
    adds_up = explained / np.where(whole > 0.0, whole, 1.0)
    return np.array([_shapley(i, count, worth) * adds_up for i in range(count)])


def _sampled(judge: Judge, account: Hypothesis, whole: FloatArray) -> FloatArray:
    """(T, 1 + D) the same from random orders, each and its reverse (Castro, Gomez and Tejada 2009)."""
    count, rng = len(account.terms), np.random.default_rng(SEED)
    orders = [order for _ in range(ORDERS) for order in _both_ways(rng.permutation(count).tolist())]
    subsets = sorted({tuple(sorted(order[:n])) for order in orders for n in range(1, count)})
    found = judge.mismatch.overall(judge.squares([[_only(account, subset)] for subset in subsets]))
    worth = dict(zip(subsets, found, strict=True)) | {(): np.zeros_like(whole), tuple(range(count)): whole}
    total = np.zeros((count, *whole.shape))
    for order in orders:
        for n, player in enumerate(order):
            without, with_it = tuple(sorted(order[:n])), tuple(sorted(order[: n + 1]))
            total[player] += worth[with_it] - worth[without]
    return total / len(orders)


def _both_ways(order: list[int]) -> tuple[list[int], list[int]]:
    return order, order[::-1]


def _shapley(player: int, count: int, worth: dict[frozenset[int], FloatArray]) -> FloatArray:
    """(K,) of worths (K,) of every subset."""
    total = np.zeros_like(worth[frozenset()])
    for subset, value in worth.items():
        if player not in subset:
            size = len(subset)
            weight = factorial(size) * factorial(count - size - 1) / factorial(count)
            total = total + weight * (worth[subset | {player}] - value)
    return total


def _only(hypothesis: Hypothesis, kept: Sequence[int]) -> Hypothesis:
    """The hypothesis with some of its terms."""
    for index in reversed(range(len(hypothesis.terms))):
        if index not in kept:
            hypothesis = hypothesis.without(index)
    return hypothesis
