"""What the proof has to reach, and how its tables call it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

EQUIVALENT = "an equivalent"  # said in place of the truth, and as right


class Goal(NamedTuple):
    """A figure's name in words, and what it must be at least or at most; coverage must not be too high either."""

    label: str
    sign: str
    wanted: float
    most: float | None = None


GOALS: Mapping[str, Goal] = {
    "single.share": Goal("one effect: right", ">=", 0.97),
    "pair.share": Goal("two effects: both right", ">=", 0.92),
    "triple.share": Goal("three effects: all right", ">=", 0.85),
    "location.share": Goal("rate, place and gate right", ">=", 0.97),
    "parameters.median_relative_error": Goal("parameters, median error", "<=", 0.05),
    "parameters.coverage_90": Goal("90 % intervals cover", ">=", 0.85, 0.95),
    "none.share_false": Goal("nothing missing: false alarms", "<=", 0.01),
    "unknown.share": Goal("outside: said so", ">=", 0.92),
    "unknown.share_named_wrong": Goal("outside: wrong name, odds > 10", "<=", 0.03),
    "rough.headline_found": Goal("rough: main effects in the headline", ">=", 0.90),
    "rough.verdict_right": Goal("rough: verdict right", ">=", 0.85),
    "rough.spurious": Goal("rough: spurious headline effects", "<=", 0.15),
    "rough.coverage_90": Goal("rough: 90 % intervals cover", ">=", 0.85, 0.95),
    "machines.told": Goal("machines: effects that count, told", ">=", 0.85),
    "machines.spurious": Goal("machines: told and not there, a world", "<=", 0.3),
    "machines.sized": Goal("machines: sizes within 15 % or the interval", ">=", 0.85),
    "machines.rollouts_within": Goal("machines: held-out rollouts within 1.3 of the truth's", ">=", 0.90),
    "machines.black_box_better": Goal("machines: a black box is better", "<=", 0.05),
    "machines.verdict_right": Goal("machines: verdict right", ">=", 0.85),
    "machines.coverage_90": Goal("machines: 90 % intervals cover", ">=", 0.80, 0.95),
    "mjcf.single_right": Goal("robots: one effect right", ">=", 0.95),
    "mjcf.pair_right": Goal("robots: two effects, both right", ">=", 0.85),
    "mjcf.false_alarms": Goal("robots: nothing missing, false alarms", "<=", 0.02),
    "mjcf.median_relative_error": Goal("robots: parameters, median error", "<=", 0.05),
    "mjcf.coverage_90": Goal("robots: 90 % intervals cover", ">=", 0.85, 0.95),
    "whole.rows_right": Goal("whole robots: rows of friction and rotors right", ">=", 0.85),
    "whole.bodies_right": Goal("whole robots: bodies right or in a combination", ">=", 0.80),
    "whole.spurious": Goal("whole robots: headline effects not there, a robot", "<=", 0.3),
    "whole.rollouts_within": Goal("whole robots: held-out rollouts within 1.3 of the truth's", ">=", 0.85),
    "whole.coverage_90": Goal("whole robots: 90 % intervals cover", ">=", 0.85, 0.95),
    "afloat.worlds_right": Goal("afloat: right, with nothing said that is not there", ">=", 0.80),
    "afloat.false_alarms": Goal("afloat: nothing missing, false alarms", "<=", 0.02),
    "afloat.rollouts_within": Goal("afloat: held-out rollouts within 1.3 of the truth's", ">=", 0.85),
    "afloat.coverage_90": Goal("afloat: 90 % intervals cover", ">=", 0.85, 0.95),
    "curves.curve_right": Goal("curves: within 10 % of the law's range", ">=", 0.85),
    "curves.place_right": Goal("curves: site and input right", ">=", 0.90),
    "curves.named_wrong": Goal("curves: a law of the catalogue said to hold", "<=", 0.05),
    "plans.resolved": Goal("plans: worlds that any excitation resolves, resolved", ">=", 0.85),
    "plans.over_fixed": Goal("plans: median time over the best fixed one's", "<=", 0.5),
    "plans.left": Goal("plans: left the box", "<=", 0.01),
    "undecided.share": Goal("undecided though identifiable", "<=", 0.05),
    "fit.share_within": Goal("held-out error near the truth's", ">=", 0.95),
    "seconds.median": Goal("seconds, median", "<=", 20.0),
    "seconds.max": Goal("seconds, longest", "<=", 60.0),
}
"""Figure (part and key of the summary) -> goal."""


def goals(figures: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """Every goal, what was reached, and whether that is enough; None where nothing was measured.

    A share, or a mean count, is enough where its 95 % interval holds what is wanted or lies beyond it.
    """
    out = {}
    for name, goal in GOALS.items():
        part, key = name.split(".")
        block = figures.get(part, {})
        got = block.get(key)
        words = f"{goal.sign} {goal.wanted:g}" if goal.most is None else f"{goal.wanted:g}-{goal.most:g}"
        bounds = None if key.startswith("median") else bounds_of(block, key)
        reached = None if got is None else _reached(goal, got, bounds)
        out[name] = {"wanted": words, "got": got, "reached": reached}
    return out


def bounds_of(block: Mapping[str, Any], key: str) -> list[float] | None:
    """The interval of a figure of a block."""
    own = None if key == "max" else block.get("interval")
    found: list[float] | None = block.get(f"interval_{key.removeprefix('share_')}", own)
    return found


def _reached(goal: Goal, got: float, bounds: Sequence[float] | None) -> bool:
    low, high = (got, got) if bounds is None else (min(bounds[0], got), max(bounds[1], got))
    if goal.most is not None and low > goal.most:
        return False
    return bool(high >= goal.wanted if goal.sign == ">=" else low <= goal.wanted)
