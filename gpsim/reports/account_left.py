"""What an account leaves: how much, in which rate, on what it depends, and what is peculiar to the log."""

from __future__ import annotations

from collections.abc import Iterator

from gpsim.diagnosis import Diagnosis
from gpsim.diagnosis.report import BlackBox, MissingLaw
from gpsim.diagnosis.settings import LackOfFitSettings
from gpsim.reports.diagnosis_text import listed
from gpsim.reports.fact_text import combination_texts
from gpsim.reports.lettering import shortened
from gpsim.reports.quantities import percent, share_text

POOR = 0.5  # of a rate's mismatch one step ahead: an account that explains less of it says so
MOST_FACTS = 3  # of the log, and of parameters that only act together: further ones are in diagnosis.json


def left(diagnosis: Diagnosis) -> Iterator[str]:
    """The sentences, the one that matters most first."""
    yield _amount(diagnosis)
    if "black box" in diagnosis.doubts and diagnosis.fit.black_box is not None:
        yield _foreseen(diagnosis, diagnosis.fit.black_box)
    if diagnosis.verdict not in ("unknown", "none"):
        yield from (effect.implausible for effect in diagnosis.effects if effect.implausible)
    if diagnosis.log_facts:
        yield f"the log: {listed(diagnosis.log_facts, MOST_FACTS)}"
    yield from combination_texts(diagnosis.combinations[:MOST_FACTS])
    poor = [
        f"{percent(found.share)} % of {shortened(rate)}"
        for rate, found in diagnosis.explained.one_step.items()
        if found.share < POOR
    ]
    if poor and diagnosis.verdict not in ("unknown", "none"):
        yield f"one step ahead the account explains only {listed(poor)}"
    gp = diagnosis.remainder.gp
    if gp is not None and gp.used and diagnosis.verdict != "none":
        alone = diagnosis.verdict == "unknown"
        yield (
            "a Gaussian process has learnt it: the errors after are with that"
            if alone
            else "a Gaussian process has learnt what is left: simulations are better with it"
        )


def box_name(diagnosis: Diagnosis) -> str:
    """The model that names nothing and foresees most."""
    box = diagnosis.fit.black_box
    if box is None:
        return "a black box"
    if box.model == "curve":
        return f"a free curve of {box.of}"
    return "a Gaussian process alone" if box.model == "gp" else "a Gaussian process beside them"


def _foreseen(diagnosis: Diagnosis, box: BlackBox) -> str:
    """How much a black box still finds, and on what that depends."""
    text = f"{box_name(diagnosis)} takes {share_text(box.takes_off)} off the error of held-out rollouts"
    inputs = listed([shortened(name) for name in box.depends_on])
    return f"{text}; it depends on {inputs}" if inputs else text


def hangs_on(diagnosis: Diagnosis) -> list[str]:
    """Inputs on which what is left depends: those of a missing law, where chance has not made it, else any."""
    law = diagnosis.remainder.lack_of_fit
    return list(law.on) if law is not None and is_missing(law) else list(diagnosis.remainder.depends_on)


def is_missing(law: MissingLaw) -> bool:
    """Whether chance has not made a missing law."""
    return law.p_value < LackOfFitSettings().significance


def left_share(diagnosis: Diagnosis) -> float | None:
    """Of the mismatch what is left; None of an earlier version."""
    found = diagnosis.explained.rollout
    given = diagnosis.remainder.share
    return given if given is not None else None if found is None else max(0.0, 1.0 - found.share)


def _amount(diagnosis: Diagnosis) -> str:
    share, remainder = left_share(diagnosis), diagnosis.remainder
    if diagnosis.verdict == "none" and not remainder.structured:
        return "nothing but noise"
    amount = "something" if share is None else f"{percent(share)} % of the mismatch"
    if not remainder.structured:
        return "nothing but noise" if share is None else f"{amount}, which looks like noise"
    text = f"{amount} that chance does not explain" if share is None else amount
    law = remainder.lack_of_fit
    rate = remainder.rate or (law.rate if law is not None and is_missing(law) else None)
    if rate:
        text += f"{', most of it' if share is not None else ''} in {shortened(rate)}"
    inputs = hangs_on(diagnosis)
    if inputs:
        text += f"; it depends on {listed([shortened(name) for name in inputs])}"
    if law is not None and is_missing(law) and law.memory:
        text += f", also on what that was over the last {law.memory:.2g} s"
    return text
