"""What a statistician asks of a diagnosis: nats, odds, p-values and intervals of shares, below the account."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from gpsim.diagnosis import Diagnosis
from gpsim.diagnosis.report import MissingLaw, Share
from gpsim.reports.account_effects import effect_name
from gpsim.reports.diagnosis_text import terms_text
from gpsim.reports.quantities import MANY, number, odds_text, percent, share_text
from gpsim.reports.sheets import MISSING, Sheet, row

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
    if remainder.lack_of_fit is not None:
        yield _missing_law(remainder.lack_of_fit)
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


def _missing_law(law: MissingLaw) -> str:
    on = " and ".join(law.on) + (f" and its average over {law.memory:.2g} s" if law.memory else "")
    chance = number(law.p_value, 2)
    return f"A smooth law of {law.rate} in {on} would gain {law.nats:.0f} nats (p = {chance} by chance)."


def _shares(shares: Mapping[str, Share]) -> str:
    return "; ".join(f"{name} {share_text(share)}" for name, share in shares.items())


def _edge(value: float | None) -> str:
    return MISSING if value is None else f"{value:.4g}"


def _bound(held: bool) -> str:
    return "at the bound of the search" if held else ""
