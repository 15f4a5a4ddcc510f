"""What an effect is: one named physical term, where it acts, and the parameters it needs.

An effect knows its law and nothing of how it is searched for. Laws are batched: values of parameters, positions,
commands and measurements are (B,) arrays, one entry a row of the batch. Memory is a dictionary of arrays whose first
axis is the batch; a law changes it in place.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import Any, ClassVar, Literal

import numpy as np

from gpsim.channels import FloatArray
from gpsim.effects.place import EffectParameter, Place, Plausible
from gpsim.simulators import Memory, Simulator

RISE = "rise"
"""The variant of a law by which a joint's dry friction grows, as it slows or under load, beside what slides."""
Site = Literal["actuator", "force", "parameter", "vehicle", "rate", "sensor"]
FunctionOf = Literal["speed", "position", "command", "twist", "reading", "nothing"]
"""What a law without memory is a function of: its coordinate's speed or position, the command, a vehicle's twist, what
a sensor reads; "nothing" of which a curve could be drawn: it remembers, ages, is a number, or moves a whole pose."""
Needs = Literal["nothing", "command", "change"]
"""What a recording must hold for an actuator's effect to show: nothing, a command other than 0, one that changes."""
Values = Mapping[str, FloatArray]
"""Parameter values by name, (B,) each."""
Law = Callable[..., Any]
"""A law as one formula: NumPy's elementwise functions of its inputs and of its parameters' values, in that order.

The same function serves batches and, element by element, compiled code (see `gpsim.kernels.catalogue`).
"""
VEHICLE = ("v", "v_lateral", "w")
POSE = ("x", "y", "yaw")


class Effect(ABC):
    """One family. Subclasses choose a site's base class and write the law.

    What a search or a plant has to know of a family beside its law, the family says in class attributes, so that nobody
    has to know it by name: what its law is a `function_of` (every family must say it), whether it `drifts`, and which
    family it is a patch of (`patch_of`).
    """

    family: ClassVar[str]
    function_of: ClassVar[FunctionOf]
    noun: ClassVar[str] = ""  # what people call it, where that is not the family's name with spaces
    acts_on: ClassVar[str] = ""  # where, in a model of bodies; else its site says so
    site: ClassVar[Site]
    variants: ClassVar[tuple[str, ...]] = ("",)
    gated: ClassVar[bool] = True  # may a region or an onset limit it?
    needs_region: ClassVar[bool] = False  # does it make sense nowhere but in a region?
    patch_of: ClassVar[str | None] = None  # the family whose law it is in a region of its own coordinate
    drifts: ClassVar[bool] = False  # does it change with time by itself, as a battery does?
    plausible: ClassVar[Mapping[str, Plausible]] = {}  # parameter -> the sizes that machines have
    order: ClassVar[int] = 50  # several effects on an action, a twist or a sensor act in ascending order
    asked: ClassVar[bool] = True  # is it among what a diagnosis asks unless told otherwise?
    of_robots: ClassVar[bool] = False  # else: is it asked of robots, of the joint at which most is left?
    sentence: ClassVar[str] = (
        ""  # what a person would say of it: {on} and the names of its parameters are filled in
    )
    takes: ClassVar[
        Mapping[str, float]
    ] = {}  # a law's parameters, in its order, and what one is where it is missing
    law: ClassVar[Law | None] = None  # the family's law as one formula, where it has one

    def taken(self, values: Values) -> list[FloatArray | float]:
        """The values that a law of one formula takes, in its order."""
        return [values.get(name, otherwise) for name, otherwise in self.takes.items()]

    @abstractmethod
    def places(self, simulator: Simulator) -> tuple[str, ...]:
        """The names it can act on."""

    @abstractmethod
    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """What has to be known about it at a place."""

    def offers(self, place: Place, variant: str) -> bool:
        """Whether a variant of the law makes sense there."""
        return variant == ""

    def of_term(self, values: Mapping[str, float], variant: str) -> Effect:
        """The law of a term; a measured curve has the shape that the term's values say."""
        return self


