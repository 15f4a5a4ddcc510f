"""Groups of laws that one free curve stands in for: at the same site and place, of the same input, behind one gate."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field, replace

from gpsim.diagnosis.fitting import Hypothesis, Problem
from gpsim.diagnosis.report import Claims
from gpsim.diagnosis.selection import LackOfFit
from gpsim.effects import ForceEffect, FunctionOf, Gate, Term, VehicleEffect, effect_of
from gpsim.simulators import Simulator


@dataclass(frozen=True)
class Group:
    """Terms of an explanation, by their indices. of: what their laws are functions of; "nothing": no curve is tried.

    changes: which part of a vehicle's twist; dry: whether one of them is dry friction.
    """

    site: str
    on: str
    of: FunctionOf
    terms: tuple[int, ...]
    gate: Gate = field(default_factory=Gate)
    changes: str = ""
    dry: bool = False

    @property
    def testable(self) -> bool:
        """Whether there is a curve of their input."""
        return self.of != "nothing"

    def claims(self, hypothesis: Hypothesis) -> Claims:
        """Family and place of its terms."""
        return tuple(hypothesis.terms[i].identity for i in self.terms)

    def inputs(self, simulator: Simulator) -> tuple[str, ...]:
        """The channels that its laws look at, by the names that lack of fit has for them; none of a twist."""
        if self.of == "speed":
            return tuple(c.velocity for c in simulator.coordinates if c.name == self.on)
        return (self.on,) if self.of in ("position", "command", "reading") else ()

    def quantity(self, simulator: Simulator) -> tuple[str, str]:
        """What a curve in their place gives, and its unit."""
        if self.site == "force":
            kind = "friction" if self.of == "position" and self.dry else "force"
            (unit,) = (c.force_unit for c in simulator.coordinates if c.name == self.on)
            return f"{kind} on {self.on}", unit
        if self.site == "actuator":
            return f"{self.on} at the simulator", simulator.action.units[self.on]
        if self.site == "vehicle":
            return self.changes, simulator.rate.units[self.changes]
        return f"{self.on} as read", simulator.state.units[self.on]

    def drawn_over(self, simulator: Simulator) -> tuple[str, str]:
        """The input over which such a curve is drawn, and its unit; of a twist the turn rate."""
        if self.of == "twist":
            return "w", simulator.rate.units["w"]
        (channel,) = self.inputs(simulator)
        return channel, (simulator.state + simulator.action).units[channel]


def groups_of(hypothesis: Hypothesis, among: Collection[int] | None = None) -> list[Group]:
    """The groups of an explanation's terms, in their order. among: the terms that count; None: all.

    Those without a curve are grouped by site and place, parameters all together: what they lack nobody can tell apart.
    """
    found: dict[object, list[int]] = {}
    for i, term in enumerate(hypothesis.terms):
        if among is None or i in among:
            found.setdefault(_key(term), []).append(i)
    return [_group(hypothesis, tuple(indices)) for indices in found.values()]


def further_input(simulator: Simulator, group: Group, lack: LackOfFit | None) -> str | None:
    """What a group's law depends on, too, as lack of fit has it: the other one of two inputs, if one is its own.

    What is missing and has nothing to do with a law's own input is no fault of the law's.
    """
    own = group.inputs(simulator)
    if lack is None or not lack.significant or group.of == "reading" or len(lack.on) != 2:
        return None
    others = [name for name in lack.on if name not in own]
    return others[0] if len(others) == 1 else None


def groups_missing(problem: Problem, hypothesis: Hypothesis, lack: LackOfFit) -> list[Group]:
    """Where a curve of one input might account for what lack of fit names: with the laws that are there, if any.

    A force of a coordinate's own speed or position, what becomes of a command or of a reading, what a vehicle makes of
    its twist.
    """
    if not lack.significant or lack.memory is not None:
        return []
    rates = {c.name: c.rate for c in problem.simulator.coordinates}

    def may_be(group: Group) -> bool:
        changes = {"force": rates.get(group.on), "vehicle": group.changes}.get(group.site, lack.rate)
        return changes == lack.rate and set(group.inputs(problem.simulator)) <= set(lack.on)

    smooth = (g for g in groups_of(hypothesis) if not g.gate and not (g.dry and g.of == "position"))
    there = {(g.site, g.on, g.of, g.changes): g for g in smooth}
    return [there.get((g.site, g.on, g.of, g.changes), g) for g in every_group(problem) if may_be(g)]


def every_group(problem: Problem) -> list[Group]:
    """Wherever a curve of one input might act, no law in its place: forces, commands, readings, turns."""
    simulator = problem.simulator
    forces = [Group("force", c.name, of, ()) for c in simulator.coordinates for of in ("speed", "position")]
    commands = [Group("actuator", name, "command", ()) for name in simulator.action.names]
    seen = zip(simulator.state.names, problem.observed, strict=True)
    readings = [Group("sensor", name, "reading", ()) for name, observed in seen if observed]
    vehicles = [
        Group("vehicle", on, "twist", (), changes=changes)
        for on in effect_of("rate_curve").places(simulator)
        for changes in ("w", "v_lateral")
    ]
    return [*forces, *commands, *readings, *vehicles]


def _group(hypothesis: Hypothesis, indices: tuple[int, ...]) -> Group:
    term = hypothesis.terms[indices[0]]
    effect = term.effect
    return Group(
        effect.site,
        term.on,
        effect.function_of,
        indices,
        _own_gate(term),
        effect.changes if isinstance(effect, VehicleEffect) else "",
        any(_dry(hypothesis.terms[i]) for i in indices),
    )


def _key(term: Term) -> object:
    effect, gate = term.effect, _own_gate(term)
    if effect.function_of == "nothing":
        return effect.site, term.on if effect.site != "parameter" else "", "nothing"
    stands = tuple(sorted(gate.region.items())), gate.since, gate.until, gate.since_episode
    changes = effect.changes if isinstance(effect, VehicleEffect) else ""
    apart = effect.function_of == "position" and _dry(term)  # it knows the sign of the speed, too
    return effect.site, term.on, effect.function_of, changes, apart, stands


def _dry(term: Term) -> bool:
    return isinstance(term.effect, ForceEffect) and term.effect.dry


def _own_gate(term: Term) -> Gate:
    """The gate of a term; a region of the input of its own law is part of the law."""
    if term.effect.function_of != "position":
        return term.gate
    return replace(term.gate, region={name: at for name, at in term.gate.region.items() if name != term.on})
