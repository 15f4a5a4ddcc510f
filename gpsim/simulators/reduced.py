"""A simulator with fewer states: some are held still by a constraint, others nobody measured and nothing needs."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np

from gpsim.channels import Channels, FloatArray
from gpsim.simulators.simulator import Integrator, Parameters, RateFunction, Simulator


def reduced(simulator: Simulator, fixed: Mapping[str, float], held: Collection[str] = ()) -> Simulator:
    """`simulator` without the states `fixed`, which stand at these values.

    held: coordinates among them that something outside holds still: a force of constraint keeps their rates at 0,
    and the other coordinates move as if on a fixed mount. All others must be states of which no kept one's rate
    depends.
    """
    return (simulator.without(fixed, held) or _Reduced(simulator, fixed, held)) if fixed else simulator


@dataclass(frozen=True)
class Whole:
    """A simulator with all its states: which of them are `kept`, and where all rest (S,) that are not.

    own: the coordinates that are left, of the simulator's; held: those that a force of constraint holds still.
    """

    simulator: Simulator
    kept: tuple[int, ...]
    rest: FloatArray
    own: tuple[int, ...]
    held: tuple[int, ...]


def whole(simulator: Simulator) -> Whole:
    """What a reduced simulator was made of; of another one itself."""
    if isinstance(simulator, _Reduced):
        kept, own, held = (tuple(i) for i in (simulator._kept, simulator._own, simulator._held))
        return Whole(simulator._inner, kept, simulator._rest, own, held)
    count = len(simulator.state)
    return Whole(
        simulator, tuple(range(count)), np.zeros(count), tuple(range(len(simulator.coordinates))), ()
    )


class _Reduced(Simulator):
    """Another's physics in the states that are left. Rates are all of the simulator's, those of held ones are 0."""

    def __init__(self, simulator: Simulator, fixed: Mapping[str, float], held: Collection[str]) -> None:
        names = simulator.state.names
        # Class constants of the built-in simulators; a user's, which is loaded again in every process, stays as it is.
        self.state = Channels(tuple(c for c in simulator.state if c.name not in fixed))  # type: ignore[misc]
        self.name = simulator.name  # type: ignore[misc]
        self.action = simulator.action  # type: ignore[misc]
        self.rate = simulator.rate  # type: ignore[misc]
        self.parameters = dict(simulator.parameters)  # type: ignore[misc]
        own = [i for i, c in enumerate(simulator.coordinates) if not {c.name, c.velocity} & set(fixed)]
        self.coordinates = tuple(simulator.coordinates[i] for i in own)  # type: ignore[misc]
        self.start = {name: value for name, value in simulator.start.items() if name not in fixed}
        self.integrator = simulator.integrator
        self._inner, self._own = simulator, own
        self._kept = [names.index(name) for name in self.state.names]
        self._rest = np.array([fixed.get(name, 0.0) for name in names])
        self._held = [i for i, c in enumerate(simulator.coordinates) if c.name in held]
        self._stopped = [simulator.rate.index(simulator.coordinates[i].rate) for i in self._held]

    @property
    def kinematic(self) -> bool:
        """As the simulator's own."""
        return self._inner.kinematic

    def rates(
        self, state: FloatArray, action: FloatArray, parameters: Parameters, forces: FloatArray | None = None
    ) -> FloatArray:
        """(B, R): the simulator's own, with the force that holds what is held."""
        full = self._full(state)
        if forces is None and not self._held:
            return self._inner.rates(full, action, parameters)
        every = np.zeros((len(state), len(self._inner.coordinates)))
        if forces is not None:
            every[:, self._own] = forces
        free = self._inner.rates(full, action, parameters, every)
        return self._constrained(full, action, parameters, free)

    def derivative(self, state: FloatArray, rates: FloatArray) -> FloatArray:
        """(B, S): the simulator's own."""
        return self._inner.derivative(self._full(state), rates)[:, self._kept]

    def measured_rates(self, state: FloatArray, next_state: FloatArray, dt: FloatArray) -> FloatArray:
        """(B, R): the simulator's own; what follows from states that are left out is no measurement."""
        return self._inner.measured_rates(self._full(state), self._full(next_state), dt)

    def mobility(self, state: FloatArray, parameters: Parameters, coordinate: int) -> FloatArray | None:
        """The simulator's own, less what goes into the mount of what is held."""
        full = self._full(state)
        own = self._inner.mobility(full, parameters, self._own[coordinate])
        if own is None or not self._held:
            return own
        action = np.zeros((len(state), len(self.action)))
        return self._constrained(full, action, parameters, own)

    def normal_force(
        self, state: FloatArray, rates: FloatArray, parameters: Parameters
    ) -> dict[str, FloatArray]:
        """The simulator's own, of the coordinates that are left."""
        names = {coordinate.name for coordinate in self.coordinates}
        forces = self._inner.normal_force(self._full(state), rates, parameters) if names else {}
        return {name: force for name, force in forces.items() if name in names}

    def integrate(
        self, state: FloatArray, rates_of: RateFunction, dt: FloatArray, integrator: Integrator
    ) -> FloatArray:
        """The simulator's own."""
        full = self._full(state)
        ended = self._inner.integrate(full, lambda at: rates_of(at[:, self._kept]), dt, integrator)
        return ended[:, self._kept]

    def measures(self, rate: str) -> bool:
        """Whether the states that are left say what a rate was."""
        column, state = self.rate.index(rate), np.zeros((1, len(self.state)))
        if column in self._stopped:
            return False
        moved = np.tile(self._rest, (2 * len(self._rest), 1))
        moved[np.arange(len(moved)), np.tile(np.arange(len(self._rest)), 2)] += np.repeat(
            [1.0, 0.5], len(self._rest)
        )
        before = np.tile(self._full(state), (len(moved), 1))
        changes = self._inner.measured_rates(before, moved, np.ones(len(moved)))[:, column] != 0.0
        needed = {i % len(self._rest) for i in np.flatnonzero(changes)}
        return needed <= set(self._kept)

    def _full(self, state: FloatArray) -> FloatArray:
        """(B, S) with the states that are left out at their values."""
        out = np.tile(self._rest, (len(state), 1))
        out[:, self._kept] = state
        return out

    def _constrained(
        self, full: FloatArray, action: FloatArray, parameters: Parameters, free: FloatArray
    ) -> FloatArray:
        """Rates (B, R), or what a force does to them, with the forces that leave the held ones' at 0."""
        if not self._held:
            return free
        columns = [self._pushed(full, action, parameters, i) for i in self._held]
        reacts = np.stack(columns, axis=2)  # (B, R, H)
        own = reacts[:, self._stopped]
        force = np.linalg.solve(own, -free[:, self._stopped, None])
        out: FloatArray = free + (reacts @ force)[..., 0]
        out[:, self._stopped] = 0.0
        return out

    def _pushed(
        self, full: FloatArray, action: FloatArray, parameters: Parameters, coordinate: int
    ) -> FloatArray:
        """(B, R) by how much a unit force on one of the simulator's coordinates changes the rates."""
        known = self._inner.mobility(full, parameters, coordinate)
        if known is not None:
            return known
        unit = np.zeros((len(full), len(self._inner.coordinates)))
        unit[:, coordinate] = 1.0
        none = np.zeros_like(unit)
        return self._inner.rates(full, action, parameters, unit) - self._inner.rates(
            full, action, parameters, none
        )
