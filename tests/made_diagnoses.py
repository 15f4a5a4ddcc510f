"""Diagnoses that nobody made, to be worded, written and read."""

import math
from typing import Any

from gpsim.diagnosis import Diagnosis
from gpsim.findings import (
    Estimate,
    HeldOutFit,
    Location,
    NamedEffect,
    Remainder,
    RemainderGp,
    Rollout,
    RolloutErrors,
    StepErrors,
)

NO_GP = RemainderGp(False, None, "it has no structure")


def made_effect(**changes: Any) -> NamedEffect:
    """A spring of which nothing special is known."""
    parts: dict[str, Any] = {
        "family": "spring", "on": "q", "site": "force", "region": {}, "since": None, "probability": 1.0,
        "evidence_gain": 9.0, "explains": 1.0, "sentence": "a spring",
        "parameters": {"stiffness": Estimate(1.0, 0.9, 1.1, "N/m")},
    }  # fmt: skip
    return NamedEffect(**parts | changes)


def made_location(**changes: Any) -> Location:
    parts: dict[str, Any] = {"channels": {}, "region": {}, "since": None, "depends_on": ()}
    return Location(**parts | changes)


def made_remainder(**changes: Any) -> Remainder:
    parts: dict[str, Any] = {"structured": False, "depends_on": (), "p_value": 1.0, "gp": NO_GP}
    return Remainder(**parts | changes)


def made_diagnosis(**changes: Any) -> Diagnosis:
    """One that found nothing, of a slider whose simulations ran away."""
    step = StepErrors(before=math.nan, after=math.nan, unit="m/s^2")
    run = RolloutErrors(before=math.nan, after=math.nan, unit="m")
    parts: dict[str, Any] = {
        "verdict": "none", "location": made_location(), "effects": (), "alternatives": (), "tell_apart": None,
        "fit": HeldOutFit((), {"q_acc": step}, Rollout(1.0, {"q": run})), "remainder": made_remainder(),
        "integration": "fine", "tuned": {}, "ranking": (),
    }  # fmt: skip
    return Diagnosis(**parts | changes)
