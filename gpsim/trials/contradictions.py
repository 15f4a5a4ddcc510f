"""Whether a diagnosis.json contradicts itself: verdict, odds, probabilities, sizes and claims must agree.

The rules are those by which a verdict is made, read from the file alone, so that any file can be held to them. A file
of an earlier version lacks some keys, and is not held to what they say.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from gpsim.diagnosis.settings import VerdictSettings
from gpsim.effects import own_name
from gpsim.findings import Estimate, no_size, read, sized

Json = Mapping[str, Any]
FEW, MANY = 0.03, 0.9  # of the samples: a region that holds less, or more, is none
CLOSE = 1.025  # of a ratio of probabilities: explanations are as likely, and numbers are rounded in the file


def contradictions(diagnosis: Json) -> list[str]:
    """What of a diagnosis.json, as it was parsed, contradicts something else in it; empty where nothing does."""
    verdict, effects = diagnosis["verdict"], diagnosis["effects"]
    claims = [e for e in effects if e.get("role", "headline") == "headline"]
    found = list(_probabilities(diagnosis))
    for effect in effects:
        share = effect.get("acts_in")
        if share is not None and not FEW <= share <= MANY:
            found.append(f"{_name(effect)} is limited, and acts in {100 * share:.3g} % of the samples")
    if verdict in ("unknown", "none"):
        return found + [f"verdict {verdict}, and {_name(e)} is a headline effect" for e in claims]
    for effect in claims:
        if no_size(effect["family"], _sizes(effect)):
            found.append(f"the size of {_name(effect)}, a headline effect, is unknown")
    if not effects:
        found.append(f"verdict {verdict}, without an effect")
    if verdict == "named":
        found += _named(diagnosis, claims)
    if verdict == "ambiguous" and not diagnosis["alternatives"] and not any(_low(e) for e in claims):
        found.append("verdict ambiguous, but without an alternative or low odds")
    return found


def _named(diagnosis: Json, claims: Sequence[Json]) -> Iterator[str]:
    """What an account that is named must not have."""
    if not claims:
        yield "verdict named, without a headline effect"
    for effect in claims:
        sizes = _sizes(effect)
        if any(size.at_bound for size in sizes.values()):
            yield f"verdict named, but {_name(effect)} stopped at its bound"
        if not sized(effect["family"], sizes):
            yield f"verdict named, but the size of {_name(effect)} is unknown"
        if effect.get("form") == "approximate":
            yield f"verdict named, but the law of {_name(effect)} holds only approximately"
        if _low(effect):
            yield f"verdict named, but the odds against an account without {_name(effect)} are low"
    for rival in diagnosis["alternatives"]:
        lacking = set(map(_claim, claims)) - set(map(_claim, rival["effects"]))
        if lacking:
            yield f"verdict named, but an alternative lacks {', '.join(f'{f} on {on}' for f, on in sorted(lacking))}"
    explained = diagnosis.get("explained") or {}
    share = explained.get("rollout") or {"share": 0.0, "high": None}
    something = diagnosis.get("remainder", {}).get("structured") or explained.get("counts", True)
    if something and share["high"] is not None and share["high"] < VerdictSettings().nearly_all:
        yield "verdict named, but much less than nine tenths are explained"
    most = share["share"] if share["high"] is None else share["high"]
    taken = (diagnosis["fit"].get("black_box") or {"takes_off": {"share": 0.0}})["takes_off"]
    least = taken["share"] if taken.get("low") is None else taken["low"]
    if least > VerdictSettings().black_box and most < 1 - VerdictSettings().headline:
        yield "verdict named, but a black box removes more than a quarter of the error"


def _probabilities(diagnosis: Json) -> Iterator[str]:
    """Of explanations: they add up, and verdict and odds go by them."""
    effects, rivals = diagnosis["effects"], diagnosis["alternatives"]
    if not effects:
        return
    own = {e["probability"] for e in effects}
    if len(own) > 1:
        yield "effects of one account have different probabilities"
    leader, best = max(own), max((r["probability"] for r in rivals), default=0.0)
    if leader + sum(r["probability"] for r in rivals) > 1.0 + 1e-6:
        yield "probabilities add up to more than 1"
    margin = math.exp(VerdictSettings().tie) * CLOSE
    if best > margin * leader:
        yield f"the leader's probability is {leader:.2g}, an alternative's {best:.2g}"
    if best > leader * CLOSE and diagnosis.get("leads", "simplest") == "likeliest":
        yield "the leader is called the likeliest, but an alternative is more likely"
    for effect in effects:
        nats = (effect.get("odds") or {}).get("nats")
        against = [r["probability"] for r in rivals if _claim(effect) not in map(_claim, r["effects"])]
        if nats is not None and against and leader > 0.0:
            said = math.log(leader / max(max(against), 1e-300))
            if nats > said + math.log(CLOSE):
                yield f"the odds against an account without {_name(effect)} contradict its probability"


def _low(effect: Json) -> bool:
    """Whether the odds of a claim are low."""
    nats = (effect.get("odds") or {}).get("nats")
    return nats is not None and nats < math.log(VerdictSettings().odds)


def _sizes(effect: Json) -> dict[str, Estimate]:
    """Those that recordings share, and what is one recording's own of several."""
    sizes = dict(effect["parameters"])
    for place, own in enumerate((effect.get("own") or {}).values()):
        sizes |= {own_name(name, place): size for name, size in own.items()}
    return {name: read(Estimate, size, name) for name, size in sizes.items()}


def _claim(effect: Json) -> tuple[str, str]:
    on = effect["on"]
    return effect["family"], on if isinstance(on, str) else ",".join(on)


def _name(effect: Json) -> str:
    return " on ".join(_claim(effect))
