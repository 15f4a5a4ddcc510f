"""What the user knows, held against what there is: names that nobody knows are one line; bounds of what is offered."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

from gpsim.diagnosis.fitting import Candidate
from gpsim.diagnosis.settings import NAMES, Known
from gpsim.effects import CURVES, FAMILIES, EffectParameter, effect_of
from gpsim.errors import UsageError, near
from gpsim.simulators import Simulator

FAMILIES_AT = "diagnose.families"
BOUNDS_AT = "diagnose.known.bounds"
MOST_NAMED = 4  # of what there is, where none is meant


def with_known(known: Known, simulator: Simulator, parameters: Mapping[str, float]) -> dict[str, float]:
    """The base's parameters, those that the user knows among them; every name is checked.

    Raises UsageError in one line that says what there is.
    """
    for name in known.fix:
        _check(name, simulator.parameters, "diagnose.known.fix", f"parameter of {simulator.name}")
    fixed = simulator.defaults({**parameters, **known.fix}) if known else dict(parameters)
    for what in NAMES:
        for name in getattr(known, what):
            _check_family(name, simulator, f"{FAMILIES_AT}.{what}")
    for name, (low, high) in known.bounds.items():
        if name not in simulator.parameters:
            _check_effect_parameter(name, simulator)
        elif not low <= fixed[name] <= high:
            raise UsageError(
                f"{BOUNDS_AT}.{name}: [{low:g}, {high:g}] does not contain the value of the simulator, "
                f"{fixed[name]:g} {simulator.parameters[name].unit}; set a value inside with diagnose.known.fix or in "
                "recording.yaml"
            )
    return fixed


def allowed(
    known: Known, offers: Sequence[Candidate], parameters: Mapping[str, float], robot: bool
) -> list[Candidate]:
    """What may be offered, within the bounds that the user gave; raises UsageError where something required is not."""
    asked = {name for name, effect in FAMILIES.items() if effect.asked or (robot and effect.of_robots)}
    kept = [_bounded(c, known, parameters) for c in offers if known.asks(c.identity, c.family in asked)]
    usable = [c for c in kept if not c.only_gated]
    for name in known.lacking([c.identity for c in usable]):
        region = known.lacking([c.identity for c in kept]) != known.lacking([c.identity for c in usable])
        why = "it acts in a region only" if region else "this recording cannot show it, or you excluded it"
        raise UsageError(f"{FAMILIES_AT}.require: '{name}' cannot be required: {why}")
    return kept


def _bounded(candidate: Candidate, known: Known, parameters: Mapping[str, float]) -> Candidate:
    """The candidate with its parameters' bounds as the user gave them."""
    (family, on), declared = candidate.identity, []
    for parameter in candidate.declared:
        ends = known.bounds.get(f"{family}.{on}.{parameter.name}")
        if family == "parameter_offset" and on in known.bounds and parameters[on] != 0.0:
            low, high = sorted(end / parameters[on] for end in known.bounds[on])
            ends = low, high
        declared.append(parameter if ends is None else _within(parameter, ends))
    return replace(candidate, declared=tuple(declared))


def _within(parameter: EffectParameter, ends: tuple[float, float]) -> EffectParameter:
    """Bounds as given; starts that lie beyond are moved into them, to where a fit can go either way."""
    low, high = ends
    middle = 0.5 * (low + high)
    starts = tuple(dict.fromkeys(s if low < s < high else middle for s in parameter.starts))
    return replace(parameter, low=low, high=high, starts=starts, scale=min(parameter.scale, high - low))


def _check_family(name: str, simulator: Simulator, where: str) -> None:
    family, _, on = name.partition(" on ")
    _check(family, {**FAMILIES, **CURVES}, where, "family")
    places = effect_of(family).places(simulator)
    if on:
        _check(on, places, where, f"place of {family}")
    elif not places:
        raise UsageError(f"{where}: {family} acts on nothing that {simulator.name} has")


def _check_effect_parameter(name: str, simulator: Simulator) -> None:
    family, _, rest = name.partition(".")
    on = rest.rpartition(".")[0]
    if not on:
        known = ", ".join(simulator.parameters) or "no parameters"
        raise UsageError(
            f"{BOUNDS_AT}: '{name}' is neither a parameter of {simulator.name} ({known}) nor family.place.parameter, "
            "as coulomb_friction.x.force"
        )
    _check_family(f"{family} on {on}", simulator, BOUNDS_AT)


def check_bounds(known: Known, offers: Sequence[Candidate]) -> None:
    """Every bound of an effect's parameter must name one that some law has there."""
    for name in known.bounds:
        family, _, rest = name.partition(".")
        on, _, parameter = rest.rpartition(".")
        there = [p.name for c in offers if c.identity == (family, on) for p in c.declared]
        if on and there:
            _check(parameter, dict.fromkeys(there), BOUNDS_AT, f"parameter of {family}")


def _check(name: str, there: Collection[str], where: str, kind: str) -> None:
    if name in there:
        return
    names = list(there)
    more = f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else ""
    told = f"{', '.join(names[:MOST_NAMED]) or 'none'}{more}"
    raise UsageError(f"{where}: no {kind} '{name}'{near(name, there)}; there are: {told}")
