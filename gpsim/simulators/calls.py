"""Calls of a user's code: whatever it does, somebody is told in one line, and what it is given stays as it is."""

from __future__ import annotations

import mmap
import os
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

import numpy as np

from gpsim.errors import Terminated, UsageError
from gpsim.simulators.patience import SETTING, WATCH, TooLongError, longest_call

Answer = TypeVar("Answer")
_COPIES = mmap.mmap(-1, 1)
"""Shared with copies of this process: whether one has come back from a call."""
_copied = 0  # how often this process is a copy of the one that loaded gpsim
COPY_FIRST = (
    "; its inputs belong to the recording: copy first (u = u.copy()), or write u = gain * u, not u *= gain"
)


class NoAnswerError(UsageError):
    """A call that does not return."""


def asked(
    function: Callable[[], Answer], what: str, reference: str, failed: str = "raised", remedy: str = ""
) -> Answer:
    """What a user's code answers; every exception of its, and an answer that does not come, is a UsageError.

    what, failed, remedy: the message says `reference: what failed EXCEPTION remedy`.

    A copy of this process that the code made (os.fork) ends as soon as it comes back here, where it would do all the
    rest once more; the next call is refused.
    """
    before = _copied
    try:
        with WATCH:
            answer = function()
    except TooLongError:
        raise NoAnswerError(no_answer(f"{reference}: {what}")) from None
    except (UsageError, Terminated, KeyboardInterrupt):
        raise
    except BaseException as error:  # a user's code may raise anything
        if isinstance(error, ValueError) and "read-only" in str(error):
            remedy = COPY_FIRST
        raise UsageError(f"{reference}: {what} {failed} {said(error)}{remedy}") from error
    finally:
        if _copied != before:
            _COPIES[0] = 1
            os._exit(0)
    if _COPIES[0]:
        _COPIES[0] = 0
        raise UsageError(f"{reference}: {what} returned in a copied process (os.fork); remove that call")
    return answer


def _copy() -> None:
    global _copied
    _copied += 1


os.register_at_fork(after_in_child=_copy)


def no_answer(what: str) -> str:
    """The line about a call that does not return."""
    return f"{what} did not return within {longest_call():g} s; correct it, or set {SETTING}=600 (s)"


def said(error: BaseException) -> str:
    """An exception in one line."""
    return f"{type(error).__name__}: {' '.join(str(error).split())[:160]}"


def read_only(value: Any) -> Any:
    """A view that nobody can write through: what a user's code changes in place may be the recording itself.

    Of a mapping, as parameters are, a copy with such values.
    """
    if isinstance(value, Mapping):
        return {key: read_only(item) for key, item in value.items()}
    if not isinstance(value, np.ndarray):
        return value
    view = value.view()
    view.flags.writeable = False
    return view


def guard(instance: Any, methods: tuple[str, ...], reference: str) -> None:
    """Ask these methods of an object as `asked` does, with arguments that are read only."""
    for name in methods:
        vars(instance)[name] = _guarded(getattr(instance, name), name, reference)


def refuse_complex(values: Any, what: str, reference: str) -> None:
    """The search would take the real part and say nothing."""
    if np.iscomplexobj(values):
        raise UsageError(
            f"{reference}: {what} is complex, as {np.ravel(values)[0]:.3g}; return real numbers, for example "
            "np.real(...)"
        )


def _guarded(method: Callable[..., Any], name: str, reference: str) -> Callable[..., Any]:
    def call(*given: Any, **named: Any) -> Any:
        arguments = [read_only(value) for value in given]
        keywords = {key: read_only(value) for key, value in named.items()}
        answer = asked(lambda: method(*arguments, **keywords), name, reference)
        for part in answer.values() if isinstance(answer, Mapping) else (answer,):
            refuse_complex(part, name, reference)
        # What it hands on of what it was given, its caller may change.
        return answer.copy() if isinstance(answer, np.ndarray) and not answer.flags.writeable else answer

    return call
