"""An account in the catalogue's words, where the search wrote its laws in coordinates that fit better."""

from __future__ import annotations

from dataclasses import replace

from gpsim.diagnosis.fitting import Hypothesis
from gpsim.diagnosis.ladder.account import Account
from gpsim.effects import RISE, Place, declared, effect_of


def told(account: Account) -> Hypothesis:
    """The account's laws as they are told.

    What Stribeck friction adds and the dry friction beside it are one law, where that may be simulated at once.
    """
    hypothesis = account.hypothesis
    for law in account.laws:
        place = law.candidate.place
        if law.candidate.family == "stribeck_friction" and law.candidate.variant == RISE and not law.owned:
            hypothesis = _with_stribeck(hypothesis, place)
    return hypothesis


def _index(hypothesis: Hypothesis, family: str, on: str) -> int | None:
    return next(
        (i for i, t in enumerate(hypothesis.terms) if t.identity == (family, on) and not t.gate), None
    )


def _with_stribeck(hypothesis: Hypothesis, place: Place) -> Hypothesis:
    index, dry = (_index(hypothesis, f, place.on) for f in ("stribeck_friction", "coulomb_friction"))
    if index is None or (dry is not None and "force" not in hypothesis.terms[dry].values):
        return hypothesis
    rise = hypothesis.terms[index]
    force = hypothesis.terms[dry].values["force"] if dry is not None else 0.0
    values = {"force": force, "static_force": force + rise.values[RISE]}
    values["stribeck_velocity"] = rise.values["stribeck_velocity"]
    own = declared(effect_of("stribeck_friction"), place)
    rest = hypothesis.without_all([i for i in (index, dry) if i is not None])
    return rest.plus(replace(rise, values=values, variant=""), own)
