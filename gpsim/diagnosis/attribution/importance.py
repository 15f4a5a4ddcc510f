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


def importances(judge: Judge, account: Hypothesis, whole: FloatArray, explained: FloatArray) -> FloatArray:
    """(T, 1 + D) the Shapley values of the account's T terms, on all blocks and on each draw.

    whole: (1 + D,) the worth of all terms; explained: (1 + D,) what they are to add up to: a little less where the
    account is judged in parts of the recording that its parameters have not seen.
    """
    count = len(account.terms)
    subsets = list(chain.from_iterable(combinations(range(count), n) for n in range(1, count)))
    worth: dict[frozenset[int], FloatArray] = {frozenset(): np.zeros_like(whole)}
    worth[frozenset(range(count))] = whole
    if subsets:
        found = judge.mismatch.overall(judge.squares([[_only(account, subset)] for subset in subsets]))
        worth |= dict(zip(map(frozenset, subsets), found, strict=True))
    adds_up = explained / np.where(whole > 0.0, whole, 1.0)
    return np.array([_shapley(i, count, worth) * adds_up for i in range(count)])


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
