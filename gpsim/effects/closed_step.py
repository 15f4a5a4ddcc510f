"""Simulators that own their integration: a chain asks them for whole stretches of time, not for rates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol, runtime_checkable

from gpsim.channels import BoolArray, FloatArray
from gpsim.effects.effect import Values
from gpsim.effects.term import Term
from gpsim.simulators import Memory, Simulator


@runtime_checkable
class BlackBoxStepper(Protocol):
    """What a chain needs of a simulator whose step it cannot take apart (MuJoCo's).

    Effects on commands and on sensors stay the chain's; all others the simulator takes as terms.
    """

    @property
    def own_grid(self) -> bool:
        """Whether it steps as its model says, so that its step is a part of what is believed."""
        ...

    def steps_of(self, dt: float) -> int:
        """How many of its own steps a transition of dt [s] takes."""
        ...

    def as_modelled(self) -> Simulator:
        """The same by the model's own method."""
        ...

    def exact(self) -> Simulator:
        """The same by a method of higher order, which is nearer to what happens in longer steps."""
        ...

    def around(self, states: FloatArray) -> Simulator:
        """The same for motion near these states (N, S), without what plays no part there: contacts."""
        ...

    def lacking_force(
        self,
        state: FloatArray,
        action: FloatArray,
        acceleration: FloatArray,
        parameters: Mapping[str, float],
        terms: Sequence[Term] = (),
    ) -> FloatArray:
        """(B, C): the force on every coordinate that is lacking at such rates (B, R), with these terms."""
        ...

    @property
    def positions(self) -> tuple[int, ...]:
        """State columns of places and orientations."""
        ...

    def motion(self, path: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(N, S) states and (N, R) rates along `positions` (3, N, Q) with their first two derivatives by time."""
        ...

    def rest(self, count: int) -> Memory:
        """What its own actuators remember (B, ...) where an episode begins; empty where they remember nothing."""
        ...

    def led(
        self,
        first: FloatArray,
        before: FloatArray,
        commands: FloatArray,
        steps: FloatArray,
        commanded: FloatArray,
    ) -> Memory:
        """The same after commands (B, K, A), each held so long (B, K) s, in states before (B, K, S).

        first: (B, S) where the episode began; commanded: (B, A) what was commanded before all that, times how long.
        """
        ...

    def acting(self, actions: FloatArray, t: FloatArray) -> FloatArray:
        """(N, A): what its actuators make of the commands of an episode with the clock t (N + 1,) s, in the mean."""
        ...

    def hindered(self, states: FloatArray) -> BoolArray:
        """(N, C): which coordinates something else pushes: a limit of theirs, or what touches."""
        ...

    def rolled(
        self,
        terms: Sequence[Term],
        parameters: Mapping[str, float],
        values: Sequence[Values],
        state: FloatArray,
        commands: FloatArray,
        step: FloatArray,
        t: FloatArray,
        extra: FloatArray | None = None,
        strained: Memory | None = None,
    ) -> FloatArray:
        """(B, K, S): the states after each of K substeps of `step` (B,) s, which begin at t (B,) s in state (B, S).

        commands: (B, K, A) that reach it; extra: (B, R) added to the rates throughout. A negative step looks back.
        strained: how far bristles are bent and drives twisted, by their terms, and what `rest` and `led` say, which
        moves on; else nothing is bent or twisted, and commands have long been what they are.
        """
        ...


def closed(simulator: Simulator) -> BlackBoxStepper | None:
    """The simulator as one that owns its integration, or None."""
    return simulator if isinstance(simulator, BlackBoxStepper) else None
