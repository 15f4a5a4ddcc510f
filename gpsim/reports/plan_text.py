"""What a plan says, in a few lines: for the terminal and above its page."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from gpsim.planning import Plan
from gpsim.reports.sheets import percent


def plan_facts(plan: Plan) -> dict[str, Any]:
    """What plan.yaml says of pieces, pairs and safety."""
    return {
        "minutes": plan.minutes,
        "dt": plan.dt,
        "anew": plan.anew,
        "pieces": [vars(p) for p in plan.pieces],
        "pairs": [{**vars(p), "sensors": list(p.sensors)} for p in plan.pairs],
        "safety": vars(plan.safety),
    }


def told(facts: Mapping[str, Any]) -> list[str]:
    """What a person wants to know first."""
    pairs, safety = facts["pairs"], facts["safety"]
    lines = [
        f"{facts['minutes']:.2g} minutes in {len(facts['pieces'])} pieces, one command every {facts['dt']:g} s."
    ]
    if facts["anew"]:
        lines.append("Before each piece the machine is put back to rest by hand; each is an episode.")
    if not pairs:
        lines.append("There is one explanation: the plan is for its parameters.")
    for pair in pairs:
        lines.append(_told(pair))
    lines.append(
        f"Of {safety['draws']} draws of all posteriors {safety['left']} left the box less {safety['margin']:.0%} at "
        f"each side, or did not come back to rest: a chance of at most {percent(safety['most'])} (90 %)."
    )
    return lines


def _told(pair: Mapping[str, Any]) -> str:
    who = f"{pair['first']} and {pair['second']}"
    if not pair["separated"]:
        wanted = "; ".join(pair["sensors"]) or "a quantity of which they say something different"
        return f"No command that was tried separates {who} ({pair['nats']:.2g} nats); measure {wanted}."
    others = ", ".join(f"{kind} {nats:.3g}" for kind, nats in pair["fixed"].items())
    return f"{who} differ by {pair['a_minute']:.3g} nats a minute ({others}, the old recording {pair['recorded']:.2g})."
