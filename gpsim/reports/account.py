"""A diagnosis as an account that a roboticist can act on: what terminal and page show, in the same words.

Verdict, where, what, left, fit, next, in this order. Nats, p-values and intervals of ratios are in `statistics_text`.
"""

from __future__ import annotations

import math
import shlex
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

from gpsim.diagnosis import Diagnosis
from gpsim.diagnosis.settings import VerdictSettings
from gpsim.findings import (
    Claims,
    Estimate,
    JudgedOn,
    Leads,
    NamedEffect,
    OneRecording,
    RolloutErrors,
    Share,
    StepErrors,
    sized,
)
from gpsim.mjcf import is_mujoco
from gpsim.reports.account_effects import (
    Row,
    claim_name,
    curve_rows,
    effect_name,
    rows_of,
    slight_text,
    told_effects,
)
from gpsim.reports.diagnosis_text import combination_texts, geometry_lines, parameters_of, where
from gpsim.reports.pages import environment
from gpsim.reports.quantities import (
    brief,
    certainty_text,
    in_percent,
    is_open,
    listed,
    percent,
    shortened,
    size_text,
    spelled,
)
from gpsim.reports.sheets import unit
from gpsim.reports.wording import worded
from gpsim.simulators import lives_here

HERE = "DIR"
"""What stands for the diagnosis's folder, where that is not known."""
JUDGED: Mapping[JudgedOn, str] = {
    "held-out rollouts": "",
    "cross-fitted rollouts": " (cross-fitted, because too little is held out)",
    "fit windows": " (on its own training data: held-out rollouts show no mismatch)",
}
"""What a share is of, where that is not what anybody would expect."""
LEADS: Mapping[Leads, str] = {
    "likeliest": "the table shows the likeliest",
    "simplest": "the table shows the simplest explanation within odds of 10 to 1",
}
TRAINED: Mapping[str, str] = {"cartpole": "", "unicycle": "experiment=limo "}
"""Simulators in which gpsim trains policies, and which experiment does."""
POOR = 0.5  # of a rate's mismatch one step ahead: an account that explains less of it says so
MOST_FACTS = 3  # of parameters that only act together: further ones are in diagnosis.json
THEN = "\x1e"  # between sentences: no name holds it
VAGUE = 0.25  # half an interval over its value: a size that is known less well is worth another recording
MOST_RIVALS = 2  # that are told, the likeliest; further ones are in diagnosis.json
MOST = 4  # recordings of which each is told in a line


@dataclass(frozen=True)
class Change:
    """An error of one channel on held-out data.

    after: None where nothing is corrected; black_box: what could be reached, None where that is no better.
    """

    channel: str
    before: str
    after: str | None
    unit: str
    noise: str | None = None
    black_box: str | None = None

    @property
    def said(self) -> str:
        """`9.2 → 0.11 m/s² (noise 0.1)`; `0.19 → 0.002 m (a black box would reach 0.0005)`."""
        change = self.before if self.after is None else f"{self.before} → {self.after}"
        beside = f" (noise {self.noise})" if self.noise else ""
        if self.black_box is not None:
            beside += f" (a black box would reach {self.black_box})"
        return f"{change} {self.unit}{beside}"


@dataclass(frozen=True)
class Fit:
    """Held-out errors before and after, of rates one step ahead or of channels after a rollout; title: which."""

    title: str
    changes: tuple[Change, ...]
    missing: str = ""


@dataclass(frozen=True)
class Account:
    """The parts of an account. rows: of the headline effects, the most important first; slight: of all others.

    A layout may cut any sentence at its end. command: None where there is nothing to train in; command_here: the same
    with DIR in the folder's place, where a folder's name is too long. differs: between several recordings. geometry:
    what a motion capture says, none without one.
    """

    verdict: str
    sentence: str
    where: str
    rows: tuple[Row, ...]
    slight: str
    rivals: tuple[str, ...]
    differs: tuple[str, ...]
    left: tuple[str, ...]
    fit: tuple[Fit, ...]
    next: tuple[str, ...]
    command: str | None
    command_here: str | None
    geometry: tuple[str, ...] = ()


