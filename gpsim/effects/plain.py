"""A user's effect: a class of a few lines, checked once at the door, and made a family like any other.

    class Cable:
        '''A dragged cable: it pulls back by its weight for every metre that is paid out.'''

        site = "force"
        parameters = {"weight": ("N/m", 0.0, 50.0, 1.0)}         # unit, low, high, where a fit starts

        def law(self, q, speed, weight):                         # (B,) arrays: one entry a row of the batch
            return -weight * q

Sites and what their law takes before the parameters: see `INPUTS`. Optional: `nothing = {"gain": 1.0}` is the value at
which it does nothing (0 unless said, inf of a limit); `on = ("q",)` names the only places; `memory = ("level",)` gives
an actuator's law arrays that begin at 0 and belong to each run, as `law(self, u, ..., memory, step)`; `of = "speed"`
says what the law is a function of, so that a free curve is held against it; `noun`, `sentence`, `source` are words.
A class that derives from one of `gpsim.effects` is taken as it is.
"""

from __future__ import annotations

import inspect
import math
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar, Literal, get_args

import numpy as np

from gpsim.channels import FloatArray
from gpsim.effects.effect import (
    ActuatorEffect,
    DriveEffect,
    Effect,
    ForceEffect,
    FunctionOf,
    ParameterEffect,
    SensorEffect,
    Values,
    VehicleEffect,
)
from gpsim.effects.place import EffectParameter, Place
from gpsim.errors import UsageError
from gpsim.simulators import Memory, Simulator, asked, read_only, refuse_complex

Site = Literal["force", "friction", "actuator", "drive", "parameter", "vehicle", "sensor"]
INPUTS: Mapping[str, tuple[str, ...]] = {
    "force": ("q", "speed"),
    "friction": ("q", "speed"),
    "actuator": ("u",),
    "drive": ("u", "speed"),
    "parameter": ("believed",),
    "vehicle": ("v", "lateral", "w"),
    "sensor": ("y",),
}
"""Site -> what its law takes first: a coordinate's position and speed; a command, at a drive the speed of what it
drives, too; a parameter as it is believed; a vehicle's speed, sideways speed and turn rate; what a sensor reads."""
RETURNS: Mapping[str, str] = {
    "force": "the force on the coordinate",
    "friction": "the most that dry friction can resist with, at least 0",
    "actuator": "what the simulator gets",
    "drive": "what the drive gives",
    "parameter": "the parameter's value",
    "vehicle": "v, lateral and w, three arrays",
    "sensor": "what is read",
}
BASES: Mapping[str, Any] = {
    "force": ForceEffect,
    "friction": ForceEffect,
    "actuator": ActuatorEffect,
    "drive": DriveEffect,
    "parameter": ParameterEffect,
    "vehicle": VehicleEffect,
    "sensor": SensorEffect,
}
STEPS = 0.05  # of a parameter's start: its typical size where that is 0 is this of its bounds
FORM = 'name: (unit, low, high, start), as {"weight": ("N/m", 0.0, 50.0, 1.0)}'


def adapted(instance: Any, reference: str) -> Effect:
    """A user's object as an effect; raises UsageError in one line that names what is at fault."""
    if isinstance(instance, Effect):
        for name in ("family", "function_of"):
            if not isinstance(getattr(instance, name, None), str):
                raise UsageError(f"{reference}: '{name}' must be said, as in a family of gpsim.effects")
        vars(instance)["asked"] = False  # nobody asks for it but who brought it
        return instance
    said = getattr(instance, "site", None)
    site: Site | None = next((one for one in get_args(Site) if one == said), None)
    if site is None:
        raise UsageError(f"{reference}: 'site' must be one of {', '.join(INPUTS)}, got {said!r}")
    plain = _Plain(instance, site, reference)
    _check_law(instance, site, reference)
    words = {name: str(getattr(instance, name, "")) for name in ("noun", "sentence", "source")}
    made: dict[str, Any] = {
        "__doc__": inspect.getdoc(instance) or "",
        "family": _family(instance, reference),
        "function_of": _function_of(instance, reference),
        "sentence": words["sentence"],
        "noun": words["noun"],
        "source": words["source"],
        "order": int(getattr(instance, "order", 50)),
        "gated": bool(getattr(instance, "gated", site not in ("drive", "sensor"))),
        "asked": False,
        "_plain": plain,
    }
    made |= _methods(site)
    made_class: Any = type(type(instance).__name__, (_Brought, BASES[site]), made)
    found: Effect = made_class()
    return found


