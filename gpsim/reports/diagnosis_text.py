"""What is peculiar to a log, and what parameters fix only together, in words."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from gpsim.diagnosis import Diagnosis
from gpsim.diagnosis.assessment import SINCE_REVERSAL
from gpsim.effects import CURVES, FAMILIES
from gpsim.findings import Claims, Combination, LogFact, NamedEffect, NotAsked, RankedHypothesis
from gpsim.reports.quantities import interval_text, number, percent, spelled
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
    "pushed": "something from outside acted from {size} on (a push, a bump) and was left out",
    "quantised": "{channel} is quantised to {size}",
    "jitter": "the clock jitters by {size}",
}
WHOLE = "parameter_offset"  # a parameter of the simulator itself: its place is its name


def log_fact_text(fact: LogFact) -> str:
    """`3 samples of theta repeat the one before`, `theta is quantised to 0.001 rad`."""
    size = "" if fact.value is None else f"{fact.value:.3g} {unit(fact.unit)}".strip()
    if fact.kind in COUNTED:
        samples = f"{fact.count} sample{'' if fact.count == 1 else 's'}"
        of = f"{samples} of {fact.channel}" if fact.channel else samples
        said = COUNTED[fact.kind][fact.count != 1].format(of=of)
        return f"{said} ({size})" if size else said
    said = MEASURED[fact.kind].format(channel=fact.channel, size=size)
    return f"{said}, at {fact.count} samples" if fact.count else said


def fixed_text(combination: Combination) -> str:
    """What the data fix: the product of powers, and its value; that it is one combination where nobody knows which."""
    powers = combination.exponents
    names = [_parameter(name) for name in combination.of]
    if len(powers) != len(combination.of) or not any(powers):
        return "one combination of them"
    above = [_power(n, p) for n, p in zip(names, powers, strict=True) if p > 0]
    below = [_power(n, -p) for n, p in zip(names, powers, strict=True) if p < 0]
    said = f"{' · '.join(above) or '1'}{' / ' + ' / '.join(below) if below else ''}"
    return f"{said}{_size(combination)}"


def _size(combination: Combination) -> str:
    value, low, high = combination.value, combination.low, combination.high
    if value is None:
        return ""
    of = "" if combination.unit == "1" else f" {unit(combination.unit)}"
    size = f"{value:.4g}" if low is None or high is None else interval_text(value, low, high)
    return f" = {size}{of}"


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
    of = "" if named else f"of {listed(names, None)} "
    return f"{of}only {combination.fixed} is fixed; {combination.open}"


def combination_texts(combinations: Sequence[Combination]) -> list[str]:
    """The same of several; ratios, which are all open in one way, share a sentence."""
    ratios = [c for c in combinations if _is_ratio(c)]
    if len(ratios) < 2:
        return [combination_text(c) for c in combinations]
    together = f"only {listed([c.fixed for c in ratios], None)} are fixed: these may all be scaled alike"
    return [together, *(combination_text(c) for c in combinations if not _is_ratio(c))]


def _is_ratio(combination: Combination) -> bool:
    return len(combination.exponents) == 2 and math.prod(combination.exponents) < 0.0


def parameters_of(combination: Combination) -> str:
    """`cart_mass or the gain of force`: what would have to be known from elsewhere."""
    return listed([_parameter(name) for name in combination.of], None, "or")


def _parameter(name: str) -> str:
    """`force gain` of `actuator_gain on force: gain`; a name of another form stays as it is."""
    claim, between, parameter = name.rpartition(": ")
    family, on, place = claim.partition(" on ")
    if not (between and on):
        return name
    return place if family == WHOLE else f"{place} {parameter.replace('_', ' ')}"


def _power(name: str, power: float) -> str:
    return name if abs(power - 1.0) < 1e-9 else f"{name}^{power:.2g}"


MOST_NAMED = 4
"""Families that are named in a line; of more their number is said."""


def not_asked_lines(entries: Sequence[NotAsked]) -> list[str]:
    """One line each: what never changed, was not measured or was settled, and what is left out for it.

    All states that are estimated alike, as the velocities of a robot, are one line.
    """
    estimated: dict[tuple[str, ...], list[str]] = {}
    for entry in entries:
        if entry.because == "estimated":
            estimated.setdefault(entry.families, []).append(entry.channel)
    said = [_estimated(names) + _left_out(families) for families, names in estimated.items()]
    return said + [_not_asked(e) + _left_out(e.families) for e in entries if e.because != "estimated"]


def _estimated(names: Sequence[str]) -> str:
    verbs = "were not measured and are" if len(names) > 1 else "was not measured and is"
    return f"{listed(names)} {verbs} estimated"


def _left_out(families: Sequence[str]) -> str:
    return f"; not asked: {_families(families)}" if families else ""


def _not_asked(entry: NotAsked) -> str:
    name, value = entry.channel, f"{entry.value:g} {entry.unit}" if entry.value is not None else ""
    return {
        "no command": f"{name} was not recorded and is taken as 0 {entry.unit}",
        "constant command": f"{name} never changes ({value})",
        "constant": f"{name} never changes: it says little",
        "held": f"{name} never changes ({value}): it is taken as held still from outside",
        "not needed": f"{name} was not measured, and nothing that was depends on it: it is left out",
        "known": f"{name} is known ({value})",
        "asked": "left out as you said",
        "does nothing": f"{name} is required and does nothing here: it is left out",
        "nothing touches": f"nothing touches {name}: its friction and stiffness are not asked",
    }[entry.because]


def _families(families: Sequence[str]) -> str:
    names = [family.replace("_", " ") for family in families]
    if len(names) > MOST_NAMED:
        return f"{', '.join(names[:MOST_NAMED])} and {len(names) - MOST_NAMED} more families"
    return ", ".join(names)


NOTHING = "nothing missing"
RANKINGS = {"all": "On all training windows:", "search": "Given up in the search, on its windows:"}
COARSE = 0.7  # of the base simulator's error, that finer steps leave: what they take away is worth a word
TRIFLE = 0.01  # of a rate's residual: less is not told
MOST = 3  # names that are told of a list


def ranking(diagnosis: Diagnosis) -> list[str]:
    """Every hypothesis that was fitted, the best first; those of the search alone, which had fewer data, at the end."""
    groups = {title: [e for e in diagnosis.ranking if e.windows == w] for w, title in RANKINGS.items()}
    return [line for title, group in groups.items() if group for line in (title, *map(_ranked, group))]


def where(diagnosis: Diagnosis) -> str:
    """In which rates, on what they depend, in which part of state or time, and what of the log was looked at."""
    location = diagnosis.location
    if diagnosis.verdict == "none":
        return (
            f"nowhere: the error is noise and numerical error.{_own_step(diagnosis)}{_looked_at(diagnosis)}"
        )
    shares = sorted(location.channels.items(), key=lambda item: -item[1])
    told = [(spelled(name), percent(share)) for name, share in shares if share > TRIFLE]
    text = _error_in(told) if told else _no_part(diagnosis)
    if location.depends_on:
        inputs = [spelled(name) for name in location.depends_on]
        text += f"; look at {listed(inputs)}: the error changes with {'it' if len(inputs) == 1 else 'them'}"
    for name, (low, high) in location.region.items():
        text += f"; only where {in_region(name, low, high)}"
    if location.since is not None:
        text += f"; since t = {_moment(location.since, diagnosis.dt)} s"
    if location.since_episode is not None:
        text += f"; since episode {spelled(location.since_episode)}"
    return f"{text}{_part(diagnosis)}.{_looked_at(diagnosis)}"


def gate_text(effect: NamedEffect, dt: float | None) -> str:
    """Where and since when an effect acts; empty where it does so always."""
    said = [f"only where {in_region(name, low, high)}" for name, (low, high) in effect.region.items()]
    if effect.since is not None:
        said.append(f"since t = {_moment(effect.since, dt)} s")
    if effect.since_episode is not None:
        said.append(f"since episode {spelled(effect.since_episode)}")
    if effect.recordings is not None:
        said.append(f"only in {listed([spelled(name) for name in effect.recordings])}")
    return ", ".join(said)


def in_region(name: str, low: float, high: float) -> str:
    """`x in [-1.1, -0.4]`."""
    return f"{spelled(name)} in {_between(low, high)}"


def listed(names: Sequence[str], most: int | None = MOST, word: str = "and") -> str:
    """`a, b and c`; of a list longer than `most` the first ones and how many more there are."""
    if most is not None and len(names) > most:
        names = [*names[:most], f"{len(names) - most} more"]
    return f" {word} ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def _own_step(diagnosis: Diagnosis) -> str:
    """What of the residual the base simulator's own step makes, where that is much."""
    errors = [(name, e, e.finely) for name, e in diagnosis.fit.one_step.items() if e.finely is not None]
    coarse = [(name, e, finely) for name, e, finely in errors if finely < COARSE * e.before]
    if not coarse:
        return ""
    left = listed(
        [f"{number(finely)} of {spelled(n)}'s {number(e.before)} {e.unit}" for n, e, finely in coarse]
    )
    return f" The simulator's own step is coarse: integrated finely, {left} is left one step ahead."