def account_of(diagnosis: Diagnosis, folder: str = HERE, simulator: str | None = None) -> Account:
    """The account; folder: of the diagnosis, as the command that trains with it should name it, if that is short.

    simulator: the name of the base simulator, on which that command depends.
    """
    told = worded(diagnosis)
    headline, slight = told_effects(told)
    said = _sentences(told, headline)
    return Account(
        verdict=told.verdict,
        sentence=said("verdict")[0],
        where=where(told),
        rows=tuple(rows_of(headline, told)),
        slight=slight_text(slight),
        rivals=(*curve_rows((*headline, *slight)), *_rivals(told)),
        differs=tuple(differences(told)),
        left=said("left"),
        fit=_fit(told),
        next=said("next"),
        command=_command(told, folder, simulator),
        command_here=_command(told, HERE, simulator),
        geometry=tuple(geometry_lines(told.kinematics)),
    )


def _sentences(d: Diagnosis, headline: Sequence[NamedEffect]) -> Callable[[str], tuple[str, ...]]:
    """said(part): the sentences of a part, of which the template has the words."""
    share, vaguest = d.explained.rollout, max(headline, key=_vagueness, default=None)
    module = _template().make_module(
        {
            "d": d,
            "headline": headline,
            "then": THEN,
            "judged": JUDGED,
            "others": _others(d, headline),
            # The verdict would be `partial` if all laws held.
            "much_left": share is not None
            and share.high is not None
            and share.high < VerdictSettings().nearly_all,
            "vague": [effect_name(e) for e in headline if _held(e) or not sized(e.family, e.parameters)],
            "held": [effect_name(e) for e in headline if _held(e)],
            "vaguest": effect_name(vaguest) if vaguest is not None and _vagueness(vaguest) > VAGUE else "",
            "curve": next((e.curve for e in headline if e.curve is not None), None),
            "part": left_share(d),
            "combined": combination_texts(d.combinations[:MOST_FACTS]),
            "poor": [
                f"{percent(found.share)} % of {spelled(rate)}"
                for rate, found in d.explained.one_step.items()
                if found.share < POOR
            ],
            "learnt": _learnt(d),
        }
    )

    def said(part: str) -> tuple[str, ...]:
        found = str(getattr(module, part)()).split(THEN)
        return tuple(text for one in found if (text := " ".join(one.split())))

    return said


@cache
def _template() -> Any:
    made = environment(escapes=False)
    made.filters |= {"effect": effect_name, "parameters": parameters_of}
    return made.get_template("account.txt.jinja")


def _held(effect: NamedEffect) -> bool:
    return any(size.at_bound for size in effect.parameters.values())


def _others(diagnosis: Diagnosis, headline: Sequence[NamedEffect]) -> str:
    """How many alternatives; where there is none, the best explanation without the claim whose odds are lowest."""
    count = len(diagnosis.alternatives)
    odds = [(e.odds.nats, e.odds) for e in headline if e.odds is not None and e.odds.nats is not None]
    if count or not odds:
        return "another explanation" if count < 2 else f"{count} other explanations"
    lowest = min(odds, key=lambda pair: pair[0])[1]
    told = listed([claim_name(*claim) for claim in lowest.against]) or "nothing at all"
    return told if is_open(lowest) else f"{told} (odds of {certainty_text(lowest)})"