class _Plain:
    """A user's object, and how its law is asked."""

    def __init__(self, instance: Any, site: Site, reference: str) -> None:
        self.instance, self.site, self.reference = instance, site, reference
        self.declared = _parameters(instance, reference)
        self.memory = tuple(getattr(instance, "memory", ()))
        on = getattr(instance, "on", ())
        self.on = (on,) if isinstance(on, str) else tuple(on)

    def __call__(self, inputs: Sequence[FloatArray], values: Values, **kept: Any) -> list[FloatArray]:
        """What the law says, an array of the inputs' shape each."""
        shape = np.broadcast_shapes(*(np.shape(a) for a in (*inputs, *values.values())))
        given = [*inputs, *(values[p.name] for p in self.declared)]
        flat = [read_only(np.broadcast_to(a, shape).reshape(-1)) for a in given]
        said = asked(lambda: self.instance.law(*flat, **kept), "law", self.reference)
        parts = said if self.site == "vehicle" else (said,)
        if self.site == "vehicle" and (not isinstance(said, tuple | list) or len(said) != 3):
            raise UsageError(f"{self.reference}: law must return v, lateral and w, got {type(said).__name__}")
        return [self._checked(part, shape) for part in parts]

    def _checked(self, part: Any, shape: tuple[int, ...]) -> FloatArray:
        try:
            array = np.asarray(part)
        except ValueError:
            array = np.asarray(None)
        refuse_complex(array, "law", self.reference)
        rows = math.prod(shape)
        if array.shape not in ((), (rows,)) or not (
            np.issubdtype(array.dtype, np.number) or array.dtype == np.bool_
        ):
            raise UsageError(
                f"{self.reference}: law must return {rows} numbers, one a row of the batch, got shape {array.shape} of "
                f"{array.dtype}"
            )
        return np.array(np.broadcast_to(array, (rows,)), dtype=np.float64).reshape(shape)


class _Brought(Effect):
    """What all users' families share."""

    source: ClassVar[str]
    _plain: ClassVar[_Plain]

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """As the user declares them."""
        return self._plain.declared

    def places(self, simulator: Simulator) -> tuple[str, ...]:
        """Where its site says; of those the ones that the user names."""
        every = super().places(simulator)  # type: ignore[safe-super]  # the site's class comes after this one
        return tuple(on for on in every if not self._plain.on or on in self._plain.on)


def _methods(site: Site) -> dict[str, Callable[..., Any]]:
    """How a family of each site asks its law."""

    def one(self: Any, *given: Any) -> FloatArray:
        *inputs, values = given
        return self._plain(inputs, values)[0]  # type: ignore[no-any-return]

    def grip(self: Any, position: FloatArray, speed: FloatArray, values: Values, load: Any) -> FloatArray:
        return np.maximum(self._plain((position, speed), values)[0], 0.0)  # type: ignore[no-any-return]

    def twist(self: Any, *given: Any) -> tuple[FloatArray, ...]:
        *inputs, values = given
        return tuple(self._plain(inputs, values))

    def begin(self: Any, count: int, longest: float, step: float) -> Memory:
        return {name: np.zeros(count) for name in self._plain.memory}

    def remembers(self: Any, values: Values) -> float:
        return np.inf if self._plain.memory else 0.0

    def actuate(
        self: Any, commands: FloatArray, values: Values, memory: Memory, step: FloatArray, t: FloatArray
    ) -> FloatArray:
        if not self._plain.memory:
            return self._plain((commands,), values)[0]  # type: ignore[no-any-return]
        out = np.empty_like(commands)
        row = {name: value[:, 0] if np.ndim(value) > 1 else value for name, value in values.items()}
        for k in range(commands.shape[1]):
            kept = {"memory": memory, "step": read_only(step[:, k])}
            out[:, k] = self._plain((commands[:, k],), row, **kept)[0]
        return out

    def measure(
        self: Any, measured: FloatArray, columns: tuple[int, ...], values: Values, memory: Memory, step: Any
    ) -> FloatArray:
        (column,) = columns
        out = np.array(measured)
        out[:, column] = self._plain((measured[:, column],), values)[0]
        return out

    actuator: dict[str, Callable[..., Any]] = {"actuate": actuate, "begin": begin, "remembers": remembers}
    methods: dict[str, dict[str, Callable[..., Any]]] = {
        "force": {"force": one},
        "friction": {"grip": grip},
        "actuator": actuator,
        "drive": {"delivered": one},
        "parameter": {"corrected": one},
        "vehicle": {"twist": twist},
        "sensor": {"measure": measure},
    }
    return methods[site]


