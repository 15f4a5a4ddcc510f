"""A simulator whose angles wrap where a recording says so, though the simulator itself does not know it."""

from __future__ import annotations

from gpsim.channels import Channels, FloatArray, difference
from gpsim.simulators.simulator import Integrator, Parameters, RateFunction, Simulator


def wrapping(simulator: Simulator, state: Channels) -> Simulator:
    """`simulator`, in whose place one stands with the channels `state` where more of them wrap.

    state: the simulator's own names and units.
    """
    if state == simulator.state:
        return simulator
    return simulator.with_state(state) or _Wrapping(simulator, state)


def unwrapped(simulator: Simulator) -> Simulator:
    """The simulator itself, whose states step in the same way."""
    return simulator._inner if isinstance(simulator, _Wrapping) else simulator


class _Wrapping(Simulator):
    """Another's physics; its state's differences are taken the short way round where a channel wraps."""

    def __init__(self, simulator: Simulator, state: Channels) -> None:
        # Class constants of the built-in simulators; a user's, which is loaded again in every process, stays as it is.
        self.state = state  # type: ignore[misc]
        self.name = simulator.name  # type: ignore[misc]
        self.action = simulator.action  # type: ignore[misc]
        self.rate = simulator.rate  # type: ignore[misc]
        self.parameters = dict(simulator.parameters)  # type: ignore[misc]
        self.coordinates = simulator.coordinates  # type: ignore[misc]
        self.start = dict(simulator.start)
        self._inner = simulator

    @property
    def kinematic(self) -> bool:
        """As the simulator's own."""
        return self._inner.kinematic

    def rates(
        self, state: FloatArray, action: FloatArray, parameters: Parameters, forces: FloatArray | None = None
    ) -> FloatArray:
        """(B, R): the simulator's own."""
        return (
            self._inner.rates(state, action, parameters)
            if forces is None
            else self._inner.rates(state, action, parameters, forces)
        )

    def derivative(self, state: FloatArray, rates: FloatArray) -> FloatArray:
        """(B, S): the simulator's own."""
        return self._inner.derivative(state, rates)

    def measured_rates(self, state: FloatArray, next_state: FloatArray, dt: FloatArray) -> FloatArray:
        """(B, R): the simulator's own, of angles that go the short way on."""
        return self._inner.measured_rates(state, state + difference(next_state, state, self.state), dt)

    def mobility(self, state: FloatArray, parameters: Parameters, coordinate: int) -> FloatArray | None:
        """The simulator's own."""
        return self._inner.mobility(state, parameters, coordinate)

    def normal_force(
        self, state: FloatArray, rates: FloatArray, parameters: Parameters
    ) -> dict[str, FloatArray]:
        """The simulator's own."""
        return self._inner.normal_force(state, rates, parameters)

    def integrate(
        self, state: FloatArray, rates_of: RateFunction, dt: FloatArray, integrator: Integrator
    ) -> FloatArray:
        """The simulator's own."""
        return self._inner.integrate(state, rates_of, dt, integrator)
