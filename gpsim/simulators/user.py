"""A user's own system: a class of a few lines in a file of theirs, checked once at the door.

    class Tank:
        state = {"level": "m"}                                   # channel: unit
        action = {"pump": "V"}
        parameters = {"outflow": ("m^0.5/s", 0.1, 0.0, 10.0)}    # unit, default, low, high

        def rates(self, state, action, p):                       # d state / dt, one (B,) array a channel
            return {"level": action["pump"] - p["outflow"] * np.sqrt(state["level"])}

Optional: `wraps = ("yaw",)` names angles modulo 2 pi; `coordinates = {"q": "q_dot"}` says that q_dot is the velocity
of q: then `rates(self, state, action, p, forces)` returns q_dot's rate only and gets the generalised force on q as
forces["q"]; `force_units = {"q": "N"}`; `start = {"level": 0.2}` gives a guess for a state that nobody measured.
A class that derives from gpsim.simulators.Simulator is taken as it is. Neither may write to the arrays it is given.
"""

from __future__ import annotations

import copyreg
import inspect
import math
import multiprocessing
import sys
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from gpsim import supervision
from gpsim.channels import Channels, FloatArray, difference
from gpsim.errors import UsageError
from gpsim.simulators.calls import asked, guard, read_only, refuse_complex, said
from gpsim.simulators.first_contact import try_apart
from gpsim.simulators.simulator import (
    INTEGRATORS,
    Coordinate,
    Integrator,
    Parameter,
    Parameters,
    Simulator,
)
from gpsim.trust import check_file

GUARDED = ("rates", "derivative", "measured_rates", "mobility", "normal_force")
"""What a class that derives from Simulator may write; `integrate` and `step` ask these."""


