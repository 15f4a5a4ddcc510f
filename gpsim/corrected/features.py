"""Inputs of a Gaussian process: channels, or sign, sin and cos of a channel."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gpsim.channels import Channels, FloatArray, wrap_angle
from gpsim.errors import UsageError

_FUNCTIONS: dict[str, Callable[[FloatArray], FloatArray]] = {"sign": np.sign, "sin": np.sin, "cos": np.cos}
_TERM = re.compile(r"(?P<function>\w+)\((?P<of>\w+)\)|(?P<channel>\w+)")


@dataclass(frozen=True)
class Features:
    """Columns computed from the channels of state and action, as `x_dot` or `sign(x_dot)`.

    A smooth kernel rounds off a jump; the sign of a velocity as an input of its own lets it jump there. Channels that
    wrap are taken between -pi and pi, for their sign too: simulated angles run on, and recorded ones do not. wraps:
    column by column, whether its channel does; a fit and what predicts with it must have the same.
    """

    names: tuple[str, ...]
    columns: tuple[int, ...]
    functions: tuple[str | None, ...]
    wraps: tuple[bool, ...] = ()

    @classmethod
    def of(cls, names: Sequence[str], channels: Channels) -> Features:
        """Parse the names; raises UsageError with the channels and functions there are."""
        columns, functions = [], []
        for name in names:
            match = _TERM.fullmatch(name.replace(" ", ""))
            function = match["function"] if match else None
            if match is None or (function is not None and function not in _FUNCTIONS):
                raise UsageError(
                    f"gp.inputs: '{name}' is neither a channel nor one of sign, sin, cos of a channel"
                )
            columns.append(channels.index(match["of"] or match["channel"]))
            functions.append(function)
        if not columns:
            raise UsageError("gp.inputs is empty: name at least one channel")
        wraps = tuple(bool(channels.wraps[column]) for column in columns)
        return cls(tuple(names), tuple(columns), tuple(functions), wraps)

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
        for i, function in enumerate(self.functions):
            if self.wraps and self.wraps[i] and function in (None, "sign"):
                changes.append((i, wrap_angle))
            if function is not None:
                changes.append((i, _FUNCTIONS[function]))
        return changes
