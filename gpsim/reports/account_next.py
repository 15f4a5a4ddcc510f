"""What to do next: the one recording that would help most, and how to train with what was found."""

from __future__ import annotations

import math
import shlex
from collections.abc import Mapping, Sequence

from gpsim.diagnosis import Diagnosis
from gpsim.diagnosis.report import Estimate, NamedEffect
from gpsim.mjcf import is_mujoco
from gpsim.reports.account_effects import effect_name, told_effects
from gpsim.reports.account_left import hangs_on, is_missing
from gpsim.reports.curve_text import beyond
from gpsim.reports.diagnosis_text import listed
from gpsim.reports.fact_text import parameters_of
from gpsim.reports.lettering import shortened
from gpsim.simulators import lives_here

TRAINED: Mapping[str, str] = {"cartpole": "", "unicycle": "experiment=limo "}
"""Simulators in which gpsim trains policies, and which experiment does."""
VAGUE = 0.25  # half an interval over its value: a size that is known less well is worth another recording


def following(diagnosis: Diagnosis, headline: Sequence[NamedEffect]) -> list[str]:
    """The advice that would help most, first what only another recording can decide."""
    if diagnosis.verdict == "none":
        return ["train in the simulator as it is"]
    held = [effect_name(e) for e in headline if any(p.at_bound for p in e.parameters.values())]
    if diagnosis.tell_apart and diagnosis.alternatives:
        return [diagnosis.tell_apart]
    measured = [e.curve for e in headline if e.curve is not None]
    if measured and not diagnosis.remainder.structured:
        return [beyond(measured[0])]
    if diagnosis.remainder.structured or diagnosis.verdict in ("unknown", "partial"):
        return [_where_it_moves(diagnosis)]
    if diagnosis.combinations:
        return [f"measure {parameters_of(diagnosis.combinations[0])} by itself: motion alone cannot"]
    if held:
        return [f"record more of what {held[0]} does: its size stopped at the bound of the search"]
    vague = max(headline, key=_vagueness, default=None)
    if vague is not None and _vagueness(vague) > VAGUE:
        return [f"record more of what {effect_name(vague)} does: its size is known least well"]
    return ["no further recording is needed for this account"]


def command(diagnosis: Diagnosis, folder: str, simulator: str | None = None) -> str | None:
    """How to train in the corrected simulator; None where nothing corrects it.

    simulator: the base's name, None where nobody knows it. gpsim has policies for two; a MuJoCo model is written out
    again with its effects; of all others Python reads it.
    """
    gp, effects = diagnosis.remainder.gp, any(told_effects(diagnosis))
    learnt = gp is not None and gp.used
    if diagnosis.verdict == "none" or not (learnt or effects):
        return None
    if simulator is not None and effects and is_mujoco(simulator):
        return f"gpsim export model {shlex.quote(folder)} --out robot_corrected.xml"
    if simulator is not None and simulator not in TRAINED:
        base = ", simulator" if lives_here(simulator) else ""
        return f"python: gpsim.Diagnosis.load({folder!r}{base}).corrected({'gp=True' if learnt else ''})"
    words = TRAINED.get(simulator or "", "")
    given = shlex.quote(f"diagnosis={folder}")
    return f"gpsim train-gp-policy {words}{given}{' correction=effects+gp' if learnt else ''}"


def _where_it_moves(diagnosis: Diagnosis) -> str:
    """A recording that shows more of what is left: where what it depends on moves."""
    law = diagnosis.remainder.lack_of_fit
    if law is not None and is_missing(law) and law.memory:
        return (
            f"record steps of {_names(law.on)} with pauses longer than {2 * law.memory:.2g} s between them: what is "
            "missing remembers"
        )
    inputs = hangs_on(diagnosis)
    if inputs:
        return (
            f"record {_names(inputs)} over {'its' if len(inputs) == 1 else 'their'} whole range, once in a slow sweep "
            "and once in a fast one"
        )
    if diagnosis.explained.judged_on != "held-out rollouts":
        return "record longer: too little could be held out to judge what is left"
    return "record slow and fast sweeps of every command: nothing that was measured tells what is left"


def _names(names: Sequence[str]) -> str:
    return listed([shortened(name) for name in names])


def _vagueness(effect: NamedEffect) -> float:
    return max((_relative(p) for p in effect.parameters.values()), default=0.0)


def _relative(size: Estimate) -> float:
    """Half the interval's width over the value."""
    if size.low is None or size.high is None or not math.isfinite(size.value):
        return math.inf
    width = abs(size.high - size.low) / 2
    if not size.value:
        return math.inf if width else 0.0
    return width / abs(size.value)
