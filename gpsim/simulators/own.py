"""A system of the user's own that no file holds: a class, an object or a function of the program that runs.

It is known to this process alone: a spawned worker could not import it, and a folder on disk cannot name it. So its
name ends with brackets, which neither a registered simulator's nor FILE.py:ClassName does.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from gpsim.errors import UsageError
from gpsim.simulators.simulator import Simulator
from gpsim.simulators.user import adapted

HERE = "()"
"""The end of a name that means nothing outside of this process."""

MAPPINGS = {
    "state": '{"q": "m"}',
    "action": '{"force": "N"}',
    "parameters": '{"mass": ("kg", 1.0, 0.1, 10.0)}',
    "coordinates": '{"q": "q_dot"}',
    "force_units": '{"q": "N"}',
    "start": '{"q_dot": 0.0}',
}
"""What is declared as a mapping, and how."""


class RatesFunction:
    """A function rates(state, action, parameters[, forces]) with what it does not say itself, as a plain class.

    Of three arguments only, what acts on a coordinate is an acceleration of that coordinate alone.
    """

    def __init__(self, function: Callable[..., Any], declared: Mapping[str, Any], arguments: int) -> None:
        vars(self).update(declared)
        self._function = function
        pairs: Mapping[str, str] = declared.get("coordinates", {})
        self._velocities = {} if arguments == 4 else pairs
        if self._velocities and "force_units" not in declared:
            self.force_units = {q: _per_second(str(declared["state"].get(v))) for q, v in pairs.items()}
        # The adapter counts the arguments of `rates`: four where there are coordinates.
        self.rates: Callable[..., Any] = self._with_forces if pairs else function

    def _with_forces(self, state: Any, action: Any, parameters: Any, forces: Any) -> Any:
        if not self._velocities:
            return self._function(state, action, parameters, forces)
        rates = self._function(state, action, parameters)
        if not isinstance(rates, Mapping):
            return rates  # which is refused
        pushed = {v: rates[v] + forces[q] for q, v in self._velocities.items() if v in rates}
        return {**rates, **pushed}


def own_simulator(what: Any, declared: Mapping[str, Any]) -> Simulator:
    """A class, an object or a function as a simulator; raises UsageError.

    declared: of a function only: `state`, `action`, `parameters`, `coordinates`, `force_units`, `wraps`, `start`,
    `integrator`, as a class in a file would have them.
    """
    if isinstance(what, type) or hasattr(what, "rates"):
        name = f"{what.__name__ if isinstance(what, type) else type(what).__name__}{HERE}"
        if declared:
            raise UsageError(
                f"load_simulator: {', '.join(declared)}: only for a function; {name} already has these as attributes"
            )
        return adapted(_made(what, name) if isinstance(what, type) else what, name)
    if not callable(what):
        raise UsageError(
            "load_simulator: expected a name, FILE.py:ClassName, a class with `rates`, or a function rates(state, "
            f"action, parameters), got {type(what).__name__}"
        )
    name = f"{getattr(what, '__name__', type(what).__name__)}{HERE}"
    lacking = [key for key in ("state", "action") if key not in declared]
    if lacking:
        raise UsageError(
            f"load_simulator: {name} needs {' and '.join(lacking)}, channel: unit, as "
            'state={"q": "m", "q_dot": "m/s"}'
        )
    for key, value in declared.items():
        if key in MAPPINGS and not isinstance(value, Mapping):
            raise UsageError(f"load_simulator: {key}: expected a mapping, as {MAPPINGS[key]}, got {value!r}")
    return adapted(RatesFunction(what, declared, _arguments(what, name, declared)), name)


def lives_here(name: str) -> bool:
    """Whether a simulator of this name is known to this process alone."""
    return name.endswith(HERE)


def _made(cls: type[Any], name: str) -> Any:
    try:
        return cls()
    except Exception as error:  # a user's code may raise anything
        raise UsageError(
            f"load_simulator: {name} raised {type(error).__name__}: {' '.join(str(error).split())[:160]}; it must be "
            "made without arguments"
        ) from error


def _arguments(function: Callable[..., Any], name: str, declared: Mapping[str, Any]) -> int:
    """How many arguments a function takes: three, or four where there are coordinates."""
    try:
        count = len(inspect.signature(function).parameters)
    except (TypeError, ValueError):  # of what is written in C nobody knows
        count = 3
    allowed: Sequence[int] = (3, 4) if declared.get("coordinates") else (3,)
    if count not in allowed:
        more = " or (state, action, parameters, forces)" if 4 in allowed else ""
        why = "" if 4 in allowed or count != 4 else "; forces need coordinates={position: velocity}"
        raise UsageError(
            f"load_simulator: {name} must take (state, action, parameters){more}, it takes {count}{why}"
        )
    return count


def _per_second(unit: str) -> str:
    """The unit of what changes a velocity in this unit."""
    return f"{unit}^2" if unit.endswith("/s") else f"{unit}/s"
