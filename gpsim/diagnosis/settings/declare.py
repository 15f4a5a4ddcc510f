"""Declaring a setting: its default with unit, meaning and origin beside it, which the reference page is made of."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from typing import Any, TypeVar

Value = TypeVar("Value")

BY_HAND = "by hand, on tuning worlds; other values were not searched"
"""Origin of what nobody has varied systematically."""


def setting(default: Value, unit: str, meaning: str, origin: str = BY_HAND, *, least: float = 0.0) -> Value:
    """A field of a frozen dataclass of settings.

    unit: "1" of a pure number; meaning: what it decides, in a line; origin: where the default comes from: a figure of a
    tuning run, a paper, or BY_HAND; least: the smallest value, of a tuple's every one, with which the step can work.
    """
    return dataclasses.field(
        default=default, metadata={"unit": unit, "meaning": meaning, "origin": origin, "least": least}
    )


def too_small(step: Any) -> Iterator[tuple[str, Any, float]]:
    """(name, value, the least that it may be) of every setting of a step that is too small, or no number."""
    for f in dataclasses.fields(step):
        value, least = getattr(step, f.name), f.metadata["least"]
        for one in value if isinstance(value, tuple) else (value,):
            if isinstance(one, int | float) and not one >= least:
                yield f.name, one, least


def described(step: Any) -> list[tuple[str, Any, str, str, str]]:
    """(name, default, unit, meaning, origin) of every setting of a step, in the order of their declaration."""
    return [
        (f.name, getattr(step, f.name), f.metadata["unit"], f.metadata["meaning"], f.metadata["origin"])
        for f in dataclasses.fields(step)
    ]


def check(step: Any, *, lists: Sequence[str] = (), shares: Sequence[str] = ()) -> None:
    """Raise ValueError where one of the named lists is empty, or one of the named shares is more than 1."""
    for name in lists:
        if not getattr(step, name):
            raise ValueError(f"{name} is empty")
    for name in shares:
        if getattr(step, name) > 1.0:
            raise ValueError(f"{name} is a share of at most 1, got {getattr(step, name)!r}")
