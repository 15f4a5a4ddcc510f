"""Calls of a user's code: whatever it does, somebody is told in one line, and what it is given stays as it is.

How long one call may take: a timer looks now and then whether it is still the same call. Nothing is asked of the system
at every call: there are hundreds of thousands of them.
"""

from __future__ import annotations

import atexit
import mmap
import os
import signal
import threading
import time
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

import numpy as np

from gpsim.errors import Terminated, UsageError

SETTING = "GPSIM_LONGEST_CALL"
LONGEST_CALL = 60.0  # s, where the setting says nothing
BETWEEN_LOOKS = 0.5  # s
MAIN = threading.main_thread().ident
COMPILED = 2.0  # times as much processor time: code that Python cannot interrupt ends the process then


class TooLongError(BaseException):
    """The time is up: no `except Exception` of the code that is called stops it."""


def longest_call() -> float:
    """The setting [s]; raises UsageError."""
    said = os.environ.get(SETTING, "")
    try:
        longest = float(said) if said else LONGEST_CALL
    except ValueError:
        longest = 0.0
    if not 0.0 < longest < 1e9:
        raise UsageError(f"{SETTING}={said}: expected the longest time of one call in seconds, as 600")
    return longest


class _Watch:
    """Around a call in the main thread, the one that signals reach: TooLongError is raised within it if it lasts.

    Other threads are not watched. Within another call it goes on with that one's count.
    """

    def __init__(self) -> None:
        self._depth, self._count, self._looking, self._armed = 0, 0, False, False
        self._seen, self._since, self._longest = -1, 0.0, LONGEST_CALL

    def __enter__(self) -> None:
        if threading.get_ident() == MAIN:
            if not self._looking:
                self._begin()
            self._count += 1
            self._depth += 1

    def __exit__(self, *_: object) -> None:
        if threading.get_ident() == MAIN:
            self._depth -= 1

    def _begin(self) -> None:
        """Look from now on, unless the program has a use of its own for the timer."""
        self._longest = longest_call()
        if signal.getsignal(signal.SIGALRM) in (signal.SIG_DFL, self._look):
            signal.signal(signal.SIGALRM, self._look)
            signal.setitimer(signal.ITIMER_REAL, BETWEEN_LOOKS, BETWEEN_LOOKS)
            self._extend(self._longest)
            self._armed = True
        self._looking = True

    def _look(self, number: int, frame: object) -> None:
        """Raise where a call takes too long; stop looking where none was made since the last look."""
        now, same = time.monotonic(), self._seen == self._count
        if same and not self._depth:
            self.stop()
            return
        self._extend(self._longest)
        if not (same and self._depth):
            self._seen, self._since = self._count, now
        elif now - self._since >= self._longest:
            raise TooLongError

    def stop(self) -> None:
        """Look no more until the next call."""
        self._looking = False
        if signal.getsignal(signal.SIGALRM) == self._look:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
        # Also where the program has taken the other timer meanwhile: it would be ended by this one.
        if self._armed:
            self._extend(0.0)
            self._armed = False

    def _extend(self, longest: float) -> None:
        """Who does not come to look any more is ended by the system (SIGVTALRM)."""
        signal.setitimer(signal.ITIMER_VIRTUAL, longest * COMPILED * (os.cpu_count() or 1))


WATCH = _Watch()
atexit.register(WATCH.stop)  # the interpreter gives up its handlers when it closes


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
    if isinstance(value, np.ndarray):
        view = value.view()
        view.flags.writeable = False
        return view
    return {k: read_only(v) for k, v in value.items()} if isinstance(value, Mapping) else value


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