def _family(instance: Any, reference: str) -> str:
    """Its name in diagnosis.json: `family`, or the class's name in lower case with underscores."""
    said = getattr(instance, "family", "") or re.sub(r"(?<!^)(?=[A-Z])", "_", type(instance).__name__).lower()
    if not isinstance(said, str) or not re.fullmatch(r"[a-z][a-z0-9_]*", said):
        raise UsageError(
            f"{reference}: 'family' must be a name of small letters, digits and underscores, got {said!r}"
        )
    return said


def _function_of(instance: Any, reference: str) -> FunctionOf:
    said = getattr(instance, "of", "nothing")
    found: FunctionOf | None = next((of for of in get_args(FunctionOf) if of == said), None)
    if found is None:
        raise UsageError(f"{reference}: 'of' must be one of {', '.join(get_args(FunctionOf))}, got {said!r}")
    return found


def _parameters(instance: Any, reference: str) -> tuple[EffectParameter, ...]:
    declared, nothing = getattr(instance, "parameters", None), dict(getattr(instance, "nothing", {}))
    if not isinstance(declared, Mapping) or not declared:
        raise UsageError(f"{reference}: 'parameters' must be {FORM}, got {declared!r}")
    return tuple(
        _parameter(str(n), said, float(nothing.get(n, 0.0)), reference) for n, said in declared.items()
    )


def _parameter(name: str, said: Any, none: float, reference: str) -> EffectParameter:
    try:
        unit, low, high, start = said
        starts = tuple(float(s) for s in (start if isinstance(start, list | tuple) else (start,)))
        low, high = float(low), float(high)
    except (TypeError, ValueError) as error:
        raise UsageError(f"{reference}: parameters['{name}'] must be {FORM}, got {said!r}") from error
    good = math.isfinite(low) and math.isfinite(high) and starts and all(low <= s <= high for s in starts)
    if not isinstance(unit, str) or not good or low >= high:
        raise UsageError(
            f"{reference}: parameters['{name}'] needs a unit and finite numbers low <= start <= high, got {said!r}"
        )
    limit = math.isinf(none)
    if not limit and not low <= none <= high:
        raise UsageError(
            f"{reference}: parameters['{name}'] does nothing at {none:g}, which is not between {low:g} and {high:g}: "
            "widen its bounds, or say where it does nothing in 'nothing' (inf of a limit)"
        )
    scale = max(abs(starts[0] - (0.0 if limit else none)), STEPS * (high - low))
    return EffectParameter(name, unit, low, high, starts, scale, 0.0 if limit else none, falls=limit)


def _check_law(instance: Any, site: Site, reference: str) -> None:
    law, declared = getattr(instance, "law", None), getattr(instance, "parameters", {})
    memory = tuple(getattr(instance, "memory", ()))
    if memory and site != "actuator":
        raise UsageError(f"{reference}: 'memory' is an actuator's; a law at the site {site} has none")
    expected = [*INPUTS[site], *map(str, declared), *(("memory", "step") if memory else ())]
    if not callable(law):
        raise UsageError(f"{reference}: it needs a method law(self, {', '.join(expected)})")
    taken = [p for p in inspect.signature(law).parameters.values() if p.kind is not p.VAR_KEYWORD]
    first = len(INPUTS[site])
    if len(taken) != len(expected) or [p.name for p in taken[first:]] != expected[first:]:
        raise UsageError(
            f"{reference}: law must take ({', '.join(expected)}), got ({', '.join(p.name for p in taken)})"
        )
