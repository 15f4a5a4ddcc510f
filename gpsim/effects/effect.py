"""What an effect is: one named physical term, where it acts, its parameters, and its law.

A law is one function, `law(inputs, what it remembers, values)`, of NumPy's elementwise operations. What it looks at it
says by the names of its arguments: those that its site knows (`Effect.inputs`), what it remembers (`Effect.memory`),
and values of its parameters, with a default where one may be missing. From that function come batches, (B,) arrays one
entry a row, and compiled code, element by element (see `gpsim.kernels.laws`).
"""

from __future__ import annotations

import inspect
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
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
Each = Any
"""What a law is given and gives: an array of a batch, or a number of one row in compiled code."""
VEHICLE = ("v", "v_lateral", "w")
POSE = ("x", "y", "yaw")


@cache
def arguments(law: Law) -> Mapping[str, float | None]:
    """What a law takes, in order, and what each is where it is missing; None: it must be there."""
    taken = inspect.signature(law).parameters.values()
    return {p.name: None if p.default is p.empty else float(p.default) for p in taken}


class Effect(ABC):
    """One family. Subclasses choose a site's base class and write the law.

    What a search or a plant has to know of a family beside its law, the family says in class attributes, so that nobody
    has to know it by name: what its law is a `function_of` (every family must say it), whether it `drifts`, and which
    family it is a patch of (`patch_of`). Its docstring says the law in the first paragraph, the source in the second.
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
    # What a person would say of it: {on} and the names of its parameters are filled in.
    sentence: ClassVar[str] = ""
    inputs: ClassVar[tuple[str, ...]] = ()  # what its site knows, by the names that laws have for it
    memory: ClassVar[tuple[str, ...]] = ()  # what its law remembers: it takes these, and gives them anew
    law: ClassVar[Law | None] = None
    laws: ClassVar[Mapping[str, str]] = {}  # value -> the name of the law of a term that has it
    # Of families with hidden states, whose laws `gpsim.effects.bristles` and `elastic` are: the values, in order.
    takes: ClassVar[Mapping[str, float]] = {}

    def law_of(self, values: Mapping[str, Any]) -> Law:
        """The law of a term with such values."""
        name = next((law for value, law in self.laws.items() if value in values), "law")
        law: Law | None = getattr(type(self), name)
        assert law is not None, f"{self.family} has no law"
        return law

    def ask(self, values: Values, **known: Any) -> Any:
        """What its law makes of what is known, the inputs of its site and what it remembers."""
        law = self.law_of(values)
        given = (
            known[name] if name in known else values[name] if other is None else values.get(name, other)
            for name, other in arguments(law).items()
        )  # fmt: skip
        return law(*given)

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


def declared(effect: Effect, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
    """What has to be known of an effect at a place, with the sizes that are usual there."""
    return tuple(
        replace(p, plausible=effect.plausible[p.name].at(place)) if p.name in effect.plausible else p
        for p in effect.parameters(place, variant)
    )


class ForceEffect(Effect):
    """A generalised force on a coordinate: its law is of position `q` and `speed`.

    Where it is `dry`, its law is the most that friction can resist with, of the `load`, too: the normal force where the
    simulator knows it, or, where it is `loaded_by_command`, the size of what drives the coordinate.
    """

    site: ClassVar[Site] = "force"
    inputs: ClassVar[tuple[str, ...]] = ("q", "speed", "load")
    dry: ClassVar[bool] = False  # can it hold a body at rest?
    loaded_by_command: ClassVar[bool] = False

    def places(self, simulator: Simulator) -> tuple[str, ...]:
        """Every coordinate, and where the simulator says; those known to be driven, where that is the load."""
        if self.loaded_by_command:
            return (*simulator.driven().values(), *simulator.served)
        every = tuple(coordinate.name for coordinate in simulator.coordinates)
        return (*every, *simulator.model_places.get(self.family, ()))

    def force(self, position: FloatArray, speed: FloatArray, values: Values) -> FloatArray | None:
        """(B,) the smooth force on the coordinate; None when there is none."""
        if self.dry:
            return None
        return _as_many(self.ask(values, q=position, speed=speed), speed)

    def friction_limit(
        self, position: FloatArray, speed: FloatArray, values: Values, load: FloatArray | None
    ) -> FloatArray | None:
        """(B,) the largest dry friction force, which opposes motion and holds a body at rest; None when there is none.

        load: (B,) the normal force where the simulator knows it, or the command's size.
        """
        if not self.dry or type(self).law is None or (load is None and self.weighs(values)):
            return None
        return _as_many(self.ask(values, q=position, speed=speed, load=load), speed)

    def weighs(self, values: Mapping[str, Any]) -> bool:
        """Whether its grip depends on the normal force."""
        if not self.dry or self.loaded_by_command or type(self).law is None:
            return False
        return "load" in arguments(self.law_of(values))


def _as_many(said: Each, rows: FloatArray) -> FloatArray:
    """What a law says, with an entry a row where it looks at none of them."""
    out = np.asarray(said)
    return (
        out
        if out.shape == np.shape(rows)
        else np.broadcast_to(out, np.broadcast_shapes(out.shape, rows.shape))
    )


class BristleEffect(ForceEffect):
    """Friction with one hidden number a row, how far bristles are bent (see `gpsim.effects.bristles`).

    The stretch before a simulation begins says how far: where a body stood still they are not bent. It can hold a body,
    which creeps.
    """

    function_of: ClassVar[FunctionOf] = "nothing"
    gated: ClassVar[bool] = False
    dry: ClassVar[bool] = True


class ActuatorEffect(Effect):
    """What happens to a command on its way to the simulator: its law is of the command `u`, held for `step` s from `t`.

    `t` [s] is on the recording's clock. What it gives is a mean over that time, then what it remembers at its end;
    that is 0 at rest.
    """

    site: ClassVar[Site] = "actuator"
    inputs: ClassVar[tuple[str, ...]] = ("u", "step", "t")
    needs: ClassVar[Needs] = "change"  # of the command, to show at all
    holds: ClassVar[bool] = True  # is what it makes of held commands held? (else it changes within a substep)

    def places(self, simulator: Simulator) -> tuple[str, ...]:
        """Every action."""
        return simulator.action.names

    def begin(self, count: int, longest: float, step: float) -> Memory:
        """Memory of a batch at rest; `longest` [s] is the longest delay it must bridge, `step` [s] the grid."""
        return {name: np.zeros(count) for name in self.memory}

    def remembers(self, values: Values) -> float:
        """How long [s] a command matters after it was given: for ever, where what is not followed stays."""
        return np.inf if self.memory else 0.0

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
        if not self.memory:
            return np.asarray(self.ask(values, u=commands, step=step, t=t))
        row = {name: value[:, 0] for name, value in values.items()}
        kept, out = [memory[name] for name in self.memory], np.empty(commands.shape[::-1])
        by_time = (np.ascontiguousarray(a.T) for a in (commands, step, t))
        for now, u, h, begin in zip(out, *by_time, strict=True):
            now[:], *kept = self.ask(row, u=u, step=h, t=begin, **dict(zip(self.memory, kept, strict=True)))
        for name, last in zip(self.memory, kept, strict=True):
            memory[name][:] = last
        return np.ascontiguousarray(out.T)

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

    It acts behind all actuators of its action. Its law is of command `u` and `speed`.
    """

    site: ClassVar[Site] = "actuator"
    inputs: ClassVar[tuple[str, ...]] = ("u", "speed")
    function_of: ClassVar[FunctionOf] = "nothing"
    gated: ClassVar[bool] = False

    def places(self, simulator: Simulator) -> tuple[str, ...]:
        """Every action that drives a coordinate."""
        return tuple(simulator.driven())

    def delivered(self, command: FloatArray, speed: FloatArray, values: Values) -> FloatArray:
        """(B,) what it gives."""
        return np.asarray(self.ask(values, u=command, speed=speed))


