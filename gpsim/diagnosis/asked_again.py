"""Answers that are kept: the same question about the same fit comes from several places in a row."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from functools import wraps
from typing import TypeVar

from gpsim.diagnosis.problem import Problem
from gpsim.diagnosis.shooting import Fit

Answer = TypeVar("Answer")
REMEMBERED = 6  # answers: a leader's is asked for again after a few rivals'


def kept(function: Callable[[Problem, Fit], Answer]) -> Callable[[Problem, Fit], Answer]:
    """The function with its last answers kept, for the very same problem and fit."""
    last: deque[tuple[Problem, Fit, Answer]] = deque(maxlen=REMEMBERED)

    @wraps(function)
    def asked(problem: Problem, at: Fit) -> Answer:
        for of, to, answer in last:
            if of is problem and to is at:
                return answer
        last.append((problem, at, function(problem, at)))
        return last[-1][2]

    return asked
