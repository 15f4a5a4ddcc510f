"""Inputs of a Gaussian process: channels, or sign, sin and cos of a channel."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gpsim.channels import Channels, FloatArray, wrap_angle
from gpsim.errors import UsageError

_FUNCTIONS: dict[str, Callable[[FloatArray], FloatArray]] = {"sign": np.sign, "sin": np.sin, "cos": np.cos}
_CALL = re.compile(rf"({'|'.join(_FUNCTIONS)})\s*\((.*)\)", re.DOTALL)
_WORD = re.compile(r"\w+")


@dataclass(frozen=True)
class Feature:
    """One input: a channel, whatever it is called, or a function of it."""

    channel: str
    function: str | None = None

    def __post_init__(self) -> None:
        if self.function is not None and self.function not in _FUNCTIONS:
            raise UsageError(f"'{self.function}' is not one of {', '.join(_FUNCTIONS)}")

    @classmethod
    def parse(cls, text: str, channels: Channels) -> Feature:
        """What a person wrote as an input: a channel's name, else `sign(NAME)`, `sin(NAME)` or `cos(NAME)`.

        A channel of exactly that name comes first, then one without the spaces around it. Raises UsageError with the
        channels and functions there are.
        """
        call = _CALL.fullmatch(text.strip())
        written = [(text, None), *([(call[2], call[1])] if call else [])]
        for name, function in written:
            for spelled in (name, name.strip()):
                if spelled in channels.names:
                    return cls(spelled, function)
        for name, _ in written:
            if _WORD.fullmatch(name.strip()):  # well written: it is the channel that is not there
                channels.index(name.strip())
        raise UsageError(
            f"gp.inputs: '{text}' is neither a channel nor one of {', '.join(_FUNCTIONS)} of a channel; "
            f"channels: {', '.join(channels.names)}"
        )

    @property
    def text(self) -> str:
        """As a person would write it."""
        return self.channel if self.function is None else f"{self.function}({self.channel})"

    def to_json(self) -> dict[str, str | None]:
        """Plain data: whatever its channel is called, it is read back as the same."""
        return {"channel": self.channel, "function": self.function}

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Feature:
        """The inverse of `to_json`; raises UsageError."""
        try:
            function = data["function"]
            return cls(str(data["channel"]), None if function is None else str(function))
        except (KeyError, TypeError) as error:
            raise UsageError(f"an input needs channel and function, got {data!r}") from error


@dataclass(frozen=True)
class Features:
    """Columns computed from the channels of state and action, as `x_dot` or `sign(x_dot)`.

    A smooth kernel rounds off a jump; the sign of a velocity as an input of its own lets it jump there. Channels that
    wrap are taken between -pi and pi, for their sign too: simulated angles run on, and recorded ones do not. wraps:
    column by column, whether its channel does; a fit and what predicts with it must have the same.
    """

    items: tuple[Feature, ...]
    columns: tuple[int, ...]
    wraps: tuple[bool, ...] = ()

    @classmethod
    def of(cls, inputs: Sequence[Feature | str], channels: Channels) -> Features:
        """Of these channels; a text is what a person wrote (`Feature.parse`). Raises UsageError."""
        items = tuple(i if isinstance(i, Feature) else Feature.parse(i, channels) for i in inputs)
        if not items:
            raise UsageError("gp.inputs is empty: name at least one channel")
        columns = tuple(channels.index(item.channel) for item in items)
        return cls(items, columns, tuple(bool(channels.wraps[column]) for column in columns))

    @property
    def names(self) -> tuple[str, ...]:
        """The inputs as a person would write them."""
        return tuple(item.text for item in self.items)

    def __call__(self, values: FloatArray) -> FloatArray:
        """(B, S + A) state and action -> (B, D)."""
        out = values.take(self._places, axis=1)
        for i, function in self._changes:
            out[:, i] = function(out[:, i])
        return out

    @cached_property
    def _places(self) -> NDArray[np.intp]:
        return np.array(self.columns, dtype=np.intp)

    @cached_property
    def _changes(self) -> list[tuple[int, Callable[[FloatArray], FloatArray]]]:
        """Which columns are not the channel itself, and what is made of it: worked out once for all steps."""
        changes: list[tuple[int, Callable[[FloatArray], FloatArray]]] = []
        for i, function in enumerate(item.function for item in self.items):
            if self.wraps and self.wraps[i] and function in (None, "sign"):
                changes.append((i, wrap_angle))
            if function is not None:
                changes.append((i, _FUNCTIONS[function]))
        return changes