def _part(diagnosis: Diagnosis) -> str:
    """In which part of state, action or time nearly all of it lies; what a named region says already is left out."""
    location, part = diagnosis.location, diagnosis.location.concentrated
    named = location.region or location.since is not None or location.since_episode is not None
    if part is None or named:
        return ""
    (low, high), name = part.interval, part.channel
    of = spelled(name.removeprefix(SINCE_REVERSAL))
    if part.is_channel or not name.startswith(SINCE_REVERSAL):
        lies = f"{part.where} {spelled(name)} = {_between(low, high)}"
    else:
        lies = f"within {high:.3g} s of a reversal of {of}" if high > 0.0 else f"where {of} reverses"
    return (
        f"; {percent(part.share_of_mismatch)} % of {spelled(part.rate)}'s error lies {lies}, "
        f"in {percent(part.share_of_samples)} % of the samples"
    )


def _between(low: float, high: float) -> str:
    """An interval: three digits of its ends, more where they share the first ones."""
    size, width = max(abs(low), abs(high)), abs(high - low)
    shared = math.floor(math.log10(size / width)) if 0 < width < math.inf else 0
    digits = 3 + max(shared, 0)
    return f"[{low:.{digits}g}, {high:.{digits}g}]"


def _moment(t: float, dt: float | None) -> str:
    """A moment [s] to a step of its clock, dt [s]; three digits where nobody knows that step."""
    if not dt:
        return f"{t:.3g}"
    return f"{t:.{max(0, math.ceil(-math.log10(dt)))}f}"


