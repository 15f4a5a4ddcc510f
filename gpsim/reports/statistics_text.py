"""What only a statistician asks: every decision of the search, every interval, odds, p-values, and scores."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from gpsim.diagnosis import Diagnosis
from gpsim.diagnosis.run import Decision
from gpsim.findings import Score, Share
from gpsim.reports.account_effects import effect_name
from gpsim.reports.diagnosis_text import terms_text
from gpsim.reports.quantities import MANY, number, odds_text, percent, share_text
from gpsim.reports.sheets import MISSING, Sheet, sheet

RULE = 29  # columns that a rule's name is given
GLITCHES = 3.0  # times the typical error: a larger root mean square is made by a few samples
EFFECTS = ("effect", "role", "share", "needed", "of its residual", "evidence, nats", "odds", "against")
SCORES = ("", "unit", "base", "+ effects", "+ GP", "of the base's (90 %)")


def trace_lines(decisions: Sequence[Decision]) -> list[str]:
    """A line a decision below the step that made it, in order; what was decided again alike is left out."""
    step, told, lines = "", set[str](), list[str]()
    for d in decisions:
        if d.step != step:
            step, told = d.step, set()
            lines.append(step)
        gain = MISSING if d.gain is None else f"{d.gain:.1f}"
        share = MISSING if d.share is None else f"{100 * d.share:.3g} %"
        line = f"  {'taken  ' if d.taken else 'refused'} {gain:>9} nats {share:>7}  {d.rule:<{RULE}} "
        line += difference(d.candidate, d.over)
        if line not in told:
            told.add(line)
            lines.append(line)
    return lines


def difference(candidate: Sequence[str], over: Sequence[str]) -> str:
    """What the candidate has more and less than what it is compared with, and what both have."""
    more = [f"+ {term}" for term in candidate if term not in over]
    less = [f"- {term}" for term in over if term not in candidate]
    both = [term for term in candidate if term in over]
    changed = " ".join([*more, *less]) or "the same terms"
    return f"{changed} (beside {', '.join(both)})" if both else changed


def effects_sheet(diagnosis: Diagnosis) -> Sheet:
    """Every effect of the explanation, of a part that is not told, too."""
    rows = (
        (
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
    )
    note = (
        "Share: part of the mismatch in rollouts (Shapley value). Needed: the loss without the effect, with all "
        f"others fitted again. Odds above {MANY:.0e} are not distinguished. All with 90 % intervals."
    )
    return sheet("Effects", EFFECTS, rows, labels=2, note=note)


def parameters_sheet(diagnosis: Diagnosis) -> Sheet:
    """Every parameter with its interval."""
    rows = (
        (
            effect_name(effect),
            name,
            f"{p.value:.4g}",
            *(MISSING if edge is None else f"{edge:.4g}" for edge in (p.low, p.high)),
            p.unit,
            "at the bound of the search" if p.at_bound else "",
        )
        for effect in diagnosis.effects
        for name, p in effect.parameters.items()
    )
    columns = ("effect", "parameter", "value", "from", "to", "unit", "")
    return sheet("Parameters, 90 % intervals", columns, rows, labels=2)


def statistics(diagnosis: Diagnosis) -> list[str]:
    """Sentences, each with its number."""
    return list(_said(diagnosis))


def _said(diagnosis: Diagnosis) -> Iterator[str]:
    def shares(of: Mapping[str, Share]) -> str:
        return "; ".join(f"{name} {share_text(share)}" for name, share in of.items())

    found, remainder = diagnosis.explained, diagnosis.remainder
    if diagnosis.effects:
        chance = f"{diagnosis.effects[0].probability:.3g}"
        yield f"Probability of the explanation, among all fitted ones that were not rejected: {chance}."
    if found.rollout is not None:
        every = shares({"all": found.rollout, **found.channels})
        yield f"Explained in rollouts, judged on {found.judged_on}: {every}."
    if found.one_step:
        yield f"Explained one step ahead, for information only: {shares(found.one_step)}."
    yield f"The rest: p = {number(remainder.p_value, 2)} for noise alone."
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


def score_lines(score: Score) -> list[str]:
    """The table, a line each, and what it does not say by itself."""
    named = [(f"{name}, one step", errors) for name, errors in score.one_step.items()]
    named += [(f"{name}, after {score.horizon_s:.3g} s", errors) for name, errors in score.rollout.items()]
    rows = [SCORES]
    for name, errors in named:
        over, gp = errors.over_before, "-" if errors.after_gp is None else number(errors.after_gp)
        share = "diverged" if over.value is None else f"{100 * over.value:.3g} %"
        if over.low is not None and over.high is not None:
            share += f" ({100 * over.low:.3g} to {100 * over.high:.3g})"
        rows.append((name, errors.unit, number(errors.before), number(errors.after), gp, share))
    said = [
        f"{score.transitions} transitions; errors of {score.steps} single steps and {score.rollouts} rollouts:",
        *_table(rows),
    ]
    worth = None if score.explained is None else score.explained.rollout
    if worth is not None:
        low, high = worth.low, worth.high
        between = "" if low is None or high is None else f" ({100 * low:.0f} to {100 * high:.0f})"
        said.append(f"the effects explain {100 * worth.share:.0f} %{between} of the mismatch here")
    if score.thinned > 1:
        said.append(f"one of {score.thinned} samples was used, with averaged commands")
    if score.without_gp:
        said.append(f"no Gaussian process: {score.without_gp}")
    return said


def errors_lines(rows: Sequence[tuple[str, str, float, float]], steps: int, rollouts: int) -> list[str]:
    """A table of (what, unit, error of the base, error of the corrected), a line each."""
    told = [(name, unit, number(base), number(after)) for name, unit, base, after in rows]
    head = f"errors of {steps} single steps and {rollouts} rollouts:"
    return [head, *_table([("", "unit", "base", "corrected"), *told])]


def _table(rows: Sequence[Sequence[str]]) -> list[str]:
    """Names and units to the left, numbers to the right."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        "  ".join(f"{cell:{'<' if i < 2 else '>'}{widths[i]}}" for i, cell in enumerate(cells)).rstrip()
        for cells in rows
    ]
