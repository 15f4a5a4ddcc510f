"""The trace of a diagnosis in words: what was looked at, what was taken, by which rule and by how much."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

from gpsim.diagnosis import Diagnosis
from gpsim.diagnosis.run import Decision
from gpsim.findings import Score, Scored, Share
from gpsim.reports.account_effects import effect_name
from gpsim.reports.diagnosis_text import terms_text
from gpsim.reports.quantities import MANY, number, odds_text, percent, share_text
from gpsim.reports.sheets import MISSING, Sheet, row

RULE = 29  # columns that a rule's name is given


def trace_lines(decisions: Sequence[Decision]) -> list[str]:
    """A line a decision below the step that made it, in order; what was decided again alike is left out."""
    return list(_decisions(decisions))


def _decisions(decisions: Sequence[Decision]) -> Iterator[str]:
    step = ""
    told: set[str] = set()
    for decision in decisions:
        if decision.step != step:
            step, told = decision.step, set()
            yield f"{step}"
        line = _decision(decision)
        if line not in told:
            told.add(line)
            yield line


def _decision(decision: Decision) -> str:
    verb = "taken  " if decision.taken else "refused"
    numbers = f"{_optional(decision.gain, '.1f'):>9} nats {_in_percent(decision.share):>7}"
    return f"  {verb} {numbers}  {decision.rule:<{RULE}} {difference(decision.candidate, decision.over)}"


def difference(candidate: Sequence[str], over: Sequence[str]) -> str:
    """What the candidate has more and less than what it is compared with, and what both have."""
    more = [f"+ {term}" for term in candidate if term not in over]
    less = [f"- {term}" for term in over if term not in candidate]
    both = [term for term in candidate if term in over]
    changed = " ".join([*more, *less]) or "the same terms"
    return f"{changed} (beside {', '.join(both)})" if both else changed


def _optional(value: float | None, form: str) -> str:
    return MISSING if value is None else format(value, form)


def _in_percent(share: float | None) -> str:
    return MISSING if share is None else f"{100 * share:.3g} %"


GLITCHES = 3.0  # times the typical error: a larger root mean square is made by a few samples
EFFECTS = ("effect", "role", "share", "needed", "of its residual", "evidence, nats", "odds", "against")


def effects_sheet(diagnosis: Diagnosis) -> Sheet:
    """Every effect of the explanation, of a part that is not told, too."""
    rows = [
        row(
            effect_name(effect),
            effect.role,
            MISSING if effect.importance is None else share_text(effect.importance),
            MISSING if effect.needed is None else share_text(effect.needed),
            f"{percent(effect.explains)} %",
            f"{effect.evidence_gain:.0f}",
            odds_text(effect.odds),
            MISSING if effect.odds is None else terms_text(effect.odds.against),
        )
        for effect in diagnosis.effects
    ]
    note = (
        "Share: of the mismatch in rollouts (Shapley). Needed: what the account explains less without it, all others "
        f"fitted anew. Odds beyond {MANY:.0e} are not counted. All with 90 % intervals."
    )
    return Sheet("Effects", EFFECTS, tuple(rows), 2, note)


def parameters_sheet(diagnosis: Diagnosis) -> Sheet:
    """Every parameter with its interval."""
    rows = [
        row(
            effect_name(effect),
            name,
            f"{p.value:.4g}",
            _edge(p.low),
            _edge(p.high),
            p.unit,
            _bound(p.at_bound),
        )
        for effect in diagnosis.effects
        for name, p in effect.parameters.items()
    ]
    columns = ("effect", "parameter", "value", "from", "to", "unit", "")
    return Sheet("Parameters, 90 % intervals", columns, tuple(rows), 2)


def statistics(diagnosis: Diagnosis) -> list[str]:
    """Sentences, each with its number."""
    return list(_said(diagnosis))


def _said(diagnosis: Diagnosis) -> Iterator[str]:
    found, remainder = diagnosis.explained, diagnosis.remainder
    if diagnosis.effects:
        yield f"Probability of the explanation among all that were fitted: {diagnosis.effects[0].probability:.3g}."
    if found.rollout is not None:
        shares = _shares({"all": found.rollout, **found.channels})
        yield f"Explained in rollouts, judged on {found.judged_on}: {shares}."
    if found.one_step:
        yield f"Explained one step ahead, which decides nothing: {_shares(found.one_step)}."
    yield f"What is left: p = {number(remainder.p_value, 2)} that noise alone looks like it."
    if remainder.gp is not None and not remainder.gp.used and diagnosis.verdict != "none":
        yield f"No Gaussian process on what is left: {remainder.gp.why_not}."
    for name, errors in diagnosis.fit.one_step.items():
        usual = errors.typical
        if usual is not None and errors.after > GLITCHES * usual.after:
            often = f"{number(usual.before)} before and {number(usual.after)} after"
            yield f"In {name} rare glitches dominate: typically {often} {errors.unit}."
    if diagnosis.tuned:
        ratios = ", ".join(f"{name} {ratio:.4g} times" for name, ratio in diagnosis.tuned.items())
        yield f"Tuning the simulator's own parameters alone: {ratios}."
    yield f"Integration of the explanation: {diagnosis.integration}."


def _shares(shares: Mapping[str, Share]) -> str:
    return "; ".join(f"{name} {share_text(share)}" for name, share in shares.items())


def _edge(value: float | None) -> str:
    return MISSING if value is None else f"{value:.4g}"


def _bound(held: bool) -> str:
    return "at the bound of the search" if held else ""


HEAD = ("", "unit", "base", "+ effects", "+ GP", "of the base's (90 %)")


def score_lines(score: Score) -> list[str]:
    """The table, a line each, and what it does not say by itself."""
    rows = [_row(f"{name}, one step", errors) for name, errors in score.one_step.items()]
    rows += [_row(f"{name}, after {score.horizon_s:.3g} s", errors) for name, errors in score.rollout.items()]
    said = [
        f"{score.transitions} transitions; errors of {score.steps} single steps and {score.rollouts} rollouts:"
    ]
    said += _table([HEAD, *rows])
    worth = None if score.explained is None else score.explained.rollout
    if worth is not None:
        low, high = worth.low, worth.high
        between = "" if low is None or high is None else f" ({100 * low:.0f} to {100 * high:.0f})"
        said.append(f"the effects explain {100 * worth.share:.0f} %{between} of the mismatch here")
    if score.thinned > 1:
        said.append(f"one of {score.thinned} samples was read, commands averaged between")
    if score.without_gp:
        said.append(f"no Gaussian process: {score.without_gp}")
    return said


def errors_lines(rows: Sequence[tuple[str, str, float, float]], steps: int, rollouts: int) -> list[str]:
    """A table of (what, unit, error of the base, error of the corrected), a line each."""
    told = [(name, unit, _number(base, 3), _number(after, 3)) for name, unit, base, after in rows]
    return [
        f"errors of {steps} single steps and {rollouts} rollouts:",
        *_table([("", "unit", "base", "corrected"), *told]),
    ]


def _row(name: str, errors: Scored) -> tuple[str, ...]:
    over = errors.over_before
    share = "diverged" if over.value is None else f"{100 * over.value:.3g} %"
    if over.low is not None and over.high is not None:
        share += f" ({100 * over.low:.3g} to {100 * over.high:.3g})"
    gp = "-" if errors.after_gp is None else _number(errors.after_gp, 3)
    return name, errors.unit, _number(errors.before, 3), _number(errors.after, 3), gp, share


def _number(value: float, digits: int) -> str:
    return f"{value:.{digits}g}" if math.isfinite(value) else "diverged"


def _table(rows: Sequence[Sequence[str]]) -> list[str]:
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    return ["  ".join(map(_aligned, row, widths, range(len(row)))).rstrip() for row in rows]


def _aligned(cell: str, width: int, column: int) -> str:
    """Names and units to the left, numbers to the right."""
    return cell.ljust(width) if column < NAMED else cell.rjust(width)


NAMED = 2  # columns of words
