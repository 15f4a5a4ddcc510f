"""The catalogue applied to a simulator and a recording: every effect that makes sense, everywhere it makes sense.

And which families the recording cannot show: what they need does not happen in it.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping

import numpy as np

from gpsim.diagnosis.fitting import Candidate
from gpsim.diagnosis.setup.known import allowed, check_bounds
from gpsim.diagnosis.setup.prepare import PreparedProblem
from gpsim.diagnosis.setup.sizes import Sizes
from gpsim.effects import FAMILIES, ActuatorEffect, DriveEffect, Effect, closed, declared, effect_of
from gpsim.findings import NotAsked
from gpsim.recordings import Recording
from gpsim.simulators import Simulator

OF_JOINTS = ("viscous_friction", "coulomb_friction", "stribeck_friction", "constant_force", "armature")


def candidates(
    recording: Recording,
    simulator: Simulator,
    parameters: Mapping[str, float],
    hidden: Collection[str] = (),
) -> list[Candidate]:
    """All terms that may be missing, in the catalogue's order. hidden: channels that nobody measured.

    Of the ground only what something touches in the recording is asked; of what says where a body floats neither
    friction nor a rotor; of a body that stands on something neither drag nor wind.
    """
    states = np.concatenate([e.states for e in recording.episodes])
    untouched, stands = simulator.untouched(states), simulator.stands(states)
    sizes = Sizes(recording, simulator, parameters, hidden)
    out = []
    for effect in FAMILIES.values():
        for on in effect.places(simulator):
            if on in untouched or (on in simulator.floating and effect.family in OF_JOINTS):
                continue
            there = simulator.model_places.get(effect.family, {}).get(on)
            if stands and there is not None and there.afloat:
                continue
            place = sizes.place(effect, on)
            out += [
                Candidate(effect.family, place, variant, declared(effect, place, variant))
                for variant in effect.variants
                if effect.offers(place, variant)
            ]
    return out


def offers_of(question: PreparedProblem) -> list[Candidate]:
    """Every term that may be missing from a question's simulator, and that its recording could show."""
    problem = question.everything
    known, parameters = problem.run.known, problem.parameters
    offers = [
        c
        for c in candidates(question.recording, problem.simulator, parameters, question.hidden)
        if _is_read(question, c)
        and _shows(effect_of(c.family), c.place.on, question.sight.still.get(c.place.on), question.whole)
    ]
    check_bounds(known, offers)
    return allowed(known, offers, parameters, closed(problem.simulator) is not None)


def _is_read(question: PreparedProblem, candidate: Candidate) -> bool:
    """Whether what a sensor's effect acts on was read, and was not made of something else."""
    names, observed = question.everything.simulator.state.names, question.everything.observed
    on = candidate.place.on
    return effect_of(candidate.family).site != "sensor" or on not in names or bool(observed[names.index(on)])


def _shows(effect: Effect, on: str, still: float | None, simulator: Simulator) -> bool:
    """Whether a command that stands still, at `still`, lets an effect show; None of one that changes."""
    if still is None or not isinstance(effect, (ActuatorEffect, DriveEffect)):
        return True
    if isinstance(effect, DriveEffect):
        return False
    if effect.needs == "command":
        return still != 0.0
    # Of a command that is never given a constant force says the same, where there is one.
    return effect.needs == "nothing" and (still != 0.0 or not simulator.coordinates)


def not_asked(question: PreparedProblem) -> tuple[NotAsked, ...]:
    """What the recording does not show or the user has settled, and the families that are left out for it."""
    return (*_not_shown(question), *_untouched(question), *_settled(question))


def _not_shown(question: PreparedProblem) -> list[NotAsked]:
    sight, simulator, out = question.sight, question.whole, []
    because = "constant command" if sight.commanded else "no command"
    for name, value in sight.still.items():
        families = [e.family for e in FAMILIES.values() if not _shows(e, name, value, simulator)]
        out.append(_entry(because, name, value, simulator.action.units[name], families))
    units = simulator.state.units
    speeds = {c.velocity for c in simulator.coordinates}
    for name, value in sight.held.items():
        if name not in speeds:  # else its position says it
            out.append(_entry("held", name, value, units[name], _on(simulator, name)))
    out += [_entry("constant", n, None, units[n]) for n in sight.constant]
    out += [_entry("not needed", n, None, units[n], _on(simulator, n)) for n in sight.dropped]
    out += [_entry("estimated", n, None, units[n], _on(simulator, n, "sensor")) for n in question.hidden]
    return out


def _untouched(question: PreparedProblem) -> list[NotAsked]:
    """Geoms that nothing touches: neither their friction nor their stiffness shows."""
    simulator = question.everything.simulator
    found = simulator.untouched(np.concatenate([e.states for e in question.recording.episodes]))
    geoms = dict.fromkeys(n.rpartition(".")[0] for n in simulator.parameters if n in found)
    return [_entry("nothing touches", geom) for geom in geoms]


def _settled(question: PreparedProblem) -> list[NotAsked]:
    known, simulator = question.everything.run.known, question.whole
    out = [
        _entry("known", name, value, simulator.parameters[name].unit, ("parameter_offset",))
        for name, value in known.fix.items()
    ]
    if known.only or known.without:
        places = {e.family: e.places(simulator) for e in FAMILIES.values()}
        left_out = [f for f, on in places.items() if on and not any(known.asks((f, place)) for place in on)]
        out.append(_entry("asked", "", families=left_out))
    return out


def _entry(
    because: str, channel: str, value: float | None = None, unit: str = "", families: Iterable[str] = ()
) -> NotAsked:
    return NotAsked(because=because, channel=channel, value=value, unit=unit, families=tuple(families))  # type: ignore[arg-type]


def _on(simulator: Simulator, name: str, *sites: str) -> list[str]:
    """The families that act on a state, of forces and sensors where no sites are named."""
    sites = sites or ("force", "sensor")
    return [e.family for e in FAMILIES.values() if e.site in sites and name in e.places(simulator)]