def _rivals(diagnosis: Diagnosis) -> Iterator[str]:
    """Nothing where one explanation stands alone, or all others claim the same."""
    if diagnosis.verdict == "named" or not diagnosis.alternatives or not any(told_effects(diagnosis)):
        return

    def claims_of(effects: Sequence[NamedEffect]) -> Claims:
        return tuple((effect.family, effect.place) for effect in effects)

    def said(claims: Sequence[tuple[str, str]]) -> str:
        return listed([claim_name(family, place) for family, place in claims]) or "nothing more"

    every = [claims_of(diagnosis.effects), *(claims_of(rival.effects) for rival in diagnosis.alternatives)]
    certain = [claim for claim in every[0] if all(claim in claims for claims in every)]
    chances = [diagnosis.effects[0].probability, *(rival.probability for rival in diagnosis.alternatives)]
    open_ = [
        f"{said([claim for claim in claims if claim not in certain])} ({percent(p)} %)"
        for claims, p in zip(every, chances, strict=True)
    ]
    claimed = claims_of([effect for effect in diagnosis.effects if effect.role == "headline"])
    shared = [claim for claim in certain if claim in claimed]  # what is slight is no claim, whoever shares it
    if shared:
        yield f"in every explanation: {said(shared)}"
    first, further = open_[: 1 + MOST_RIVALS], len(open_) - 1 - MOST_RIVALS
    more = f" or {further} more in diagnosis.json" if further > 0 else ""
    yield f"either {' or '.join(first)}{more}; {LEADS[diagnosis.leads]}"


def _learnt(diagnosis: Diagnosis) -> bool:
    return diagnosis.remainder.gp is not None and diagnosis.remainder.gp.used


def left_share(diagnosis: Diagnosis) -> float | None:
    """Of the mismatch what is left; None of an earlier version."""
    found = diagnosis.explained.rollout
    given = diagnosis.remainder.share
    return given if given is not None else None if found is None else max(0.0, 1.0 - found.share)


def _fit(diagnosis: Diagnosis) -> tuple[Fit, ...]:
    steps, rollout = diagnosis.fit.one_step, diagnosis.fit.rollout
    corrected = diagnosis.verdict != "none" and bool(told_effects(diagnosis)[0])
    learnt = diagnosis.verdict == "unknown" and _learnt(diagnosis)

    def after(effects: float, process: float) -> str | None:
        return brief(process) if learnt else brief(effects) if corrected else None

    def reached(errors: RolloutErrors) -> str | None:
        """What a black box would reach, where that is better than the account in this channel and over all."""
        box, value = diagnosis.fit.black_box, errors.black_box
        if not corrected or box is None or value is None or not box.takes_off.share > 0.0:
            return None
        return brief(value) if value < errors.after and brief(value) != brief(errors.after) else None

    def change(name: str, e: StepErrors | RolloutErrors, **beside: str | None) -> Change:
        return Change(name, brief(e.before), after(e.after, e.after_gp), unit(e.unit), **beside)

    ahead = (
        change(n, e, noise=brief(e.noise_floor) if e.noise_floor > 0.0 else None) for n, e in steps.items()
    )
    runs = (change(n, e, black_box=reached(e)) for n, e in rollout.channels.items())
    return (
        Fit("one step", tuple(ahead), "no rate follows from what was recorded"),
        Fit(f"after {rollout.horizon_s:.3g} s", tuple(runs), "no held-out stretch is as long"),
    )


def _vagueness(effect: NamedEffect) -> float:
    """Half the interval's width over the value, the largest of its sizes."""

    def relative(size: Estimate) -> float:
        if size.low is None or size.high is None or not math.isfinite(size.value):
            return math.inf
        width = abs(size.high - size.low) / 2
        return width / abs(size.value) if size.value else math.inf if width else 0.0

    return max(map(relative, effect.parameters.values()), default=0.0)


def _command(diagnosis: Diagnosis, folder: str, simulator: str | None) -> str | None:
    """How to train in the corrected simulator; None where nothing corrects it.

    simulator: the base's name, None where nobody knows it. gpsim has policies for two; a MuJoCo model is written out
    again with its effects; of all others Python reads it.
    """
    learnt, effects = _learnt(diagnosis), any(told_effects(diagnosis))
    if diagnosis.verdict == "none" or not (learnt or effects):
        return None
    if simulator is not None and effects and is_mujoco(simulator):
        return f"gpsim export model {shlex.quote(folder)} --out robot_corrected.xml"
    if simulator is not None and simulator not in TRAINED:
        base = ", simulator" if lives_here(simulator) else ""
        return f"python: gpsim.Diagnosis.load({folder!r}{base}).corrected({'gp=True' if learnt else ''})"
    given = shlex.quote(f"diagnosis={folder}")
    more = " correction=effects+gp" if learnt else ""
    return f"gpsim train-gp-policy {TRAINED.get(simulator or '', '')}{given}{more}"


