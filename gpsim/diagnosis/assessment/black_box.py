"""What could be predicted: the account's held-out rollouts beside those of models that name nothing.

A share of the base's error says little where the base is far off: 99.8 % of it goes with a law that is merely near. A
Gaussian process alone, and one beside the account, show how much of the
error that is left anything could have foreseen.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from gpsim.channels import BoolArray, FloatArray
from gpsim.diagnosis.assessment.remainder_gp import TINY, Learnt
from gpsim.diagnosis.assessment.rollouts import Model
from gpsim.diagnosis.fitting import Hypothesis
from gpsim.diagnosis.report import BlackBox, BoxKind, Share

STANDS_OUT = 1.5
"""Times what noise alone makes of a rollout: a channel in which the account's error is less is done."""
TRIFLE = 0.005
"""Of the base's error: a channel in which the account leaves less is done (a log made in the base's own coarse steps
leaves 0.0045 of it, which a process learns)."""
LEAST_RATIO = 0.1
"""Of the account's error: in one channel a model counts as no better, nor as so much worse."""
FEWEST_ROLLOUTS = 4  # held out: with fewer there is no interval [rollouts]
DRAWS = 400  # of all rollouts
LOW = 0.05  # quantile of the draws that is an interval's lower end (usual: 90 %)
HIGH = 0.95  # quantile of the draws that is its upper end (usual: 90 %)

FAR = 1e100  # its square is a number still
SEED = 2051  # of the draws: the same account is judged alike, whoever asks


@dataclass(frozen=True)
class Box:
    """A model that names nothing. of: where it is a curve, of what that is."""

    kind: BoxKind
    model: Model
    of: str = ""
    on: tuple[str, ...] = ()


def boxes_of(
    base: Hypothesis,
    after: Hypothesis,
    alone: Learnt | None,
    beside: Learnt | None,
) -> dict[str, Box]:
    """Name -> box. alone, beside: Gaussian processes on what the base and the account leave."""
    found = {}
    if alone is not None:
        found["box_gp"] = Box("gp", Model(base, alone.rates))
    if beside is not None:
        found["box_after_gp"] = Box("after_gp", Model(after, beside.rates))
    return found


def black_box(
    boxes: Mapping[str, Box], errors: Mapping[str, FloatArray], seen: BoolArray
) -> tuple[str, BlackBox] | None:
    """The box that takes most off the account's error, and how much; None where that error does not stand out.

    errors: (W, S) at the ends of held-out rollouts, of `before`, `after`, `noise_floor` and every box; seen: (S,)
    channels that were measured.
    """
    if not boxes or not len(errors["after"]):
        return None
    squares = {kind: _squared(e) for kind, e in errors.items()}
    counts = seen & _stands_out(squares)
    if not counts.any():
        return None
    rows = len(squares["after"])
    rng = np.random.default_rng(SEED)
    weights = np.vstack([np.ones(rows), rng.multinomial(rows, np.full(rows, 1.0 / rows), DRAWS)])
    means = {kind: weights @ square[:, counts] / rows for kind, square in squares.items()}
    taken = {name: _taken_off(means, name) for name in boxes}
    best = max(taken, key=lambda name: float(taken[name][0]))
    low, high = np.quantile(taken[best][1:], [LOW, HIGH])
    known = rows >= FEWEST_ROLLOUTS
    share = Share(float(taken[best][0]), float(low) if known else None, float(high) if known else None)
    box = boxes[best]
    return best, BlackBox(box.kind, share, box.of, box.on)


def _squared(errors: FloatArray) -> FloatArray:
    """Of a simulation that ran away a number still."""
    return np.asarray(np.minimum(np.nan_to_num(np.abs(errors), nan=FAR), FAR) ** 2)


def _stands_out(squares: Mapping[str, FloatArray]) -> BoolArray:
    """(S,) in which channels the account's error is more than noise, and than a trifle of the base's."""
    after, floor, before = (squares[kind].mean(axis=0) for kind in ("after", "noise_floor", "before"))
    return np.asarray((after > STANDS_OUT**2 * floor) & (after > TRIFLE**2 * before))


def _taken_off(means: Mapping[str, FloatArray], name: str) -> FloatArray:
    """(1 + D,) how much less a box's error beyond noise is than the account's, channels by their geometric mean."""
    floor = means["noise_floor"]
    left, own = (np.maximum(means[kind] - floor, TINY) for kind in (name, "after"))
    ratios = np.clip(0.5 * np.log(left) - 0.5 * np.log(own), np.log(LEAST_RATIO), -np.log(LEAST_RATIO))
    return np.asarray(1.0 - np.exp(ratios.mean(axis=1)))
