"""Declaring a setting: its default with unit, meaning and origin beside it, which the reference page is made of."""

from __future__ import annotations

import dataclasses
from typing import Any, TypeVar

from gpsim.errors import UsageError

Value = TypeVar("Value")

BY_HAND = "by hand, on tuning worlds; other values were not searched"
"""Origin of what nobody has varied systematically."""


def setting(default: Value, unit: str, meaning: str, origin: str = BY_HAND) -> Value:
    """A field of a frozen dataclass of settings.

    unit: "1" of a pure number; meaning: what it decides, in a line; origin: where the default comes from: a figure of a
    tuning run, a paper, or BY_HAND.
    """
    return dataclasses.field(default=default, metadata={"unit": unit, "meaning": meaning, "origin": origin})


def described(step: Any) -> list[tuple[str, Any, str, str, str]]:
    """(name, default, unit, meaning, origin) of every setting of a step, in the order of their declaration."""
    return [
        (f.name, getattr(step, f.name), f.metadata["unit"], f.metadata["meaning"], f.metadata["origin"])
        for f in dataclasses.fields(step)
    ]


def check_positive(step: Any, where: str) -> None:
    """Raise UsageError where a number was set that is not more than 0, or a list without any."""
    for f in dataclasses.fields(step):
        value = getattr(step, f.name)
        numbers = value if isinstance(value, tuple) else (value,)
        fine = len(numbers) > 0 and all(isinstance(n, str | bool) or n > 0 for n in numbers)
        if not fine and value != f.default:
            raise UsageError(f"{where}.{f.name}: expected more than 0, got {_written(value)}")


def _written(value: Any) -> str:
    return str(list(value)) if isinstance(value, tuple) else str(value)