class ForceEffect(Effect):
    """A generalised force on a coordinate. Its `law` is of (position, speed), `dry_law` of (position, speed, load)."""

    site: ClassVar[Site] = "force"
    dry_law: ClassVar[Law | None] = None
    loaded_by_command: ClassVar[bool] = False  # is its load the size of what drives the coordinate?

    @property
    def dry(self) -> bool:
        """Whether it can hold a body at rest."""
        return type(self).grip is not ForceEffect.grip or type(self).dry_law is not None

    def places(self, simulator: Simulator) -> tuple[str, ...]:
        """Every coordinate, and where the simulator says; those known to be driven, where that is the load."""
        if self.loaded_by_command:
            return (*simulator.driven().values(), *simulator.served)
        every = tuple(coordinate.name for coordinate in simulator.coordinates)
        return (*every, *simulator.model_places.get(self.family, ()))

    def force(self, position: FloatArray, speed: FloatArray, values: Values) -> FloatArray | None:
        """(B,) the smooth force on the coordinate; None when there is none."""
        law = type(self).law
        return None if law is None else np.asarray(law(position, speed, *self.taken(values)))

    def grip(
        self, position: FloatArray, speed: FloatArray, values: Values, load: FloatArray | None
    ) -> FloatArray | None:
        """(B,) the largest dry friction force, which opposes motion and holds a body at rest; None when there is none.

        load: (B,) the normal force where the simulator knows it, or the command's size; grip may be proportional to it.
        """
        law = type(self).dry_law
        return None if law is None else np.asarray(law(position, speed, load, *self.taken(values)))

    def weighs(self, values: Values) -> bool:
        """Whether its grip depends on the normal force."""
        return False


class BristleEffect(ForceEffect):
    """Friction with one hidden number a row, how far bristles are bent (see `gpsim.effects.bristles`).

    The stretch before a simulation begins says how far: where a body stood still they are not bent.
    """

    function_of: ClassVar[FunctionOf] = "nothing"
    gated: ClassVar[bool] = False

    @property
    def dry(self) -> bool:
        """It can hold a body, which creeps."""
        return True


class ActuatorEffect(Effect):
    """What happens to a command on its way to the simulator. A `law` is of (command), and has no memory."""

    site: ClassVar[Site] = "actuator"
    needs: ClassVar[Needs] = "change"  # of the command, to show at all
    holds: ClassVar[bool] = True  # is what it makes of held commands held? (else it changes within a substep)

    def places(self, simulator: Simulator) -> tuple[str, ...]:
        """Every action."""
        return simulator.action.names

    def begin(self, count: int, longest: float, step: float) -> Memory:
        """Memory of a batch at rest; `longest` [s] is the longest delay it must bridge, `step` [s] the grid."""
        return {}

    def remembers(self, values: Values) -> float:
        """How long [s] a command matters after it was given."""
        return 0.0

    def finer(self, memory: Memory, times: int) -> Memory:
        """The memory for a grid that is so many times finer from here on."""
        return memory

    def actuate(
        self, commands: FloatArray, values: Values, memory: Memory, step: FloatArray, t: FloatArray
    ) -> FloatArray:
        """(B, K) what the simulator gets during K substeps of `step` (B, K) s, a mean over each.

        commands: (B, K), held over each substep; values: (B, 1) each; t: (B, K) s, when the substeps begin on the
        recording's clock. memory is left as it is after the last one.
        """
        law = type(self).law
        assert law is not None, f"{self.family} has neither a law nor `actuate`"
        return np.asarray(law(commands, *self.taken(values)))

    def pieces(
        self, commands: FloatArray, values: Values, memory: Memory, step: FloatArray, t: FloatArray
    ) -> tuple[FloatArray, FloatArray] | None:
        """What `actuate` takes the mean of, where a substep holds more than one command; in the place of `actuate`.

        (B, K, P) commands in the order of time, and which shares of the substep (B, K, P) they last. What follows on
        the way to the simulator needs them: a dead zone of a mean is not the mean of a dead zone.
        """
        return None


class DriveEffect(Effect):
    """What a drive gives of the command that reached it, at the speed of the coordinate that it drives.

    It acts behind all actuators of its action. A `law` is of (command, speed).
    """

    site: ClassVar[Site] = "actuator"
    function_of: ClassVar[FunctionOf] = "nothing"
    gated: ClassVar[bool] = False

    def places(self, simulator: Simulator) -> tuple[str, ...]:
        """Every action that drives a coordinate."""
        return tuple(simulator.driven())

    def delivered(self, command: FloatArray, speed: FloatArray, values: Values) -> FloatArray:
        """(B,) what it gives."""
        law = type(self).law
        assert law is not None, f"{self.family} has neither a law nor `delivered`"
        return np.asarray(law(command, speed, *self.taken(values)))


class ElasticDrive(DriveEffect):
    """A drive with a spring and a motor behind it, two hidden numbers a row (see `gpsim.effects.elastic`).

    The stretch before a simulation begins says how far it is twisted: where a body stood still it is not.
    """


