"""A fleet's diagnoses side by side: which robots differ from the others, in what, and since when."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median

from matplotlib.figure import Figure

from gpsim.diagnosis import Diagnosis
from gpsim.findings import Estimate, NamedEffect
from gpsim.reports.account import account_of
from gpsim.reports.account_effects import claim_name, effect_name, told_effects
from gpsim.reports.account_lines import account_lines
from gpsim.reports.canvas import INK, data_uri, named, panels, style
from gpsim.reports.diagnosis_text import gate_text
from gpsim.reports.pages import page_of, resource
from gpsim.reports.quantities import shortened, size_text
from gpsim.reports.sheets import MISSING

WIDER = 2.0  # times the 90 % interval: among hundreds of robots, one in ten lies outside of that by chance
TRIFLE = 0.1  # of the fleet's median: robots of one make differ by as much, and nobody mends it
SPREAD = 3.0  # robust standard deviations of the fleet
TO_SIGMA = 1.4826  # median absolute deviation to the standard deviation of a normal distribution
FEW = 3  # robots: of fewer nobody can say which is the odd one

Claim = tuple[str, str]  # family and place of an effect


@dataclass(frozen=True)
class Robot:
    """One recording's diagnosis; error: why there is none."""

    name: str
    diagnosis: Diagnosis | None
    error: str = ""

    @property
    def judged(self) -> bool:
        """Whether its account says which physics is missing, or that none is."""
        return self.diagnosis is not None and self.diagnosis.verdict != "unknown"

    @property
    def effects(self) -> dict[Claim, NamedEffect]:
        """Its headline effects."""
        told = told_effects(self.diagnosis)[0] if self.diagnosis is not None else []
        return {(effect.family, effect.place): effect for effect in told}

    @property
    def explanations(self) -> list[dict[Claim, NamedEffect]]:
        """Its headline effects, then those of each explanation that its recording cannot tell from them."""
        contested = self.diagnosis is not None and self.diagnosis.verdict != "named"
        others = self.diagnosis.alternatives if self.diagnosis is not None and contested else ()
        return [
            self.effects,
            *({(e.family, e.place): e for e in o.effects if e.role == "headline"} for o in others),
        ]

    @property
    def conceivable(self) -> set[Claim]:
        """All effects that its account holds or does not rule out."""
        if self.diagnosis is None:
            return set()
        lists = [self.diagnosis.effects, *(other.effects for other in self.diagnosis.alternatives)]
        return {(effect.family, effect.place) for effects in lists for effect in effects}


@dataclass(frozen=True)
class Deviation:
    """In what a robot differs from the others. here, others: in words; since: empty where it was so all along."""

    robot: str
    effect: str
    here: str
    others: str
    since: str = ""

    @property
    def sentence(self) -> str:
        """In one line."""
        when = f", {self.since}" if self.since else ""
        return f"{self.robot}: {self.effect}: {self.here}{when}; the others: {self.others}"


def deviations(robots: Sequence[Robot]) -> list[Deviation]:
    """Every difference, robot by robot.

    Where a recording cannot tell explanations apart, that one stands for the robot whose effects most others have.
    An effect belongs to the fleet where more than half of the judged robots have it. A robot that has another, that
    lacks one and does not hold it possible, or whose size is apart from the others', differs.
    """
    judged = [robot for robot in robots if robot.judged]
    often = Counter(claim for robot in judged for claim in robot.effects)

    def commonness(effects: dict[Claim, NamedEffect]) -> float:
        return sum(often[claim] for claim in effects) / max(len(effects), 1)

    told = {robot.name: max(robot.explanations, key=commonness) for robot in judged}
    claims = list(dict.fromkeys(claim for effects in told.values() for claim in effects))
    found = []
    for robot in judged if len(judged) > 1 else ():
        others = [other for other in judged if other is not robot]
        found += [d for claim in claims if (d := _deviation(robot, others, claim, told)) is not None]
    return found


def _deviation(
    robot: Robot, others: Sequence[Robot], claim: Claim, told: dict[str, dict[Claim, NamedEffect]]
) -> Deviation | None:
    having = [told[other.name][claim] for other in others if claim in told[other.name]]
    mine, name = told[robot.name].get(claim), claim_name(*claim)
    common = 2 * (len(having) + (mine is not None)) > len(others) + 1
    if mine is None:
        if not common or claim in robot.conceivable:
            return None
        return Deviation(robot.name, name, "none", _sizes(having))
    dt = robot.diagnosis.dt if robot.diagnosis is not None else None
    since = gate_text(mine, dt)
    if not common:
        possible = any(claim in other.conceivable for other in others)
        alone = "none, but not excluded for all" if possible else "none"
        some = f"{len(having)} of {len(others)} have it"
        return Deviation(robot.name, name, size_of(mine), some if having else alone, since)
    late = since and not any(gate_text(other, dt) for other in having)
    sizes = {key: [e.parameters[key] for e in having if key in e.parameters] for key in mine.parameters}
    if not late and not any(_apart(size, sizes[key]) for key, size in mine.parameters.items()):
        return None
    return Deviation(robot.name, name, size_of(mine), _sizes(having), since)