def load_user_simulator(reference: str) -> Simulator:
    """The system FILE.py:ClassName; raises UsageError for every fault of the file, and where it is not trusted."""
    path = Path(reference.rpartition(":")[0])
    if path.suffix != ".py" or not path.is_file():
        raise UsageError(f"--simulator {reference}: no file {path}; give FILE.py:ClassName")
    try:
        content = path.read_bytes()
        source = content.decode("utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise UsageError(f"{path}: cannot be read: {said(error)}") from error
    check_file(reference, content)
    if multiprocessing.parent_process() is None:  # whoever started a worker has tried it
        try_apart(reference, source)
    return load_source(reference, source)


@lru_cache(maxsize=8)
def load_source(reference: str, source: str) -> Simulator:
    """The class as `source` has it: a file that changes meanwhile does not change what is under way."""
    file, _, name = reference.rpartition(":")
    module = module_of(Path(file), source, "system")
    found = getattr(module, name, None)
    if not isinstance(found, type):
        classes = [
            k for k, v in vars(module).items() if isinstance(v, type) and v.__module__ == module.__name__
        ]
        raise UsageError(f"{file}: no class '{name}'; it has: {', '.join(classes) or 'none'}")
    instance = asked(found, f"{name}()", reference, remedy="; it must be made without arguments")
    simulator = adapted(instance, reference)
    vars(simulator)["_source"] = source
    # Copies in other processes come from the source, which is no importable module.
    copyreg.pickle(type(simulator), lambda known: (load_source, (known.name, vars(known)["_source"])))
    return simulator


def adapted(instance: Any, reference: str) -> Simulator:
    """A user's object as a simulator called `reference`, tried once; raises UsageError."""
    if isinstance(instance, Simulator):
        simulator = instance
    else:
        simulator = asked(lambda: UserSimulator(instance, reference), "its declaration", reference)
    vars(simulator)["name"] = reference  # by that of a class it derives from, the built-in one would be found
    if simulator is instance:
        guard(simulator, GUARDED, reference)
    asked(lambda: _check_declaration(simulator, reference), "its declaration", reference)
    _try(simulator, reference)
    return simulator


class UserSimulator(Simulator):
    """The adapter from a user's plain class to a Simulator."""

    def __init__(self, system: Any, reference: str) -> None:
        state = _units(system, "state", reference)
        pairs = dict(getattr(system, "coordinates", {}))
        force_units = dict(getattr(system, "force_units", {}))
        wraps = getattr(system, "wraps", ())
        if isinstance(wraps, str):
            raise UsageError(f"{reference}: 'wraps' must be a list of channels, got the text {wraps!r}")
        self._system, self._reference = system, reference
        self.start: dict[str, float] = {k: float(v) for k, v in dict(getattr(system, "start", {})).items()}
        self.integrator = _integrator(system, reference)
        self.name = reference  # type: ignore[misc]  # a class constant of the built-in simulators
        self.state = Channels.of(state, wraps=tuple(wraps))  # type: ignore[misc]
        self.action = Channels.of(_units(system, "action", reference))  # type: ignore[misc]
        self.parameters = _parameters(system, reference)  # type: ignore[misc]
        for channel in (*pairs, *pairs.values(), *self.start, *wraps):
            if channel not in state:
                raise UsageError(
                    f"{reference}: '{channel}' is not among its state channels: {', '.join(state)}"
                )
        positions = set(pairs)
        self._rated = [name for name in state if name not in positions]
        self._names = set(self._rated)
        self.rate = Channels.of({_rate_name(n): f"{state[n]}/s" for n in self._rated})  # type: ignore[misc]
        self.coordinates = tuple(  # type: ignore[misc]
            Coordinate(q, v, _rate_name(v), str(force_units.get(q, f"force on {q}")))
            for q, v in pairs.items()
        )
        self._forced = [c.name for c in self.coordinates]
        self._pairs = [(self.state.index(q), self.state.index(v)) for q, v in pairs.items()]
        self._rows = [self.state.index(name) for name in self._rated]

    def rates(
        self, state: FloatArray, action: FloatArray, parameters: Parameters, forces: FloatArray | None = None
    ) -> FloatArray:
        """(B, R): what the user's `rates` returns, checked."""
        states = dict(zip(self.state.names, read_only(state).T, strict=True))
        actions = dict(zip(self.action.names, read_only(action).T, strict=True))
        arguments: list[Any] = [states, actions, read_only(parameters)]
        if self.coordinates:
            given = np.zeros((len(state), len(self.coordinates))) if forces is None else forces
            arguments.append(dict(zip(self._forced, read_only(given).T, strict=True)))
        answer = asked(lambda: self._system.rates(*arguments), "rates", self._reference)
        return self._checked(answer, len(state))

    def derivative(self, state: FloatArray, rates: FloatArray) -> FloatArray:
        """Rates where the user gives them, the velocity where a channel is a coordinate."""
        out = np.empty_like(state)
        out[:, self._rows] = rates
        for position, velocity in self._pairs:
            out[:, position] = state[:, velocity]
        return out

    def measured_rates(self, state: FloatArray, next_state: FloatArray, dt: FloatArray) -> FloatArray:
        """Differences over dt."""
        return difference(next_state, state, self.state)[:, self._rows] / dt[:, None]

    def _checked(self, answer: Any, rows: int) -> FloatArray:
        if not isinstance(answer, Mapping) or answer.keys() != self._names:
            got = ", ".join(map(str, answer)) if isinstance(answer, Mapping) else type(answer).__name__
            raise UsageError(
                f"{self._reference}: rates must return a dictionary with {', '.join(self._rated)}, got {got}"
            )
        out = np.empty((rows, len(self._rated)))
        for i, name in enumerate(self._rated):
            values = np.asarray(answer[name])
            if values.shape == (rows,) and values.dtype == float:
                out[:, i] = values
                continue
            refuse_complex(values, f"rates['{name}']", self._reference)
            if values.shape not in ((), (rows,)) or not np.issubdtype(values.dtype, np.number):
                raise UsageError(
                    f"{self._reference}: rates['{name}'] must be {rows} numbers, one per row of the batch, got shape "
                    f"{values.shape} of {values.dtype}"
                )
            out[:, i] = values
        return out


def module_of(path: Path, source: str, kind: str) -> ModuleType:
    """A user's file, run as a module of its own; raises UsageError if it cannot be. kind: what it is to hold."""
    module = ModuleType(f"user_{kind}_{path.stem}")
    module.__file__ = str(path)
    sys.modules[module.__name__] = module  # dataclasses look there
    supervision.calls(str(path))
    asked(
        lambda: exec(compile(source, str(path), "exec"), vars(module)),
        "its code",
        str(path),
        failed="cannot be loaded:",
    )
    return module


def _check_declaration(simulator: Simulator, reference: str) -> None:
    """What would fail late: two channels under one name, and defaults that lie outside their own bounds."""
    both = [name for name in simulator.action.names if name in simulator.state.names]
    if both:
        raise UsageError(f"{reference}: '{both[0]}' is both a state and an action; use different names")
    for name, p in simulator.parameters.items():
        if not (math.isfinite(p.default) and p.low <= p.default <= p.high):
            raise UsageError(
                f"{reference}: parameters['{name}'] needs numbers low <= default <= high, got default "
                f"{p.default:g}, low {p.low:g}, high {p.high:g}"
            )


def _try(simulator: Simulator, reference: str) -> None:
    """One evaluation at a plausible state: shapes and finite values, before any data are touched."""
    sizes = asked(lambda: (len(simulator.state), len(simulator.action)), "its declaration", reference)
    state, action = (np.full((3, size), 0.1) for size in sizes)
    with np.errstate(all="ignore"):
        rates = _tried_rates(simulator, reference, state, action)
        if not np.isfinite(rates).all():
            name = simulator.rate.names[int(np.argwhere(~np.isfinite(rates))[0, 1])]
            raise UsageError(f"{reference}: {name} is not finite at state and action 0.1; check its formula")
        _check_shape(simulator.derivative(state, rates), state.shape, "derivative", reference)
        _check_shape(
            simulator.measured_rates(state, state, np.ones(3)), rates.shape, "measured_rates", reference
        )
        for i, coordinate in enumerate(simulator.coordinates):
            column, push = simulator.rate.index(coordinate.rate), np.eye(len(simulator.coordinates))[[i] * 3]
            if (_tried_rates(simulator, reference, state, action, push)[:, column] == rates[:, column]).all():
                raise UsageError(
                    f"{reference}: a force on {coordinate.name} changes nothing; add forces['{coordinate.name}'] to "
                    "its acceleration in `rates`"
                )


def _tried_rates(
    simulator: Simulator, reference: str, state: FloatArray, action: FloatArray, *forces: FloatArray
) -> FloatArray:
    """(3, R): the rates at the default parameters, with or without forces on the coordinates."""
    defaults, count = asked(lambda: (simulator.defaults(), len(simulator.rate)), "its declaration", reference)
    rates = simulator.rates(state, action, defaults, *forces)
    _check_shape(rates, (3, count), "rates", reference)
    return rates


def _check_shape(answer: Any, expected: tuple[int, ...], what: str, reference: str) -> None:
    if not isinstance(answer, np.ndarray) or answer.shape != expected:
        raise UsageError(f"{reference}: {what} must have shape {expected}, got {np.shape(answer)}")


def _units(system: Any, attribute: str, reference: str) -> dict[str, str]:
    units = getattr(system, attribute, None)
    if not isinstance(units, Mapping) or not units or not all(isinstance(u, str) for u in units.values()):
        raise UsageError(f"{reference}: '{attribute}' must be a dictionary of channel: unit, got {units!r}")
    return {str(name): unit for name, unit in units.items()}


def _parameters(system: Any, reference: str) -> dict[str, Parameter]:
    declared = getattr(system, "parameters", {})
    try:
        out = {
            str(name): Parameter(str(unit), float(default), float(low), float(high), str(name))
            for name, (unit, default, low, high) in dict(declared).items()
        }
    except (TypeError, ValueError) as error:
        raise UsageError(f"{reference}: 'parameters' must be name: (unit, default, low, high)") from error
    if not callable(getattr(system, "rates", None)):
        raise UsageError(f"{reference}: it needs a method rates(self, state, action, p)")
    expected = 4 if getattr(system, "coordinates", {}) else 3
    if len(inspect.signature(system.rates).parameters) != expected:
        names = "state, action, p, forces" if expected == 4 else "state, action, p"
        raise UsageError(f"{reference}: rates must take ({names})")
    return out


def _integrator(system: Any, reference: str) -> Integrator:
    said = getattr(system, "integrator", "euler")
    found = next((name for name in INTEGRATORS if name == said), None)
    if found is None:
        raise UsageError(f"{reference}: 'integrator' must be one of {', '.join(INTEGRATORS)}, got {said!r}")
    return found


def _rate_name(channel: str) -> str:
    return f"{channel[:-4]}_acc" if channel.endswith("_dot") else f"{channel}_rate"
