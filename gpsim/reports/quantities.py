"""Numbers as a person would say them: a size with its half width, a share with its interval, odds."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from gpsim.reports.sheets import MISSING, significant, unit

if TYPE_CHECKING:  # every figure needs this file, and few the diagnosis
    from gpsim.findings import Estimate, Odds, Share

ELLIPSIS = "…"
LONGEST = 28  # letters of a name in a figure
MOST = 3  # names that are told of a list
LABEL = 18  # beside an axis that is no longer than that
SENTENCE = 60  # and in a sentence, which wraps

MANY = 1e4  # odds beyond which nobody counts
OPEN = 3.0  # to one: lower odds decide nothing, as in the verdict
TIMES = frozenset({"ratio", "gain", "gain_positive", "gain_negative", "scale"})
"""Parameters that multiply what the simulator believes."""
PLAIN = (1e-4, 1e6)  # between these a number is written without an exponent
LOPSIDED = 3.0  # an interval that reaches so many times as far to one side is told by its ends
FINEST = (
    1e-5  # of the value: a half width below it is that of a simulation without noise, its digits say nothing
)


def number(value: float, digits: int = 3) -> str:
    """So many digits; a simulation that ran away has no error that is a number."""
    return "diverged" if not math.isfinite(value) else f"{value:.{digits}g}"


def brief(value: float) -> str:
    """Two digits, or all before the point, without an exponent where that is readable."""
    return significant(value, 2) if math.isfinite(value) else "diverged"


def in_percent(share: float) -> str:
    """A share in per cent, two digits at least and no exponent."""
    return f"{100 * share:.0f}" if share >= 0.0995 else f"{100 * share:.2g}"


def percent(share: float) -> str:
    """A share in whole per cent; decimals only where rounding would claim all of it, or nothing."""
    if not math.isfinite(share):
        return MISSING
    text = f"{100 * share:.0f}"
    if text == "100" and share < 1.0:
        return f"{100 * share:.1f}" if share < 0.9995 else ">99.9"
    if text in ("0", "-0"):
        return "<0.1" if 0.0 < share < 0.0005 else f"{100 * share:.1f}" if share >= 0.0005 else "0"
    return text


def share_text(share: Share) -> str:
    """`93 % (88 to 96)`; the share alone where there are too few data for an interval."""
    text = f"{percent(share.share)} %"
    if share.low is None or share.high is None:
        return text
    ends = {percent(share.low), percent(share.high)}
    return (
        text if ends == {percent(share.share)} else f"{text} ({percent(share.low)} to {percent(share.high)})"
    )


def odds_text(odds: Odds | None) -> str:
    """`120:1`, `>1e4` where nobody counts; MISSING where no explanation without the effect was fitted."""
    if odds is None or odds.nats is None or not math.isfinite(odds.nats):
        return MISSING
    if odds.nats >= math.log(MANY):
        return ">1e4"
    times = math.exp(odds.nats)
    return f"{float(f'{times:.2g}'):.0f}:1" if times >= 9.5 else f"{times:.2g}:1"


def certainty_text(odds: Odds | None) -> str:
    """`sure`, `120 to 1`, `undecided`; MISSING where no explanation without the effect was fitted."""
    said = odds_text(odds)
    if said == MISSING or odds is None or odds.nats is None:
        return MISSING
    if is_open(odds):
        return "undecided"
    return "sure" if odds.nats >= math.log(MANY) else said.replace(":", " to ")


def is_open(odds: Odds | None) -> bool:
    """Whether the data do not tell the effect from what could replace it."""
    return odds is not None and odds.nats is not None and odds.nats < math.log(OPEN)


def size_text(name: str, estimate: Estimate) -> str:
    """`8.71 ± 0.06 N`: the value and the half width of its 90 % interval, `?` where the data do not determine it."""
    said = f" {unit(estimate.unit)}" if estimate.unit != "1" else " times" if name in TIMES else ""
    value = estimate.value
    if not math.isfinite(value):
        return MISSING
    if estimate.at_bound:
        return f"{value:.3g}{said}, at its bound"
    low, high = estimate.low, estimate.high
    if low is None or high is None:
        return f"{value:.3g} ± ?{said}"
    below, above = value - low, high - value
    if min(below, above) * LOPSIDED < max(below, above):
        return interval_text(value, low, high) + said
    half = (high - low) / 2
    if half <= FINEST * abs(value):
        return f"{value:.6g} ± <{FINEST * abs(value):.0e}{said}" if half else f"{value:.6g}{said}"
    return f"{_to(value, half)} ± {_to(half, half)}{said}"


def interval_text(value: float, low: float, high: float) -> str:
    """`2.50 (2.40 to 2.60)`, in the digits that the interval's width leaves."""
    width = max(high - low, 0.0) / 2
    said = [_to(v, width) if width > FINEST * abs(value) else f"{v:.6g}" for v in (value, low, high)]
    return f"{said[0]} ({said[1]} to {said[2]})"


def _to(value: float, width: float) -> str:
    """A value to the digits of a width: one, or two where its first is a 1 or a 2."""
    size = max(abs(value), width)
    if not width > 0.0 or not PLAIN[0] <= size < PLAIN[1]:
        return f"{value:.3g}"
    first = math.floor(math.log10(width))
    places = -first + (width / 10.0**first < 3.0)
    rounded = round(value, places)
    return f"{rounded:.{max(0, places)}f}"


def shortened(name: str, most: int = LONGEST) -> str:
    """A name of at most so many letters: the middle of a longer one becomes an ellipsis, as ends tell names apart."""
    if len(name) <= most:
        return name
    end = (most - 1) // 2
    return f"{name[: most - 1 - end]}{ELLIPSIS}{name[len(name) - end :] if end else ''}"


def spelled(name: str) -> str:
    """A name as a sentence shows it: whole, unless no line could hold it."""
    return shortened(name, SENTENCE)


def listed(names: Sequence[str], most: int | None = MOST, word: str = "and") -> str:
    """`a, b and c`; of a list longer than `most` the first ones and how many more there are."""
    if most is not None and len(names) > most:
        names = [*names[:most], f"{len(names) - most} more"]
    return f" {word} ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)
