"""Answers that are kept: the same question about the same fit, or windows, comes from several places in a row."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from functools import wraps
from typing import Concatenate, ParamSpec, TypeVar

from gpsim.diagnosis.fitting.problem import Problem

At = TypeVar("At")
Answer = TypeVar("Answer")
More = ParamSpec("More")
Question = Callable[Concatenate[Problem, At, More], Answer]
REMEMBERED = 6  # answers: a leader's is asked for again after a few rivals'


def kept(function: Question[At, More, Answer]) -> Question[At, More, Answer]:
    """The function with its last answers kept, for the very same problem, subject and whatever else it was given."""
    last: deque[tuple[tuple[object, ...], Answer]] = deque(maxlen=REMEMBERED)

    @wraps(function)
    def asked(problem: Problem, at: At, /, *more: More.args, **named: More.kwargs) -> Answer:
        given = (problem, at, *more, *named.values())
        for before, answer in last:
            if len(before) == len(given) and all(x is y for x, y in zip(before, given, strict=True)):
                return answer
        last.append((given, function(problem, at, *more, **named)))
        return last[-1][1]

    return asked