def differences(diagnosis: Diagnosis) -> list[str]:
    """What differs between the recordings, then how much of each the account explains; nothing of one alone."""
    recordings = diagnosis.recordings or ()
    if not recordings or diagnosis.verdict in ("unknown", "none"):
        return []
    names = [recording.name for recording in recordings]
    told = [_difference(effect, names) for effect in diagnosis.effects if effect.own]
    told = told or ["no differences found: one account fits all recordings"]
    if len(recordings) > MOST:
        return [*told, "how much of each recording is explained: one column per recording in report.html"]

    def share(part: Share | None) -> str:
        return "nothing to explain" if part is None else f"{percent(part.share)} %"

    each = ", ".join(f"{shortened(r.name)} {share(r.explained)}" for r in recordings)
    learnt = ", ".join(share(r.from_others.explained) for r in recordings if r.from_others is not None)
    return [*told, f"explained of {each}" + (f"; from the others {learnt}" if learnt else "")]


def _difference(effect: NamedEffect, names: Sequence[str]) -> str:
    """One effect in the recordings: its size in each, and by how much it grew or fell where that can be said."""
    parts = [
        f"{f'{name} ' if len(effect.parameters) > 1 else ''}{_sizes(effect, name, names)}"
        for name in effect.parameters
    ]
    return f"{effect_name(effect)} {_change(effect, names) or 'differs'}: {'; '.join(parts)}"


def _sizes(effect: NamedEffect, parameter: str, names: Sequence[str]) -> str:
    """`1.0 N in monday, 1.1 N in friday`; what most share is told once."""
    own = [name for name in names if parameter in (effect.own or {}).get(name, {})]
    others = [name for name in names if name not in own]
    each = names if len(names) <= 2 else own
    said = [f"{size_in(effect, parameter, name)} in {shortened(name)}" for name in each[:MOST]]
    if len(each) > MOST:
        said.append(f"{len(each) - MOST} more in the table")
    if len(names) > 2 and others:
        where = f"in {shortened(others[0])}" if len(others) == 1 else "in the others"
        said.append(f"{size_in(effect, parameter, others[0])} {where}")
    return ", ".join(said)


def size_in(effect: NamedEffect, parameter: str, recording: str) -> str:
    """A parameter as it is in one recording."""
    found = value_in(effect, parameter, recording)
    return "none" if found is None else size_text(parameter, found)


def value_in(effect: NamedEffect, parameter: str, recording: str) -> Estimate | None:
    """A parameter as it is in one recording; None where the effect does not act."""
    own = (effect.own or {}).get(recording, {})
    if parameter in own:
        return own[parameter]
    return None if effect.recordings is not None else effect.parameters.get(parameter)


def _change(effect: NamedEffect, names: Sequence[str]) -> str:
    """`grew by 14 % from monday to friday`, of one size in two recordings that is more than an offset."""
    if len(names) != 2 or len(effect.parameters) != 1 or effect.site == "sensor":
        return ""
    (parameter,) = effect.parameters
    first, last = (value_in(effect, parameter, name) for name in names)
    if first is None or last is None or not (first.value > 0.0 and last.value > 0.0):
        return ""
    known = [(e.low, e.high) for e in (first, last) if not (e.at_bound or e.low is None or e.high is None)]
    if len(known) < 2 or not (known[0][1] < known[1][0] or known[1][1] < known[0][0]):
        return ""  # where the intervals overlap, nobody knows by how much
    ratio = last.value / first.value
    verb = "grew" if ratio > 1.0 else "fell"
    return f"{verb} by {in_percent(abs(ratio - 1.0))} % from {shortened(names[0])} to {shortened(names[1])}"


def episodes_text(recording: OneRecording) -> str:
    """The names of its held-out episodes, without its own in front of them."""
    names = [name.removeprefix(f"{recording.name}/") for name in recording.held_out]
    shown = ", ".join(names[:MOST]) + (f" and {len(names) - MOST} more" if len(names) > MOST else "")
    return f"episode {shown}" if shown else "nothing"
