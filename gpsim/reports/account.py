"""A diagnosis as an account that a roboticist can act on: what terminal and page show, in the same words.

Verdict, where, what, left, fit, next, in this order. Nats, p-values and intervals of ratios are in `statistics_text`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from gpsim.diagnosis import Diagnosis
from gpsim.findings import EndErrors, Estimate, NamedEffect, OneRecording, RolloutErrors, Share
from gpsim.reports.account_effects import Row, curve_rows, effect_name, rows_of, slight_text, told_effects
from gpsim.reports.account_sentences import command, following, left, rivals, verdict_sentence
from gpsim.reports.diagnosis_text import where
from gpsim.reports.geometry_text import geometry_lines
from gpsim.reports.quantities import brief, in_percent, percent, share_text, shortened, size_text
from gpsim.reports.sheets import MISSING, Cell, Sheet, row, unit, with_unit
from gpsim.reports.wording import worded

HERE = "DIR"
"""What stands for the diagnosis's folder, where that is not known."""


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

    @property
    def corrected(self) -> bool:
        """Whether there is anything after."""
        return any(change.after is not None for change in self.changes)

    @property
    def boxed(self) -> bool:
        """Whether a black box would reach more in any."""
        return any(change.black_box is not None for change in self.changes)

    @property
    def noisy(self) -> bool:
        """Whether the noise is known of any."""
        return any(change.noise is not None for change in self.changes)


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
    return Account(
        verdict=told.verdict,
        sentence=verdict_sentence(told, headline),
        where=where(told),
        rows=tuple(rows_of(headline, told)),
        slight=slight_text(slight),
        rivals=(*curve_rows((*headline, *slight)), *rivals(told)),
        differs=tuple(differences(told)),
        left=tuple(left(told)),
        fit=_fit(told),
        next=tuple(following(told, headline)),
        command=command(told, folder, simulator),
        command_here=command(told, HERE, simulator),
        geometry=tuple(geometry_lines(told.kinematics)),
    )


def _fit(diagnosis: Diagnosis) -> tuple[Fit, ...]:
    steps, rollout = diagnosis.fit.one_step, diagnosis.fit.rollout
    gp = diagnosis.remainder.gp
    corrected = diagnosis.verdict != "none" and bool(told_effects(diagnosis)[0])
    learnt = diagnosis.verdict == "unknown" and gp is not None and gp.used

    def after(effects: float, process: float) -> str | None:
        return brief(process) if learnt else brief(effects) if corrected else None

    ahead = tuple(
        Change(name, brief(e.before), after(e.after, e.after_gp), unit(e.unit), _noise(e.noise_floor))
        for name, e in steps.items()
    )
    runs = tuple(
        Change(
            name,
            brief(e.before),
            after(e.after, e.after_gp),
            unit(e.unit),
            black_box=_reached(diagnosis, e) if corrected else None,
        )
        for name, e in rollout.channels.items()
    )
    return (
        Fit("one step", ahead, "no rate follows from what was recorded"),
        Fit(f"after {rollout.horizon_s:.3g} s", runs, "no held-out stretch is as long"),
    )


def _reached(diagnosis: Diagnosis, errors: RolloutErrors) -> str | None:
    """What a black box would reach, where that is better than the account in this channel and over all."""
    box, reached = diagnosis.fit.black_box, errors.black_box
    if box is None or reached is None or not box.takes_off.share > 0.0 or not reached < errors.after:
        return None
    return brief(reached) if brief(reached) != brief(errors.after) else None


def _noise(floor: float) -> str | None:
    return brief(floor) if floor > 0.0 else None


MOST = 4  # recordings of which each is told in a line
TITLE = "Recordings"


def differences(diagnosis: Diagnosis) -> list[str]:
    """What differs between the recordings, then how much of each the account explains; nothing of one alone."""
    recordings = diagnosis.recordings or ()
    if not recordings or diagnosis.verdict in ("unknown", "none"):
        return []
    names = [recording.name for recording in recordings]
    told = [_difference(effect, names) for effect in diagnosis.effects if effect.own]
    return [*(told or ["nothing that was looked for: one account serves all recordings"]), *_each(recordings)]


def recordings_sheet(diagnosis: Diagnosis) -> Sheet:
    """A column a recording; no rows where there is one alone."""
    recordings = diagnosis.recordings or ()
    rows = list(_rows(diagnosis, recordings)) if recordings else []
    note = "Errors: root mean square at the end of rollouts, of the base → with the account."
    if any(recording.from_others is not None for recording in recordings):
        note += (
            " From the others: the account with what all other recordings say, on the whole of this one; what its own "
            "sensors add stays its own."
        )
    return Sheet(TITLE, ("", *(recording.name for recording in recordings)), tuple(rows), 1, note)


