"""Parts of a diagnosis in words: where it is off, what is peculiar to a log, what parameters fix only together.

And a model's geometry: what is off by how much, what cannot be told apart, and how far the tool is off.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence, Set
from dataclasses import replace

from gpsim.diagnosis import Diagnosis
from gpsim.diagnosis.assessment import SINCE_REVERSAL
from gpsim.effects import CURVES, FAMILIES
from gpsim.findings import (
    Claims,
    Combination,
    GeometryFound,
    GeometryKind,
    GeometryPlace,
    InPlaceOf,
    Inseparable,
    Kinematics,
    LogFact,
    NamedEffect,
    NotAsked,
    RankedHypothesis,
)
from gpsim.reports.pages import text_of
from gpsim.reports.quantities import brief, interval_text, listed, number, percent, size_text, spelled
from gpsim.reports.sheets import unit

COUNTED: Mapping[str, tuple[str, str]] = {
    "repeated": ("{of} repeats the one before", "{of} repeat the one before"),
    "missing": ("{of} is missing", "{of} are missing"),
    "outliers": ("{of} leaps and was left out", "{of} leap and were left out"),
    "touching": ("{of} have contact: accelerations are not compared there, but rollouts are",) * 2,
}
MEASURED: Mapping[str, str] = {
    "pushed": "an external push or bump acted from {size} on and was left out",
    "quantised": "{channel} is quantised to {size}",
    "jitter": "the clock jitters by {size}",
}
NOT_ASKED: Mapping[str, str] = {
    "no command": "{name} was not recorded and is taken as 0 {unit}",
    "constant command": "{name} never changes ({value})",
    "constant": "{name} never changes: it gives little information",
    "held": "{name} never changes ({value}): it is taken as held by a mount",
    "not needed": "{name} was not measured, and no measured channel depends on it: it is left out",
    "known": "{name} is known ({value})",
    "asked": "left out as you said",
    "does nothing": "{name} is required, but has no influence here: it is left out",
    "nothing touches": "nothing touches {name}: its friction and stiffness are not tested",
}
WHOLE = "parameter_offset"  # a parameter of the simulator itself: its place is its name
MOST_NAMED = 4  # families that are named in a line; of more their number is said
NOTHING = "nothing missing"
RANKINGS = {"all": "On all training windows:", "search": "Rejected during the search, on its windows:"}
RANKED = "nats behind the chosen one (negative: ahead of it), result, integration, explanation"
COARSE = 0.7  # of the base simulator's error, that finer steps leave: what they take away is worth a word
TRIFLE = 0.01  # of a rate's residual: less is not told


def noun(family: str) -> str:
    """What people call a family of effects, in the catalogue or not."""
    found = FAMILIES.get(family) or CURVES.get(family)
    return (found.noun if found is not None else "") or family.replace("_", " ")


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
    powers, value = combination.exponents, combination.value
    if len(powers) != len(combination.of) or not any(powers):
        return "one combination of them"
    terms = [(p, _parameter(name)) for name, p in zip(combination.of, powers, strict=True)]
    above, below = (
        [name if abs(s * p - 1.0) < 1e-9 else f"{name}^{s * p:.2g}" for p, name in terms if s * p > 0]
        for s in (1, -1)
    )
    said = f"{' · '.join(above) or '1'}{' / ' + ' / '.join(below) if below else ''}"
    if value is None:
        return said
    low, high = combination.low, combination.high
    size = f"{value:.4g}" if low is None or high is None else interval_text(value, low, high)
    return f"{said} = {size}{'' if combination.unit == '1' else f' {unit(combination.unit)}'}"


def open_text(combination: Combination) -> str:
    """The direction that the data leave open."""
    powers = combination.exponents
    if len(powers) != len(combination.of) or len(powers) != 2:
        return "all of them may change as long as this product does not"
    return "both may be scaled alike" if _is_ratio(combination) else "one may grow while the other shrinks"


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
    together = f"only {listed([c.fixed for c in ratios], None)} are determined: all may be scaled together"
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


def not_asked_lines(entries: Sequence[NotAsked]) -> list[str]:
    """One line each: what never changed, was not measured or was settled, and what is left out for it.

    All states that are estimated alike, as the velocities of a robot, are one line.
    """
    estimated: dict[tuple[str, ...], list[str]] = {}
    for entry in entries:
        if entry.because == "estimated":
            estimated.setdefault(entry.families, []).append(entry.channel)
    said = [
        f"{listed(names)} {'were not measured and are' if len(names) > 1 else 'was not measured and is'} estimated"
        + _left_out(families)
        for families, names in estimated.items()
    ]
    for e in entries:
        if e.because != "estimated":
            value = f"{e.value:g} {e.unit}" if e.value is not None else ""
            words = NOT_ASKED[e.because].format(name=e.channel, value=value, unit=e.unit)
            said.append(words + _left_out(e.families))
    return said


def _left_out(families: Sequence[str]) -> str:
    names = [family.replace("_", " ") for family in families]
    more = f" and {len(names) - MOST_NAMED} more families" if len(names) > MOST_NAMED else ""
    return f"; not asked: {', '.join(names[:MOST_NAMED])}{more}" if names else ""


def ranking(diagnosis: Diagnosis) -> list[str]:
    """Every hypothesis that was fitted and what came of it; those of the search alone, which had fewer data, last."""
    rivals = [{(e.family, e.place) for e in one.effects} for one in diagnosis.alternatives]
    lines, ours = list[str](), None
    for windows, title in RANKINGS.items():
        group = [e for e in diagnosis.ranking if e.windows == windows]
        lines += [title] if group else []
        if windows == "all" and group and not group[0].refused:
            ours = group[0]  # whatever the nats of the others
        lines += [_ranked(entry, ours, rivals) for entry in group]
    return lines


def _ranked(
    entry: RankedHypothesis, ours: RankedHypothesis | None, rivals: Sequence[Set[tuple[str, str]]]
) -> str:
    """A row; why it is not the account, which is ours."""
    claims, why = set(entry.effects), ""
    if entry is ours:
        came = "chosen"
    elif entry.refused or entry.nats_behind < 0.0:
        came, why = "refused", entry.refused or "this file gives no reason"
    elif entry.windows == "search":
        came = "given up"
    elif claims in rivals:
        came, why = "not ruled out", "an alternative of the account"
    elif any(told <= claims for told in (*([set(ours.effects)] if ours else []), *rivals)):
        came, why = "costs more", "its improvement is less than its price"
    else:
        came = "fits worse"
    gates = entry.gates or ("",) * len(entry.effects)
    terms = [
        f"{family} on {on}" + (f" (for some {gate})" if gate else "")
        for (family, on), gate in zip(entry.effects, gates, strict=True)
    ]
    because = f"  ({why})" if why else ""
    return (
        f"  {entry.nats_behind:12.1f}  {came:<13}  {entry.scheme:<14} {' + '.join(terms) or NOTHING}{because}"
    )


def terms_text(effects: Claims) -> str:
    """The families and places of an explanation."""
    return " + ".join(f"{family} on {on}" for family, on in effects) or NOTHING


def where(diagnosis: Diagnosis) -> str:
    """In which rates, on what they depend, in which part of state or time, and what of the log was looked at."""
    location, part = diagnosis.location, diagnosis.location.concentrated
    shares = sorted(location.channels.items(), key=lambda item: -item[1])
    places = [f"{spelled(name)} ({percent(share)} %" for name, share in shares if share > TRIFLE]
    lies = ""
    if part is not None:
        (low, high), of = part.interval, spelled(part.channel.removeprefix(SINCE_REVERSAL))
        if part.is_channel or not part.channel.startswith(SINCE_REVERSAL):
            lies = f"{part.where} {spelled(part.channel)} = {_between(low, high)}"
        else:
            lies = f"within {high:.3g} s of a reversal of {of}" if high > 0.0 else f"where {of} reverses"
    text = text_of(
        "where.txt.jinja",
        d=diagnosis,
        places=[f"{one}{' of the error there is not noise' * (not i)})" for i, one in enumerate(places)],
        gates=_gates(location.region, location.since, location.since_episode, diagnosis.dt),
        lies=lies,
        coarse=[
            f"{number(e.finely)} of {spelled(name)}'s {number(e.before)} {e.unit}"
            for name, e in diagnosis.fit.one_step.items()
            if e.finely is not None and e.finely < COARSE * e.before
        ],
    )
    return " ".join(text.split())


def gate_text(effect: NamedEffect, dt: float | None) -> str:
    """Where and since when an effect acts; empty where it does so always."""
    said = _gates(effect.region, effect.since, effect.since_episode, dt)
    if effect.recordings is not None:
        said.append(f"only in {listed([spelled(name) for name in effect.recordings])}")
    return ", ".join(said)


def _gates(
    region: Mapping[str, tuple[float, float]], since: float | None, episode: str | None, dt: float | None
) -> list[str]:
    said = [f"only where {spelled(name)} in {_between(low, high)}" for name, (low, high) in region.items()]
    if since is not None:
        said.append(f"since t = {_moment(since, dt)} s")
    if episode is not None:
        said.append(f"since episode {spelled(episode)}")
    return said


def _between(low: float, high: float) -> str:
    """An interval: three digits of its ends, more where they share the first ones."""
    size, width = max(abs(low), abs(high)), abs(high - low)
    shared = math.floor(math.log10(size / width)) if 0 < width < math.inf else 0
    digits = 3 + max(shared, 0)
    return f"[{low:.{digits}g}, {high:.{digits}g}]"


def _moment(t: float, dt: float | None) -> str:
    """A moment [s] to a step of its clock, dt [s]; three digits where nobody knows that step."""
    return f"{t:.{max(0, math.ceil(-math.log10(dt)))}f}" if dt else f"{t:.3g}"


GEOMETRY: Mapping[GeometryKind, str] = {
    "frame turn": "the base's turn about {axis}",
    "frame place": "the base's place along {axis}",
    "joint zero": "the zero of {on}",
    "body place": "the position of {on} along {axis}",
    "body turn": "the rotation of {on} about {axis}",
    "site place": "the position of {on} along {axis}",
    "site turn": "the rotation of {on} about {axis}",
    "delay": "the delay of motion capture",
}


def place_name(place: GeometryPlace) -> str:
    """`the zero of elbow`, `the place of forearm along x`."""
    return GEOMETRY[place.kind].format(on=spelled(place.on), axis=place.axis)


def found_text(found: GeometryFound) -> str:
    """`the zero of elbow is off by 0.0200 ± 0.0001 rad`, and what would do as well."""
    off = "is" if found.place.kind == "delay" else "is off by"
    said = f"{place_name(found.place)} {off} {size_text('', found.size)}"
    others = instead_text(found)
    return f"{said}; {others}" if others else said


def instead_text(found: GeometryFound) -> str:
    """What would explain the same; empty where nothing does."""

    def named(other: InPlaceOf) -> str:
        return f"{place_name(other.place)} ({other.value:.3g} {other.unit})"

    def shown(other: InPlaceOf) -> str:
        if found.size.unit != other.unit:
            return "a sum"
        return "the sum" if found.size.value * other.value > 0.0 else "the difference"

    said = [f"of it and {named(i)} only {shown(i)} shows" for i in found.instead if i.exact]
    if alike := [named(i) for i in found.instead if not i.exact]:
        said.append(f"this recording cannot separate it from {listed(alike, None, 'or')}")
    return "; ".join(said)


def inseparable_text(entry: Inseparable) -> str:
    """`the zero of joint1 and the base's turn about z: only a sum shows`."""
    if not entry.of:
        return f"{place_name(entry.place)} does not show at all"
    return f"{listed([place_name(entry.place), *map(place_name, entry.of)], None)}: only a sum shows"


def geometry_lines(found: Kinematics | None) -> list[str]:
    """The account's lines: the robot's numbers, those of the laboratory, and the tool's error; none without poses."""
    if found is None:
        return []
    lines = [found_text(f) for f in found.found if f.model]
    lines = lines or ["zeros and lengths agree with the model, within the accuracy of motion capture"]
    for name, error in found.error.items():
        mm = [brief(1e3 * v) for v in (error.before, error.after, error.placed, error.noise)]
        lines.append(
            f"{spelled(name)} is {mm[0]} → {mm[1]} mm off on held-out samples (with only the base aligned {mm[2]}, "
            f"noise {mm[3]})"
        )
    laboratory = [found_text(f) for f in found.found if not f.model]
    return [*lines, *([f"the laboratory: {'; '.join(laboratory)}"] if laboratory else [])]


def with_sentences(found: Kinematics | None) -> Kinematics | None:
    """With every sentence that diagnosis.json holds."""
    if found is None:
        return None
    return replace(
        found,
        found=tuple(replace(f, sentence=f.sentence or found_text(f)) for f in found.found),
        inseparable=tuple(replace(i, sentence=i.sentence or inseparable_text(i)) for i in found.inseparable),
    )
