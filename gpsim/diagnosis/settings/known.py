"""What the user knows: parameters, bounds, and which families are asked for. These are no thresholds."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import Any

from gpsim.errors import UsageError

Interval = tuple[float, float]
NAMES = ("only", "without", "require", "also", "usual", "unusual")


@dataclass(frozen=True)
class Known:
    """What the user knows, checked for form; for names see `setup.known`.

    fix: values of the simulator's parameters, in their units; bounds: of such a parameter, or `family.on.parameter`, in
    its unit; only, without, require, also, usual, unusual: `family` or `family on place`.
    """

    fix: Mapping[str, float] = field(default_factory=dict)
    bounds: Mapping[str, Interval] = field(default_factory=dict)
    only: tuple[str, ...] = ()
    without: tuple[str, ...] = ()
    require: tuple[str, ...] = ()
    also: tuple[str, ...] = ()
    usual: tuple[str, ...] = ()
    unusual: tuple[str, ...] = ()

    def __bool__(self) -> bool:
        return any(vars(self).values())

    def asks(self, claim: tuple[str, str], usual: bool = True) -> bool:
        """Whether a term (family, place) may be offered; usual: its family is, unless told otherwise."""
        named = _named(claim, (*self.only, *self.require, *self.also, *self.usual))
        wanted = named if self.only else (usual or named)
        fixed = claim[0] == "parameter_offset" and claim[1] in self.fix
        return wanted and not fixed and not _named(claim, self.without)

    def requires(self, claim: tuple[str, str]) -> bool:
        """Whether a term (family, place) has to be in the account."""
        return _named(claim, self.require)

    def usual_there(self, claim: tuple[str, str], otherwise: bool) -> bool:
        """Whether a law is usual on a machine of the kind, by the user's word, else as it is otherwise."""
        return (otherwise or _named(claim, self.usual)) and not _named(claim, self.unusual)

    def lacking(self, claims: Collection[tuple[str, str]]) -> tuple[str, ...]:
        """What is required and not among the claims."""
        return tuple(name for name in self.require if not any(_named(claim, (name,)) for claim in claims))

    def as_mapping(self) -> dict[str, Any]:
        """As the configuration holds it."""
        return {
            "fix": dict(self.fix),
            "bounds": {name: list(ends) for name, ends in self.bounds.items()},
            **{name: list(getattr(self, name)) for name in NAMES},
        }


NOTHING_KNOWN = Known()


def read_known(known: Any, families: Any) -> Known:
    """From the configuration's `known` and `families`; raises UsageError that names the key."""
    known = _table(known, "diagnose.known", ("fix", "bounds"))
    families = _table(families, "diagnose.families", NAMES)
    fix = _table(known.get("fix"), "diagnose.known.fix")
    bounds = _table(known.get("bounds"), "diagnose.known.bounds")
    return Known(
        {name: _number(value, f"diagnose.known.fix.{name}") for name, value in fix.items()},
        {name: _interval(ends, f"diagnose.known.bounds.{name}") for name, ends in bounds.items()},
        *(_names(families.get(name), f"diagnose.families.{name}") for name in NAMES),
    )


def _named(claim: tuple[str, str], names: Collection[str]) -> bool:
    family, on = claim
    return family in names or f"{family} on {on}" in names


def _table(value: Any, where: str, keys: Collection[str] = ()) -> Mapping[str, Any]:
    if value is None:
        return {}
    if not isinstance(value, Mapping):
        raise UsageError(f"{where}: expected names and values, as {{name: value}}, got {value!r}")
    strange = [str(key) for key in value if keys and key not in keys]
    if strange:
        raise UsageError(f"{where}: no setting '{strange[0]}'; there are: {', '.join(keys)}")
    return {str(key): item for key, item in value.items()}


def _number(value: Any, where: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise UsageError(f"{where}: expected a number, got {value!r}")
    return float(value)


def _interval(value: Any, where: str) -> Interval:
    if not isinstance(value, list | tuple) or len(value) != 2:
        raise UsageError(f"{where}: expected [low, high], got {value!r}")
    low, high = (_number(end, where) for end in value)
    if not low < high:
        raise UsageError(f"{where}: expected [low, high] with low < high, got [{low:g}, {high:g}]")
    return low, high


def _names(value: Any, where: str) -> tuple[str, ...]:
    if value is None:
        return ()
    if not isinstance(value, list | tuple) or not all(isinstance(name, str) for name in value):
        raise UsageError(f"{where}: expected a list, as [coulomb_friction, spring on x], got {value!r}")
    return tuple(" ".join(name.split()) for name in value)
