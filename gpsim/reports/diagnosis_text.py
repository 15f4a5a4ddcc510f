"""The diagnosis in words: four paragraphs that a person would say to a colleague, each with its number."""

from __future__ import annotations

import math
from collections.abc import Sequence

from gpsim.diagnosis import Diagnosis
from gpsim.diagnosis.assessment import KINDS, SINCE_REVERSAL
from gpsim.diagnosis.report import (
    Claims,
    Estimate,
    MissingLaw,
    NamedEffect,
    RankedHypothesis,
    RolloutErrors,
    StepErrors,
)
from gpsim.diagnosis.settings import LackOfFitSettings
from gpsim.reports.wording import worded

NOTHING = "nothing missing"
RANKINGS = {"all": "On all training windows:", "search": "Given up in the search, on its windows:"}
MANY = 1e6  # odds beyond which nobody counts
COARSE = 0.7  # of the base simulator's error, that finer steps leave: what they take away is worth a word
GLITCHES = 3.0  # times the typical error: a larger root mean square is made by a few samples


def paragraphs(diagnosis: Diagnosis) -> list[str]:
    """Where, what, how much, and whether the fit is better."""
    told = worded(diagnosis)
    return [_where(told), _what(told), _how_much(told), _better(told)]


def ranking(diagnosis: Diagnosis) -> list[str]:
    """Every hypothesis that was fitted, the best first; those of the search alone, which had fewer data, at the end."""
    lines = []
    for windows, title in RANKINGS.items():
        group = [entry for entry in diagnosis.ranking if entry.windows == windows]
        if group:
            lines += [title, *(_ranked(entry) for entry in group)]
    return lines


def _where(diagnosis: Diagnosis) -> str:
    location = diagnosis.location
    shares = sorted(location.channels.items(), key=lambda item: -item[1])
    if diagnosis.verdict == "none":
        return (
            "Where: nowhere. Simulator and recording differ by no more than noise and numerical error."
            + _own_step(diagnosis)
            + _looked_at(diagnosis)
        )
    parts = ", ".join(f"{100 * share:.0f} % of {name}'s residual" for name, share in shares if share > 0.01)
    text = f"Where: beyond noise lies {parts or _no_part(diagnosis)}"
    if location.depends_on:
        text += f"; it depends on {', '.join(location.depends_on[:3])}"
    for name, (low, high) in location.region.items():
        text += f"; it acts for {name} in {_between(low, high)}"
    if location.since is not None:
        text += f"; since t = {_moment(location.since, diagnosis.dt)} s"
    if location.since_episode is not None:
        text += f"; since episode {location.since_episode}"
    return f"{text}{_part(diagnosis)}.{_looked_at(diagnosis)}"


