"""The table of an account: the effects in plain words, how large, how much of the mismatch, how sure."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from gpsim.diagnosis import Diagnosis
from gpsim.findings import Form, MeasuredCurve, NamedEffect
from gpsim.reports.diagnosis_text import gate_text, listed, noun
from gpsim.reports.quantities import certainty_text, is_open, percent, shortened, size_text, spelled
from gpsim.reports.sheets import MISSING

SIGNED = {"gain_positive": "gain +", "gain_negative": "gain −"}
"""Of a gain by the command's direction, short enough for a table."""
MANY_JOINTS = 3  # with the same effect, which are told as one group
LARGE = 0.1  # of the mismatch: what is no claim and yet as much has others in its place
LAW: Mapping[Form, str] = {"holds": "yes", "approximate": "approximately", "untested": "not tested"}
MEASURED = "measured"  # of a curve, which is no law of the catalogue
TRIFLE = 0.005  # of the mismatch: a slight curve that is less of it is named among the small corrections only
LEVEL = 0.05  # of all that a curve rises and falls: a turn that is smaller is none


@dataclass(frozen=True)
class Row:
    """An effect of the table.

    whole: its name with all of its letters; gate: where and since when it acts, where it is not the only one; sizes:
    of each parameter its name, empty of the only one, and how large; share: of the mismatch, None where nobody computed
    it; percent, interval: the same in words; certainty: how sure it is; instead: what the data cannot tell it apart
    from, if anything. members: of a group (`Coulomb friction on 6 joints`) each joint and how large it is there.
    """

    effect: str
    whole: str
    gate: str
    sizes: tuple[tuple[str, str], ...]
    share: float | None
    percent: str
    interval: str
    certainty: str
    instead: str
    law: str
    approximate: bool
    members: tuple[tuple[str, str], ...] = ()


def told_effects(diagnosis: Diagnosis) -> tuple[list[NamedEffect], list[NamedEffect]]:
    """Headline and slight effects, the most important first; none of an account that explains too little to be told."""
    if diagnosis.verdict in ("unknown", "none"):
        return [], []
    ordered = sorted(diagnosis.effects, key=_weight, reverse=True)
    headline, slight = ([e for e in ordered if e.role == role] for role in ("headline", "slight"))
    return headline, slight


def effect_name(effect: NamedEffect) -> str:
    """What it is and what it acts on: `Coulomb friction on x`."""
    return claim_name(effect.family, effect.place)


def claim_name(family: str, place: str) -> str:
    """The same, of a family and a place."""
    return f"{noun(family)} on {spelled(place)}"


def rows_of(headline: Sequence[NamedEffect], diagnosis: Diagnosis) -> list[Row]:
    """A row for every effect, and one for all joints where many have an effect of the same kind."""
    out, grouped = [], set[str]()
    for effect in headline:
        group = [e for e in headline if e.family == effect.family and _may_be_grouped(e)]
        if not _may_be_grouped(effect) or len(group) < MANY_JOINTS:
            out.append(_row_of(effect, diagnosis))
        elif effect.family not in grouped:
            grouped.add(effect.family)
            out.append(_group_of(group))
    return sorted(out, key=lambda row: -1.0 if row.share is None else row.share, reverse=True)


def _may_be_grouped(effect: NamedEffect) -> bool:
    return (
        (effect.site in ("force", "actuator") or effect.family == "armature")
        and not (effect.region or effect.since or effect.recordings)
        and len(effect.parameters) == 1
    )


def _group_of(group: Sequence[NamedEffect]) -> Row:
    """One row of the same effect on several joints: what it is worth altogether, the weakest odds, each size.

    Commands over one bus come equally late: one size for all.
    """
    shares = [e.importance.share for e in group if e.importance is not None]
    share = sum(shares) if shares and math.isfinite(sum(shares)) else None
    forms = {e.form for e in group}
    form: Form = next((f for f in ("approximate", "untested") if f in forms), "holds")
    weakest = min(group, key=lambda e: math.inf if e.odds is None or e.odds.nats is None else e.odds.nats)
    on = "actuators" if group[0].site == "actuator" else "joints"
    name = f"{noun(group[0].family)} on {len(group)} {on}"
    members = sorted((e.place, _sizes(e)[0][1]) for e in group)
    alike = len({size for _, size in members}) == 1
    return Row(
        effect=name,
        whole=name,
        gate="",
        sizes=(("", f"{members[0][1]} each" if alike else "each below"),),
        share=share,
        percent=MISSING if share is None else f"{percent(share)} %",
        interval="",
        certainty=certainty_text(weakest.odds),
        instead=_instead(weakest),
        law=LAW[form],
        approximate=form == "approximate",
        members=() if alike else tuple(sorted(members, key=lambda m: _natural(m[0]))),
    )