def _difference(effect: NamedEffect, names: Sequence[str]) -> str:
    """One effect in the recordings: its size in each, and by how much it grew or fell where that can be said."""
    parts = [
        f"{f'{name} ' if len(effect.parameters) > 1 else ''}{_sizes(effect, name, names)}"
        for name in effect.parameters
    ]
    changed = _change(effect, names)
    return f"{effect_name(effect)} {changed or 'differs'}: {'; '.join(parts)}"


def _sizes(effect: NamedEffect, parameter: str, names: Sequence[str]) -> str:
    """`1.0 N in monday, 1.1 N in friday`; what most share is told once."""
    own = [name for name in names if parameter in (effect.own or {}).get(name, {})]
    others = [name for name in names if name not in own]
    each = names if len(names) <= 2 else own
    said = [f"{_size(effect, parameter, name)} in {shortened(name)}" for name in each[:MOST]]
    if len(each) > MOST:
        said.append(f"{len(each) - MOST} more in the table")
    if len(names) > 2 and others:
        where = f"in {shortened(others[0])}" if len(others) == 1 else "in the others"
        said.append(f"{_size(effect, parameter, others[0])} {where}")
    return ", ".join(said)


def _size(effect: NamedEffect, parameter: str, recording: str) -> str:
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
    if not _apart(first, last):  # by how much, nobody knows
        return ""
    ratio = last.value / first.value
    verb = "grew" if ratio > 1.0 else "fell"
    return f"{verb} by {in_percent(abs(ratio - 1.0))} % from {shortened(names[0])} to {shortened(names[1])}"


def _apart(one: Estimate, other: Estimate) -> bool:
    """Whether two 90 % intervals do not overlap; what was not measured lies nowhere."""
    ends = [(e.low, e.high) for e in (one, other) if not e.at_bound]
    known = [(low, high) for low, high in ends if low is not None and high is not None]
    return len(known) == 2 and (known[0][1] < known[1][0] or known[1][1] < known[0][0])


def _each(recordings: Sequence[OneRecording]) -> Iterator[str]:
    """How much of each recording's mismatch the account explains, also when it was learnt from the others."""
    if len(recordings) > MOST:
        yield "how much of each recording is explained: a column each in report.html"
        return
    told = ", ".join(f"{shortened(r.name)} {_percent(r.explained)}" for r in recordings)
    learnt = [_percent(r.from_others.explained) for r in recordings if r.from_others is not None]
    yield f"explained of {told}" + (f"; from the others {', '.join(learnt)}" if learnt else "")


def _percent(share: Share | None) -> str:
    return "nothing to explain" if share is None else f"{percent(share.share)} %"


def _share(share: Share | None) -> str:
    return "nothing to explain" if share is None else share_text(share)


def _rows(diagnosis: Diagnosis, recordings: Sequence[OneRecording]) -> Iterator[tuple[Cell, ...]]:
    yield row("transitions", *(str(r.transitions) for r in recordings))
    yield row("held out", *(_episodes(r) for r in recordings))
    yield row("explained", *(_share(r.explained) for r in recordings))
    if any(r.from_others is not None for r in recordings):
        shares = (_share(r.from_others.explained) if r.from_others else MISSING for r in recordings)
        yield row("explained, from the others", *shares)
    for effect in diagnosis.effects:
        for name in effect.parameters if effect.own else ():
            label = f"{effect_name(effect)}, {name.replace('_', ' ')}"
            yield row(label, *(_size(effect, name, r.name) for r in recordings))
    after = f"after {diagnosis.fit.rollout.horizon_s:.3g} s"
    units = {name: e.unit for r in recordings for name, e in r.rollout.items()}
    for channel in units:
        yield row(
            f"{with_unit(channel, units)} {after}", *(_errors(r.rollout.get(channel)) for r in recordings)
        )
    for channel in units if any(r.from_others and r.from_others.rollout for r in recordings) else ():
        ends = (r.from_others.rollout.get(channel) if r.from_others else None for r in recordings)
        yield row(f"{with_unit(channel, units)}, from the others", *map(_errors, ends))


def _episodes(recording: OneRecording) -> str:
    """The names of its held-out episodes, without its own in front of them."""
    names = [name.removeprefix(f"{recording.name}/") for name in recording.held_out]
    shown = ", ".join(names[:MOST]) + (f" and {len(names) - MOST} more" if len(names) > MOST else "")
    return f"episode {shown}" if shown else "nothing"


def _errors(errors: EndErrors | None) -> str:
    return MISSING if errors is None else f"{brief(errors.before)} → {brief(errors.after)}"
