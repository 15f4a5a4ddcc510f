"""Answers that are kept: the same question about the same fit, or windows, comes from several places in a row."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from functools import wraps
from typing import Any, Concatenate, ParamSpec, Protocol, TypeVar

At = TypeVar("At")
Answer = TypeVar("Answer")
More = ParamSpec("More")


class Memo:
    """What a diagnosis was asked last and what the answers were, so many of them of each function."""

    def __init__(self, remembered: int) -> None:
        self._remembered = remembered
        self._last: dict[Callable[..., Any], deque[tuple[tuple[object, ...], Any]]] = {}

    def answer(self, function: Callable[..., Answer], given: tuple[object, ...]) -> Answer:
        """What the function makes of the very same objects, asked once."""
        last = self._last.setdefault(function, deque(maxlen=self._remembered))
        for before, answer in last:
            if len(before) == len(given) and all(x is y for x, y in zip(before, given, strict=True)):
                return answer  # type: ignore[no-any-return]
        last.append((given, function(*given)))
        return last[-1][1]  # type: ignore[no-any-return]


class _Run(Protocol):
    @property
    def memo(self) -> Memo: ...


class _Asked(Protocol):
    @property
    def run(self) -> _Run: ...


Subject = TypeVar("Subject", bound=_Asked)


def kept(
    function: Callable[Concatenate[Subject, At, More], Answer],
) -> Callable[Concatenate[Subject, At, More], Answer]:
    """The function with its last answers kept by the run of its problem, for the very same arguments."""

    @wraps(function)
    def asked(problem: Subject, at: At, /, *more: More.args, **named: More.kwargs) -> Answer:
        return problem.run.memo.answer(function, (problem, at, *more, *named.values()))

    return asked