def _apart(mine: Estimate, others: Sequence[Estimate]) -> bool:
    """Whether a size is not the fleet's: beyond its interval, beyond a trifle, and beyond the fleet's own spread."""
    values = [o.value for o in others if math.isfinite(o.value) and not o.at_bound]
    if not values or not math.isfinite(mine.value) or mine.at_bound or mine.low is None or mine.high is None:
        return False
    if len(values) + 1 >= FEW:  # itself, too: of three the two that agree are not odd because of the third
        values.append(mine.value)
    middle = median(values)
    off = mine.value - middle
    half = (mine.value - mine.low) if off > 0 else (mine.high - mine.value)
    spread = TO_SIGMA * median(abs(value - middle) for value in values) if len(values) >= FEW else 0.0
    return abs(off) > max(WIDER * half, TRIFLE * abs(middle), SPREAD * spread)


def size_of(effect: NamedEffect) -> str:
    """Its parameters in words, each with its interval."""
    several = len(effect.parameters) > 1
    sizes = [
        f"{name.replace('_', ' ')} " * several + size_text(name, p) for name, p in effect.parameters.items()
    ]
    return ", ".join(sizes) or MISSING


def _sizes(effects: Sequence[NamedEffect]) -> str:
    named = [e for e in effects if e.parameters]
    if not named:
        return f"all {len(effects)} have it"
    ordered = sorted(named, key=lambda e: next(iter(e.parameters.values())).value)
    return f"{size_of(ordered[len(ordered) // 2])} in the middle of {len(named)}"


def headline(robots: Sequence[Robot], found: Sequence[Deviation]) -> str:
    """How many differ, in a sentence."""
    judged = [robot for robot in robots if robot.judged]
    odd = list(dict.fromkeys(d.robot for d in found))
    failed = sum(robot.diagnosis is None for robot in robots)
    open_ = len(robots) - len(judged) - failed
    beside = [f"{failed} could not be diagnosed"] if failed else []
    beside += [f"no account was possible for {open_}"] if open_ else []
    if len(judged) < 2:
        said = f"{len(judged)} of {len(robots)} recordings can be compared"
    elif not odd:
        said = f"no difference among {len(judged)} robots"
    elif len(judged) < FEW:
        said = "the two robots differ; a third would show which one is unusual"
    else:
        verb = "differs" if len(odd) == 1 else "differ"
        said = f"{len(odd)} of {len(judged)} robots {verb}: {', '.join(odd)}"
    return "; ".join([said, *beside])


ODD = "#B42318"  # as the page marks names
MOST, NAMED = 6, 30  # panels; robots whose names fit below an axis


def fleet_picture(robots: Sequence[Robot], found: Sequence[Deviation]) -> Figure | None:
    """The first parameter of each effect that more than half of the robots have; None where there is none."""
    odd = {(d.robot, d.effect) for d in found}
    judged = [robot for robot in robots if robot.judged]
    often = Counter(claim for robot in judged for claim in robot.effects).most_common()
    sizes: dict[Claim, dict[int, Estimate]] = {}
    for claim, count in often:
        having = [
            (i, r.effects[claim].parameters.values()) for i, r in enumerate(robots) if claim in r.effects
        ]
        first = {i: one for i, each in having if (one := next(iter(each), None)) and math.isfinite(one.value)}
        if 2 * count > len(judged) and count > 1 and first:
            sizes[claim] = first
    chosen = list(sizes.items())[:MOST]
    if not chosen:
        return None
    names = [robot.name for robot in robots]
    with style():
        size = (min(12.0, 2.5 + 0.28 * len(robots)), 1.9 * len(chosen) + 0.8)
        figure, axes = panels(len(chosen), 1, size, sharex=True)
        for axis, (claim, points) in zip(axes[:, 0], chosen, strict=True):
            for i, each in points.items():
                low, high = (each.value if end is None else end for end in (each.low, each.high))
                colour = ODD if (names[i], claim_name(*claim)) in odd else INK
                axis.plot([i, i], [low, high], color=colour, linewidth=1.2)
                axis.plot(i, each.value, "o", color=colour, markersize=4.5)
            axis.set_title(shortened(claim_name(*claim), 60))
            axis.set_ylabel(named("size", next(iter(points.values())).unit))
            axis.margins(y=0.15)
        last = axes[-1, 0]
        if len(names) <= NAMED:
            last.set_xticks(range(len(names)), [shortened(name) for name in names], rotation=60, ha="right")
        else:
            last.set_xlabel("robot, in the order of the table")
        last.set_xlim(-0.5, len(names) - 0.5)
    return figure


MORE = """
td, th, td:first-child, th:first-child { text-align: left; vertical-align: top; }
img { max-width: 100%; } pre { overflow-x: auto; background: #f6f7f9; padding: .7rem; } summary { cursor: pointer; }
"""


def fleet_page(robots: Sequence[Robot], simulators: Sequence[str]) -> str:
    """The page; simulators: the base of each recording. Equal diagnoses give equal pages."""
    found = deviations(robots)
    figure = fleet_picture(robots, found)
    odd = {d.robot for d in found}
    accounts = [
        [robot.error]
        if robot.diagnosis is None
        else account_lines(account_of(robot.diagnosis, simulator=simulator or None))
        for robot, simulator in zip(robots, simulators, strict=True)
    ]
    return page_of(
        "fleet.html.jinja",
        resource("plain.css") + MORE,
        robots=robots,
        said=headline(robots, found),
        picture=None if figure is None else data_uri(figure),
        differences=found,
        odd=odd,
        effects_of=_effects,
        accounts=list(zip((robot.name for robot in robots), accounts, strict=True)),
    )


def _effects(found: Diagnosis) -> list[str]:
    """Each headline effect with its size, and where it acts."""
    told = ((effect_name(e), size_of(e), gate_text(e, found.dt)) for e in told_effects(found)[0])
    return [" ".join(filter(None, parts)) for parts in told] or [MISSING]
