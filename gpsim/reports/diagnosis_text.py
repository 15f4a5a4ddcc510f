"""Where recording and simulator differ, in words, and the list of all explanations that were fitted."""

from __future__ import annotations

import math
from collections.abc import Sequence

from gpsim.diagnosis import Diagnosis
from gpsim.diagnosis.assessment import SINCE_REVERSAL
from gpsim.diagnosis.report import Claims, NamedEffect, RankedHypothesis
from gpsim.reports.lettering import shortened
from gpsim.reports.quantities import number, percent

NOTHING = "nothing missing"
RANKINGS = {"all": "On all training windows:", "search": "Given up in the search, on its windows:"}
COARSE = 0.7  # of the base simulator's error, that finer steps leave: what they take away is worth a word
TRIFLE = 0.01  # of a rate's residual: less is not told
MOST = 3  # names that are told of a list


def ranking(diagnosis: Diagnosis) -> list[str]:
    """Every hypothesis that was fitted, the best first; those of the search alone, which had fewer data, at the end."""
    lines = []
    for windows, title in RANKINGS.items():
        group = [entry for entry in diagnosis.ranking if entry.windows == windows]
        if group:
            lines += [title, *(_ranked(entry) for entry in group)]
    return lines


def where(diagnosis: Diagnosis) -> str:
    """In which rates, on what they depend, in which part of state or time, and what of the log was looked at."""
    location = diagnosis.location
    if diagnosis.verdict == "none":
        return f"nowhere beyond noise and numerical error.{_own_step(diagnosis)}{_looked_at(diagnosis)}"
    shares = sorted(location.channels.items(), key=lambda item: -item[1])
    told = [f"{percent(share)} % of {shortened(name)}'s" for name, share in shares if share > TRIFLE]
    text = f"beyond noise lies {listed([f'{told[0]} residual', *told[1:]])}" if told else _no_part(diagnosis)
    if location.depends_on:
        text += f"; it depends on {listed([shortened(name) for name in location.depends_on])}"
    for name, (low, high) in location.region.items():
        text += f"; it acts where {in_region(name, low, high)}"
    if location.since is not None:
        text += f"; since t = {_moment(location.since, diagnosis.dt)} s"
    if location.since_episode is not None:
        text += f"; since episode {shortened(location.since_episode)}"
    return f"{text}{_part(diagnosis)}.{_looked_at(diagnosis)}"


def gate_text(effect: NamedEffect, dt: float | None) -> str:
    """Where and since when an effect acts; empty where it does so always."""
    said = [f"only where {in_region(name, low, high)}" for name, (low, high) in effect.region.items()]
    if effect.since is not None:
        said.append(f"since t = {_moment(effect.since, dt)} s")
    if effect.since_episode is not None:
        said.append(f"since episode {shortened(effect.since_episode)}")
    if effect.recordings is not None:
        said.append(f"only in {listed([shortened(name) for name in effect.recordings])}")
    return ", ".join(said)


def in_region(name: str, low: float, high: float) -> str:
    """`x in [-1.1, -0.4]`."""
    return f"{shortened(name)} in {_between(low, high)}"


def listed(names: Sequence[str], most: int = MOST) -> str:
    """`a, b and c`; of a longer list the first ones and how many more there are."""
    if len(names) > most:
        names = [*names[:most], f"{len(names) - most} more"]
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def _own_step(diagnosis: Diagnosis) -> str:
    """What of the residual the base simulator's own step makes, where that is much."""
    errors = [(name, e, e.finely) for name, e in diagnosis.fit.one_step.items() if e.finely is not None]
    coarse = [(name, e, finely) for name, e, finely in errors if finely < COARSE * e.before]
    if not coarse:
        return ""
    left = listed(
        [f"{number(finely)} of {shortened(n)}'s {number(e.before)} {e.unit}" for n, e, finely in coarse]
    )
    return f" The simulator's own step is coarse: integrated finely, {left} is left one step ahead."


def _part(diagnosis: Diagnosis) -> str:
    """In which part of state, action or time nearly all of it lies; what a named region says already is left out."""
    location, part = diagnosis.location, diagnosis.location.concentrated
    named = location.region or location.since is not None or location.since_episode is not None
    if part is None or named:
        return ""
    (low, high), name = part.interval, part.channel
    of = name if part.is_channel else name.removeprefix(SINCE_REVERSAL)
    lies = f"{part.where} {shortened(name)} = {_between(low, high)}" if of == name else _soon_after(of, high)
    return (
        f"; {percent(part.share_of_mismatch)} % of {shortened(part.rate)}'s lies {lies}, "
        f"in {percent(part.share_of_samples)} % of the samples"
    )


def _soon_after(of: str, seconds: float) -> str:
    of = shortened(of)
    return f"within {seconds:.3g} s of a reversal of {of}" if seconds > 0.0 else f"where {of} turns round"


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
        text += f" The clock is fast: every {_ordinal(diagnosis.thinned)} sample was read, commands averaged between."
    if diagnosis.not_measured:
        names = listed([shortened(name) for name in diagnosis.not_measured])
        text += f" Nobody measured {names}: it is what each model's own windows say."
    return text


def _ordinal(number: int) -> str:
    return f"{number}{ {2: 'nd', 3: 'rd'}.get(number, 'th') }"


def _no_part(diagnosis: Diagnosis) -> str:
    return (
        "beyond noise lies a small part of the residual"
        if diagnosis.fit.one_step
        else "in a rate that nobody measured"
    )


def _ranked(entry: RankedHypothesis) -> str:
    gates = entry.gates or ("",) * len(entry.effects)
    terms = [
        f"{family} on {on}" + (f" (for some {gate})" if gate else "")
        for (family, on), gate in zip(entry.effects, gates, strict=True)
    ]
    return f"{entry.nats_behind:10.1f}  {entry.scheme:<14} {' + '.join(terms) or NOTHING}"


def terms_text(effects: Claims) -> str:
    """The families and places of an explanation."""
    return " + ".join(f"{family} on {on}" for family, on in effects) or NOTHING