def _natural(name: str) -> list[tuple[int, str]]:
    """Names in the order in which people count: j2 before j10."""
    return [(int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", name)]


def _row_of(effect: NamedEffect, diagnosis: Diagnosis) -> Row:
    part, curve = effect.importance, effect.curve
    share = None if part is None or not math.isfinite(part.share) else part.share
    interval = ""
    if part is not None and part.low is not None and part.high is not None:
        interval = f"{percent(part.low)} to {percent(part.high)} %"
    alone = len(diagnosis.effects) == 1  # then the account says above where it acts
    return Row(
        effect=effect_name(effect),
        whole=f"{noun(effect.family)} on {effect.place}",
        gate="" if alone else gate_text(effect, diagnosis.dt),
        sizes=_sizes(effect),
        share=share,
        percent=MISSING if share is None else f"{percent(share)} %",
        interval=interval,
        certainty=certainty_text(effect.odds),
        instead=_instead(effect),
        law=LAW[effect.form] if curve is None else MEASURED,
        approximate=effect.form == "approximate",
    )


def _instead(effect: NamedEffect) -> str:
    """What could replace an effect, where the odds do not decide."""
    if effect.odds is None or not is_open(effect.odds):
        return ""
    others = [claim_name(*claim) for claim in effect.odds.against if claim != (effect.family, effect.place)]
    return f"cannot be told apart from {listed(others)}" if others else "the data fit as well without it"


def slight_text(effects: Sequence[NamedEffect]) -> str:
    """What is no claim, in a line: what, how large, how much of the mismatch.

    One that makes much of the mismatch is not small: others do as well in its place.
    """
    told = []
    for effect in effects:
        numbers = [f"{name} {size}".strip() for name, size in _sizes(effect)[:1]]
        if effect.importance is not None:
            numbers.append(f"{percent(effect.importance.share)} %")
        told.append(f"{effect_name(effect)} ({', '.join(numbers)})" if numbers else effect_name(effect))
    small = all(_weight(effect) < LARGE for effect in effects)
    why = "not claims, because other effects could replace them"
    return f"{'small corrections, not claims' if small else why}: {'; '.join(told)}" if told else ""


def _sizes(effect: NamedEffect) -> tuple[tuple[str, str], ...]:
    """A size a parameter, by its name where there are several; of a curve from where to where it goes."""
    if (curve := effect.curve) is not None:
        return (("", f"{min(curve.values):.3g} to {max(curve.values):.3g} {curve.unit}"),)
    several = len(effect.parameters) > 1
    return tuple(
        (SIGNED.get(name, name.replace("_", " ")) if several else "", size_text(name, p))
        for name, p in effect.parameters.items()
    )


def _weight(effect: NamedEffect) -> float:
    share = effect.explains if effect.importance is None else effect.importance.share
    return share if math.isfinite(share) else -math.inf


def curve_sentence(effect: NamedEffect) -> str:
    """No law of the catalogue, and what the curve does: `it goes from 2.2 N at q_dot = -0.64 m/s to -2.9 at 0.5`."""
    curve = effect.curve
    assert curve is not None
    where = "" if effect.recordings is None else f" in {', '.join(effect.recordings)}"
    head = f"no catalogue law for {shortened(curve.quantity)} over {shortened(curve.input)}"
    if len(curve.values) != len(curve.at):  # a map, in files of earlier versions
        return (
            f"{head}; it lies between {min(curve.values):.3g} and {max(curve.values):.3g} {curve.unit}{where}"
        )
    first, *between, last = [(curve.at[i], curve.values[i]) for i in _turns(curve.values)]
    over = " and ".join(f"{y:.3g} at {x:.3g}" for x, y in between[:2])
    start = f"{first[1]:.3g} {curve.unit} at {shortened(curve.input)} = {first[0]:.3g} {curve.input_unit}"
    ends = f"{f' over {over}' if over else ''} to {last[1]:.3g} at {last[0]:.3g}"
    return f"{head}; it goes from {start}{ends}{where}"


def _turns(values: Sequence[float]) -> list[int]:
    """The ends of a curve and, between them, its one or two largest turns."""
    last, least = len(values) - 1, LEVEL * (max(values) - min(values))
    inner = sorted({values.index(max(values)), values.index(min(values))} - {0, last})
    return [
        0,
        *(i for i in inner if min(abs(values[i] - values[0]), abs(values[i] - values[last])) > least),
        last,
    ]


def curve_rows(effects: Sequence[NamedEffect]) -> Iterator[str]:
    """The sentence of every measured curve of an account that is worth a line."""
    for effect in effects:
        part = effect.importance
        little = effect.role == "slight" and part is not None and part.share < TRIFLE
        if effect.curve is not None and not little:
            yield curve_sentence(effect)


def beyond(curve: MeasuredCurve) -> str:
    """What to record where nothing else is left: where the curve was never measured."""
    low, high = curve.visited
    reach = f"[{low:.3g}, {high:.3g}] {curve.input_unit}"
    return f"record {shortened(curve.input)} beyond {reach}, if you need that range: the curve ends there"
