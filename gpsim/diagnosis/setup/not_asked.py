"""Which families a recording cannot show: what they need does not happen in it."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from gpsim.diagnosis.fitting import Candidate
from gpsim.diagnosis.report import NotAsked
from gpsim.diagnosis.setup.prepare import Question
from gpsim.effects import FAMILIES, ActuatorEffect, DriveEffect, Effect, effect_of
from gpsim.simulators import Simulator


def shows(question: Question, candidate: Candidate) -> bool:
    """Whether the recording can show the term at all."""
    effect = effect_of(candidate.family)
    still = question.sight.still if question.sight else {}
    return not isinstance(effect, (ActuatorEffect, DriveEffect)) or _shows(
        effect, candidate.place.on, still.get(candidate.place.on), question.whole
    )


def not_asked(question: Question) -> tuple[NotAsked, ...]:
    """What the recording does not show or the user has settled, and the families that are left out for it."""
    return (*_not_shown(question), *_untouched(question), *_settled(question))


def _untouched(question: Question) -> list[NotAsked]:
    """Geoms that nothing touches: neither their friction nor their stiffness shows."""
    states = np.concatenate([e.states for e in question.recording.episodes])
    found = question.everything.simulator.untouched(states)
    declared = [n for n in question.everything.simulator.parameters if n in found]
    return [
        _entry("nothing touches", geom, None, "", ())
        for geom in dict.fromkeys(n.rpartition(".")[0] for n in declared)
    ]


def _settled(question: Question) -> list[NotAsked]:
    known, simulator = question.everything.run.known, question.whole
    out = [
        _entry("known", name, value, simulator.parameters[name].unit, ("parameter_offset",))
        for name, value in known.fix.items()
    ]
    places = {e.family: e.places(simulator) for e in FAMILIES.values()}
    left_out = [f for f, on in places.items() if on and not any(known.asks((f, place)) for place in on)]
    if known.only or known.without:
        out.append(_entry("asked", "", None, "", left_out))
    return out + [_entry("does nothing", name, None, "", ()) for name in question.idle]


def _not_shown(question: Question) -> tuple[NotAsked, ...]:
    sight, simulator = question.sight, question.whole
    if sight is None:
        return ()
    out = []
    for name, value in sight.still.items():
        families = [
            e.family
            for e in FAMILIES.values()
            if isinstance(e, (ActuatorEffect, DriveEffect)) and not _shows(e, name, value, simulator)
        ]
        because = "constant command" if sight.commanded else "no command"
        out.append(_entry(because, name, value, simulator.action.units[name], families))
    units = simulator.state.units
    speeds = {c.velocity for c in simulator.coordinates}
    for name, value in sight.held.items():
        if name in speeds:
            continue  # its position says it
        out.append(_entry("held", name, value, units[name], _on(simulator, name)))
    out += [_entry("constant", n, None, units[n], ()) for n in sight.constant]
    out += [_entry("not needed", n, None, units[n], _on(simulator, n)) for n in sight.dropped]
    out += [_entry("estimated", n, None, units[n], _on(simulator, n, site="sensor")) for n in question.hidden]
    return tuple(out)


def _entry(because: str, channel: str, value: float | None, unit: str, families: Iterable[str]) -> NotAsked:
    return NotAsked(because=because, channel=channel, value=value, unit=unit, families=tuple(families))  # type: ignore[arg-type]


def _on(simulator: Simulator, name: str, site: str | None = None) -> list[str]:
    """The families of forces and sensors that act on a state."""
    sites = ("force", "sensor") if site is None else (site,)
    return [e.family for e in FAMILIES.values() if e.site in sites and name in e.places(simulator)]


def _shows(effect: Effect, on: str, still: float | None, simulator: Simulator) -> bool:
    """Whether a command that stands still, at `still`, lets an actuator's effect show; None of one that changes."""
    if still is None:
        return True
    if not isinstance(effect, ActuatorEffect):
        return False
    if effect.needs == "command":
        return still != 0.0
    # Of a command that is never given a constant force says the same, where there is one.
    return effect.needs == "nothing" and (still != 0.0 or not simulator.coordinates)