class ParameterEffect(Effect):
    """A parameter of the simulator that is not what was believed."""

    site: ClassVar[Site] = "parameter"

    def places(self, simulator: Simulator) -> tuple[str, ...]:
        """Every parameter."""
        return tuple(simulator.parameters)

    @abstractmethod
    def corrected(self, believed: FloatArray, values: Values) -> FloatArray:
        """(B,) the parameter's value."""


class ModelEffect(Effect):
    """A change of a model that is none of its declared parameters: the simulator itself knows how to make it."""

    site: ClassVar[Site] = "parameter"

    def places(self, simulator: Simulator) -> tuple[str, ...]:
        """Where the simulator says that it can."""
        return tuple(simulator.model_places.get(self.family, ()))


class VehicleEffect(Effect):
    """What becomes of a vehicle's twist (v, v_lateral, w); `changes` names the one of them that it changes.

    A `law` is of (v, v_lateral, w) and returns all three.
    """

    site: ClassVar[Site] = "vehicle"
    changes: ClassVar[str] = "w"

    def places(self, simulator: Simulator) -> tuple[str, ...]:
        """Simulators whose rates are a twist."""
        return ("vehicle",) if set(VEHICLE) <= set(simulator.rate.names) else ()

    def twist(
        self, v: FloatArray, lateral: FloatArray, w: FloatArray, values: Values
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The twist that the vehicle makes of it."""
        law = type(self).law
        assert law is not None, f"{self.family} has neither a law nor `twist`"
        first, second, third = (np.asarray(part) for part in law(v, lateral, w, *self.taken(values)))
        return first, second, third


class RateEffect(Effect):
    """What is added to the rates: of a measured curve, or of a state of the first order."""

    site: ClassVar[Site] = "rate"
    function_of: ClassVar[FunctionOf] = "nothing"

    def places(self, simulator: Simulator) -> tuple[str, ...]:
        """Every rate."""
        return simulator.rate.names

    @abstractmethod
    def added(
        self,
        simulator: Simulator,
        state: FloatArray,
        action: FloatArray,
        parameters: Mapping[str, float | FloatArray],
        values: Values,
        on: str,
    ) -> FloatArray:
        """(B, R) what comes to the rates in state (B, S) under the command (B, A) that reached the simulator."""


class SensorEffect(Effect):
    """What a sensor makes of the true state. A `law` is of (reading), and has no memory."""

    site: ClassVar[Site] = "sensor"
    gated: ClassVar[bool] = False

    def places(self, simulator: Simulator) -> tuple[str, ...]:
        """Every measured channel."""
        return tuple(n for n in simulator.state.names if n not in simulator.as_measured)

    def reach(self, values: Values) -> float:
        """How far back [s] it looks."""
        return 0.0

    def begin(
        self,
        history: FloatArray,
        column: int,
        values: Values,
        step: FloatArray,
        steps: FloatArray | None = None,
    ) -> tuple[Memory, FloatArray]:
        """Memory of a batch with the states of the last substeps (B, K, S), the newest last, and what it makes of them.

        The latter is what a sensor that remembers and acts later sees. step: (B,) s, of a substep; steps: (B, K) s, how
        long after the one before each state is, where the clock is uneven.
        """
        return {}, history

    def watch(
        self, state: FloatArray, column: int, values: Values, memory: Memory, step: FloatArray
    ) -> FloatArray:
        """Called once a substep of `step` (B,) s with the state (B, S) at its end; what a later sensor sees of it."""
        return state

    def measure(
        self, measured: FloatArray, columns: tuple[int, ...], values: Values, memory: Memory, step: FloatArray
    ) -> FloatArray:
        """(B, S): what is read when `measured` (B, S) is what the sensors before this one say."""
        law = type(self).law
        assert law is not None, f"{self.family} has neither a law nor `measure`"
        (column,) = columns
        return changed(measured, column, np.asarray(law(measured[:, column], *self.taken(values))))


class PoseEffect(SensorEffect):
    """A sensor effect on the whole pose (x, y, yaw)."""

    def places(self, simulator: Simulator) -> tuple[str, ...]:
        """Simulators whose state holds a pose."""
        return ("pose",) if set(POSE) <= set(simulator.state.names) else ()


def columns_of(effect: SensorEffect, on: str, simulator: Simulator) -> tuple[int, ...]:
    """The state columns that a sensor effect's place names; a channel, too, may be called `pose`."""
    names = POSE if isinstance(effect, PoseEffect) else (on,)
    return tuple(simulator.state.index(name) for name in names)


def changed(measured: FloatArray, column: int, values: FloatArray) -> FloatArray:
    """A copy with one column replaced."""
    out = np.array(measured)
    out[:, column] = values
    return out