def _looked_at(diagnosis: Diagnosis) -> str:
    """What a reader must know of the data that were looked at."""
    text = ""
    if diagnosis.thinned > 1:
        nth = f"{diagnosis.thinned}{ {2: 'nd', 3: 'rd'}.get(diagnosis.thinned, 'th') }"
        text += f" The clock is fast: every {nth} sample was used, commands averaged between."
    if diagnosis.not_measured:
        names = listed([spelled(name) for name in diagnosis.not_measured])
        text += f" Not measured and estimated by each model: {names}."
    return text


def _error_in(told: Sequence[tuple[str, str]]) -> str:
    """In which rates the simulator is wrong, the worst first: how much of the error there is more than noise."""
    more = [" of the error there is not noise", *[""] * len(told)]
    return (
        f"in {listed([f'{name} ({share} %{said})' for (name, share), said in zip(told, more, strict=False)])}"
    )


def _no_part(diagnosis: Diagnosis) -> str:
    return (
        "the error is small in every rate, but more than noise"
        if diagnosis.fit.one_step
        else "in a rate that was not measured"
    )


def _ranked(entry: RankedHypothesis) -> str:
    gates = entry.gates or ("",) * len(entry.effects)
    terms = [
        f"{family} on {on}" + (f" (for some {gate})" if gate else "")
        for (family, on), gate in zip(entry.effects, gates, strict=True)
    ]
    why = f"  ({entry.refused})" if entry.refused else ""
    return f"{entry.nats_behind:10.1f}  {entry.scheme:<14} {' + '.join(terms) or NOTHING}{why}"


def terms_text(effects: Claims) -> str:
    """The families and places of an explanation."""
    return " + ".join(f"{family} on {on}" for family, on in effects) or NOTHING


def noun(family: str) -> str:
    """What people call a family of effects, in the catalogue or not."""
    found = FAMILIES.get(family) or CURVES.get(family)
    known = found.noun if found is not None else ""
    return known or family.replace("_", " ")
