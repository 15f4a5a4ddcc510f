"""A diagnosis as an account that a roboticist can act on: what terminal and page show, in the same words.

Verdict, where, what, left, fit, next, in this order. Nats, p-values and intervals of ratios are in `statistics_text`.
"""

from __future__ import annotations

from dataclasses import dataclass

from gpsim.diagnosis import Diagnosis
from gpsim.diagnosis.report import RolloutErrors
from gpsim.reports.account_effects import Row, rows_of, slight_text, told_effects
from gpsim.reports.account_sentences import command, following, left, rivals, verdict_sentence
from gpsim.reports.curve_text import curve_rows
from gpsim.reports.diagnosis_text import where
from gpsim.reports.quantities import brief
from gpsim.reports.recordings_text import differences
from gpsim.reports.sheets import unit
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
    with DIR in the folder's place, where a folder's name is too long. differs: between several recordings.
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
