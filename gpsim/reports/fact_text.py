"""What is peculiar to a log, and what parameters fix only together, in words."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from gpsim.diagnosis.report import Combination, LogFact
from gpsim.reports.quantities import interval_text
from gpsim.reports.sheets import unit

COUNTED: Mapping[str, tuple[str, str]] = {
    "repeated": ("{of} repeats the one before", "{of} repeat the one before"),
    "missing": ("{of} is missing", "{of} are missing"),
    "outliers": ("{of} leaps and was left out", "{of} leap and were left out"),
    "touching": (
        "in {of} something touches: accelerations are not compared there, rollouts are",
        "in {of} something touches: accelerations are not compared there, rollouts are",
    ),
}
MEASURED: Mapping[str, str] = {
    "quantised": "{channel} is quantised{to}",
    "jitter": "{clock} jitters{by}",
    "late": "{channel} arrives late{by}",
    "drift": "{clock} drifts{by}",
}
WHOLE = "parameter_offset"  # a parameter of the simulator itself: its place is its name


def log_fact_text(fact: LogFact) -> str:
    """`3 samples of theta repeat the one before`, `theta is quantised to 0.001 rad`."""
    size = "" if fact.value is None else f"{fact.value:.3g} {unit(fact.unit)}".strip()
    if fact.kind in COUNTED:
        samples = f"{fact.count} sample{'' if fact.count == 1 else 's'}" if fact.count else "samples"
        of = f"{samples} of {fact.channel}" if fact.channel else samples
        said = COUNTED[fact.kind][fact.count != 1].format(of=of)
        return f"{said} ({size})" if size else said
    said = MEASURED[fact.kind].format(
        channel=fact.channel or "everything",
        clock=f"the clock of {fact.channel}" if fact.channel else "the clock",
        to=f" to {size}" if size else "",
        by=f" by {size}" if size else "",
    )
    return f"{said}, at {fact.count} samples" if fact.count else said


def fixed_text(combination: Combination) -> str:
    """What the data fix: the product of powers, and its value; that it is one combination where nobody knows which."""
    powers = combination.exponents
    if len(powers) != len(combination.of) or not any(powers):
        return "one combination of them"
    names = [_parameter(name) for name in combination.of]
    above = [_power(n, p) for n, p in zip(names, powers, strict=True) if p > 0]
    below = [_power(n, -p) for n, p in zip(names, powers, strict=True) if p < 0]
    said = f"{' · '.join(above) or '1'}{' / ' + ' / '.join(below) if below else ''}"
    value, low, high = combination.value, combination.low, combination.high
    if value is None:
        return said
    of = "" if combination.unit == "1" else f" {unit(combination.unit)}"
    size = f"{value:.4g}" if low is None or high is None else interval_text(value, low, high)
    return f"{said} = {size}{of}"


def open_text(combination: Combination) -> str:
    """The direction that the data leave open."""
    powers = combination.exponents
    if len(powers) != len(combination.of) or len(powers) != 2:
        return "all of them may change as long as it stays"
    return "both may be scaled alike" if _is_ratio(combination) else "one may grow as the other shrinks"


def combination_text(combination: Combination) -> str:
    """What of some parameters is fixed, and what stays open, in a sentence."""
    names = [_parameter(name) for name in combination.of]
    named = all(name in combination.fixed for name in names)
    of = "" if named else f"of {_listed(names)} "
    return f"{of}only {combination.fixed} is fixed; {combination.open}"


def combination_texts(combinations: Sequence[Combination]) -> list[str]:
    """The same of several; ratios, which are all open in one way, share a sentence."""
    ratios = [c for c in combinations if _is_ratio(c)]
    if len(ratios) < 2:
        return [combination_text(c) for c in combinations]
    together = f"only {_listed([c.fixed for c in ratios])} are fixed: these may all be scaled alike"
    return [together, *(combination_text(c) for c in combinations if not _is_ratio(c))]


def _is_ratio(combination: Combination) -> bool:
    return len(combination.exponents) == 2 and math.prod(combination.exponents) < 0.0


def parameters_of(combination: Combination) -> str:
    """`cart_mass or the gain of force`: what would have to be known from elsewhere."""
    return _listed([_parameter(name) for name in combination.of], "or")


def _listed(names: Sequence[str], word: str = "and") -> str:
    return f" {word} ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def _parameter(name: str) -> str:
    """`force gain` of `actuator_gain on force: gain`; a name of another form stays as it is."""
    claim, between, parameter = name.rpartition(": ")
    family, on, place = claim.partition(" on ")
    if not (between and on):
        return name
    return place if family == WHOLE else f"{place} {parameter.replace('_', ' ')}"


def _power(name: str, power: float) -> str:
    return name if abs(power - 1.0) < 1e-9 else f"{name}^{power:.2g}"