class ElasticDrive(DriveEffect):
    """A drive with a spring and a motor behind it, two hidden numbers a row (see `gpsim.effects.elastic`).

    The stretch before a simulation begins says how far it is twisted: where a body stood still it is not.
    """


class ParameterEffect(Effect):
    """A parameter of the simulator that is not what was `believed`, which its law is of."""

    site: ClassVar[Site] = "parameter"
    inputs: ClassVar[tuple[str, ...]] = ("believed",)

    def places(self, simulator: Simulator) -> tuple[str, ...]:
        """Every parameter."""
        return tuple(simulator.parameters)

    def corrected(self, believed: FloatArray, values: Values) -> FloatArray:
        """(B,) the parameter's value."""
        return np.asarray(self.ask(values, believed=believed))


class ModelEffect(Effect):
    """A change of a model that is none of its declared parameters: the simulator itself knows how to make it."""

    site: ClassVar[Site] = "parameter"

    def places(self, simulator: Simulator) -> tuple[str, ...]:
        """Where the simulator says that it can."""
        return tuple(simulator.model_places.get(self.family, ()))


class VehicleEffect(Effect):
    """What becomes of a vehicle's twist: its law is of `v`, `lateral` and `w`, and gives all three.

    `changes` names the channel that it changes.
    """

    site: ClassVar[Site] = "vehicle"
    inputs: ClassVar[tuple[str, ...]] = ("v", "lateral", "w")
    changes: ClassVar[str] = "w"

    def places(self, simulator: Simulator) -> tuple[str, ...]:
        """Simulators whose rates are a twist."""
        return ("vehicle",) if set(VEHICLE) <= set(simulator.rate.names) else ()

    def twist(
        self, v: FloatArray, lateral: FloatArray, w: FloatArray, values: Values
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The twist that the vehicle makes of it."""
        first, second, third = map(np.asarray, self.ask(values, v=v, lateral=lateral, w=w))
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
        self, simulator: Simulator, state: FloatArray, action: FloatArray,
        parameters: Mapping[str, float | FloatArray], values: Values, on: str,
    ) -> FloatArray:  # fmt: skip
        """(B, R) what comes to the rates in state (B, S) under the command (B, A) that reached the simulator."""


class SensorEffect(Effect):
    """What a sensor makes of the true state: its law is of the `reading`.

    Of one that remembers, the law gives by how much the reading is behind after a substep of `step` s, then whatever
    else it remembers; `rest` gives the same where the reading has long gone along a straight line of a `slope`.
    """

    site: ClassVar[Site] = "sensor"
    inputs: ClassVar[tuple[str, ...]] = ("reading", "step", "slope")
    gated: ClassVar[bool] = False
    rest: ClassVar[Law | None] = None

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
        if not self.memory:
            return {}, history
        read, seen = history[:, :, column], np.array(history)
        lengths = [step if steps is None else steps[:, k] for k in range(history.shape[1])]
        slope = (
            (read[:, 1] - read[:, 0]) / np.maximum(lengths[1], 1e-12)
            if len(lengths) > 1
            else 0.0 * read[:, 0]
        )
        rest = type(self).rest
        assert rest is not None, f"{self.family} does not define its rest value"
        known = {"reading": read[:, 0], "slope": slope, **values}
        kept = rest(*(known[name] for name in arguments(rest)))
        memory = {name: np.array(value) for name, value in zip(self.memory, kept, strict=True)}
        seen[:, 0, column] -= memory[self.memory[0]]
        for k in range(1, len(lengths)):
            seen[:, k] = self.watch(history[:, k], column, values, memory, lengths[k])
        return memory, seen

    def watch(
        self, state: FloatArray, column: int, values: Values, memory: Memory, step: FloatArray
    ) -> FloatArray:
        """Called once a substep of `step` (B,) s with the state (B, S) at its end; what a later sensor sees of it."""
        if not self.memory:
            return state
        known = {name: memory[name] for name in self.memory}
        kept = self.ask(values, reading=state[:, column], step=step, **known)
        for name, value in zip(self.memory, kept, strict=True):
            memory[name][:] = value
        return changed(state, column, state[:, column] - memory[self.memory[0]])

    def measure(
        self, measured: FloatArray, columns: tuple[int, ...], values: Values, memory: Memory, step: FloatArray
    ) -> FloatArray:
        """(B, S): what is read when `measured` (B, S) is what the sensors before this one say."""
        (column,) = columns
        reading = measured[:, column]
        if self.memory:
            return changed(measured, column, reading - memory[self.memory[0]])
        return changed(measured, column, np.asarray(self.ask(values, reading=reading)))


class PoseEffect(SensorEffect):
    """A sensor effect on the whole pose: its law is of `x`, `y` and `yaw`, and gives all three."""

    inputs: ClassVar[tuple[str, ...]] = POSE

    def places(self, simulator: Simulator) -> tuple[str, ...]:
        """Simulators whose state holds a pose."""
        return ("pose",) if set(POSE) <= set(simulator.state.names) else ()

    def measure(
        self, measured: FloatArray, columns: tuple[int, ...], values: Values, memory: Memory, step: FloatArray
    ) -> FloatArray:
        """(B, S): the pose that is read."""
        out = np.array(measured)
        read = dict(zip(POSE, (measured[:, column] for column in columns), strict=True))
        for column, value in zip(columns, self.ask(values, **read), strict=True):
            out[:, column] = value
        return out


def columns_of(effect: SensorEffect, on: str, simulator: Simulator) -> tuple[int, ...]:
    """The state columns that a sensor effect's place names; a channel, too, may be called `pose`."""
    names = POSE if isinstance(effect, PoseEffect) else (on,)
    return tuple(simulator.state.index(name) for name in names)


def changed(measured: FloatArray, column: int, values: FloatArray) -> FloatArray:
    """A copy with one column replaced."""
    out = np.array(measured)
    out[:, column] = values
    return out