def _own_step(diagnosis: Diagnosis) -> str:
    """What of the residual the base simulator's own step makes, where that is much."""
    errors = [(name, e, e.finely) for name, e in diagnosis.fit.one_step.items() if e.finely is not None]
    coarse = [(name, e, finely) for name, e, finely in errors if finely < COARSE * e.before]
    if not coarse:
        return ""
    left = ", ".join(
        f"{number(finely)} of {name}'s {number(e.before)} {e.unit}" for name, e, finely in coarse
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
    where = f"{part.where} {name} = {_between(low, high)}" if of == name else _soon_after(of, high)
    return (
        f"; {100 * part.share_of_mismatch:.0f} % of {part.rate}'s lies {where}, "
        f"in {100 * part.share_of_samples:.0f} % of the samples"
    )


def _soon_after(of: str, seconds: float) -> str:
    return f"within {seconds:.3g} s of a reversal of {of}" if seconds > 0.0 else f"where {of} turns round"


def _between(low: float, high: float) -> str:
    """An interval: three digits of its ends, more where they share the first ones."""
    size, width = max(abs(low), abs(high)), abs(high - low)
    shared = math.floor(math.log10(size / width)) if 0 < width < math.inf else 0
    digits = 3 + max(shared, 0)
    return f"[{low:.{digits}g}, {high:.{digits}g}]"


def _moment(t: float, dt: float | None) -> str:
    """A moment [s] to a step of its clock, dt [s]; three digits where nobody knows that step."""
    if dt is None:
        return f"{t:.3g}"
    return f"{t:.{max(0, math.ceil(-math.log10(dt)))}f}"


def _looked_at(diagnosis: Diagnosis) -> str:
    """What a reader must know of the data that were looked at."""
    text = ""
    if diagnosis.thinned > 1:
        text += f" The clock is fast: every {_ordinal(diagnosis.thinned)} sample was read, commands averaged between."
    if diagnosis.not_measured:
        names = ", ".join(diagnosis.not_measured)
        text += f" Nobody measured {names}: it is what each model's own windows say."
    return text


def _what(diagnosis: Diagnosis) -> str:
    verdict, effects = diagnosis.verdict, diagnosis.effects
    if verdict == "none":
        return "What: nothing is missing that these data could show (0 effects)."
    said = "; ".join(effect.sentence for effect in effects)
    if verdict == "unknown":
        partial = f" A part of it looks like this: {said}." if said else ""
        p_value = number(diagnosis.remainder.p_value, 2)
        law = _missing_law(diagnosis.remainder.lack_of_fit)
        return f"What: nothing that I know explains it (remainder p = {p_value}).{law}{partial}"
    if verdict == "ambiguous":
        others = " or ".join("; ".join(e.sentence for e in a.effects) for a in diagnosis.alternatives)
        return (
            f"What: {said} (probability {effects[0].probability:.2f}), but it could as well be that {others}."
        )
    weakest = min(effects, key=lambda e: e.evidence_gain)
    return f"What: {said} (evidence {weakest.evidence_gain:.0f} nats{_odds(effects)})."


def _odds(effects: Sequence[NamedEffect]) -> str:
    """How many times less probable the best is that does without one of the effects."""
    known = [(e.odds.nats, e.odds.against) for e in effects if e.odds and e.odds.nats is not None]
    if not known:
        return ""
    nats, against = min(known, key=lambda odds: odds[0])
    many = nats > math.log(MANY)
    times = "more than a million" if many else f"{float(number(math.exp(nats), 2)):,.0f}"
    return f"; odds of {times} to 1 against the next best, {_terms(against)}"


def _missing_law(lack: MissingLaw | None) -> str:
    """What the missing law is about, as far as that can be told without knowing it."""
    if lack is None or lack.p_value >= LackOfFitSettings().significance:
        return ""
    on = " and ".join(lack.on)
    if lack.memory:
        on += f" and on what it was over the last {lack.memory:.2g} s"
    return f" In {lack.rate} something is missing that depends on {on} ({lack.nats:.0f} nats)."


def _how_much(diagnosis: Diagnosis) -> str:
    numbers = [
        f"{effect.family} on {effect.place}: {name} = {p.value:.4g} {_interval(p)}{_unit(p)}"
        f"{' (AT ITS BOUND: do not trust it)' if p.at_bound else ''}"
        for effect in diagnosis.effects
        for name, p in effect.parameters.items()
    ]
    if not numbers:
        return "How much: 0; there is no effect to measure."
    text = "How much (90 % intervals): " + "; ".join(numbers) + "."
    return text + (f" To tell the rivals apart, {diagnosis.tell_apart}." if diagnosis.tell_apart else "")


def _interval(parameter: Estimate) -> str:
    """Where the curvature gave none, it has no limits."""
    low, high = parameter.low, parameter.high
    return (
        "(no interval: the data do not determine it)"
        if low is None or high is None
        else f"[{low:.4g}, {high:.4g}]"
    )


def _unit(parameter: Estimate) -> str:
    """Nothing behind a plain ratio."""
    return "" if parameter.unit == "1" else f" {parameter.unit}"


def _better(diagnosis: Diagnosis) -> str:
    gp, rollout = diagnosis.remainder.gp, diagnosis.fit.rollout
    modelled = bool(diagnosis.effects) and gp is not None and gp.beside == "effects"
    steps = [f"{name} {_step_errors(e, modelled)}" for name, e in diagnosis.fit.one_step.items()]
    runs = [f"{name} {_run_errors(e)}" for name, e in rollout.channels.items()]
    said = "; ".join(steps) or "no rate follows from what was recorded"
    text = f"Is the fit better, one step ahead on held-out data: {said}.{_of_gp(diagnosis)}"
    return text + (f" After {rollout.horizon_s:.3g} s: {'; '.join(runs)}." if runs else "")


def _of_gp(diagnosis: Diagnosis) -> str:
    """Why no Gaussian process models what is left, or why one stands in the effects' place."""
    gp = diagnosis.remainder.gp
    if gp is None:  # of a version that always had one
        return ""
    if diagnosis.verdict != "none" and not gp.used:
        return f" No GP on what is left: {gp.why_not}."
    partial = diagnosis.effects and gp.beside == "base"
    return (
        " The GP goes with the base alone: what the partial account leaves it learns less well."
        if partial
        else ""
    )


def _step_errors(errors: StepErrors, modelled: bool) -> str:
    """RMS errors; where rare glitches make most of them, what is typical too. modelled: by a GP beside the effects."""
    n = {kind: number(errors.of(kind)) for kind in KINDS}
    text = (
        f"{n['before']} before, {n['tuned']} tuned, {n['gp']} with a GP, {n['after']} after{_of_before(errors)}"
        f"{', ' + n['after_gp'] + ' after with a GP' if modelled else ''} "
        f"(noise floor {n['noise_floor']} {errors.unit}"
    )
    usual = errors.typical
    if usual is not None and errors.after > GLITCHES * usual.after:
        often = f"{number(usual.before)} before and {number(usual.after)} after"
        text += f"; rare glitches dominate, typically {often}"
    return text + ")"


def _run_errors(errors: RolloutErrors) -> str:
    before, gp, after = (number(error) for error in (errors.before, errors.gp, errors.after))
    return f"{before} before, {gp} with a GP, {after} after {errors.unit}{_of_before(errors)}"


def _of_before(errors: StepErrors | RolloutErrors) -> str:
    """What is left of the base's error, with its 90 % interval, where anything was named."""
    left = errors.after_over_before
    if left is None or left.low is None or left.high is None or left.value in (None, 1.0):
        return ""
    share, low, high = (in_percent(figure) for figure in (left.value, left.low, left.high))
    return f" ({share} % of it, {low} to {high})"


def in_percent(share: float) -> str:
    """A share in per cent, two digits at least and no exponent."""
    return f"{100 * share:.0f}" if share >= 0.0995 else f"{100 * share:.2g}"


def number(value: float, digits: int = 3) -> str:
    """So many digits; a simulation that ran away has no error that is a number."""
    return "diverged" if not math.isfinite(value) else f"{value:.{digits}g}"


def _ordinal(number: int) -> str:
    return f"{number}{ {2: 'nd', 3: 'rd'}.get(number, 'th') }"


def _no_part(diagnosis: Diagnosis) -> str:
    return "a small part of the residual" if diagnosis.fit.one_step else "a rate that nobody measured"


def _ranked(entry: RankedHypothesis) -> str:
    gates = entry.gates or ("",) * len(entry.effects)
    terms = [
        f"{family} on {on}" + (f" (for some {gate})" if gate else "")
        for (family, on), gate in zip(entry.effects, gates, strict=True)
    ]
    return f"{entry.nats_behind:10.1f}  {entry.scheme:<14} {' + '.join(terms) or NOTHING}"


def _terms(effects: Claims) -> str:
    return " + ".join(f"{family} on {on}" for family, on in effects) or NOTHING
