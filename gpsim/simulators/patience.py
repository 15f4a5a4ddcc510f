"""How long one call of a user's code may take: a timer looks now and then whether it is still the same call.

Nothing is asked of the system at every call: there are hundreds of thousands of them.
"""

from __future__ import annotations

import atexit
import os
import signal
import threading
import time

from gpsim.errors import UsageError

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
        self._depth, self._count, self._looking = 0, 0, False
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
            self._extend(0.0)

    def _extend(self, longest: float) -> None:
        """Who does not come to look any more is ended by the system (SIGVTALRM)."""
        signal.setitimer(signal.ITIMER_VIRTUAL, longest * COMPILED * (os.cpu_count() or 1))


WATCH = _Watch()
atexit.register(WATCH.stop)  # the interpreter gives up its handlers when it closes
