"""Being asked to end: SIGTERM, as a shell's kill, a service manager or a cluster sends it."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager

ASKED = 128 + signal.SIGTERM
"""The exit code of a process that ended because it was asked to."""


class Terminated(SystemExit):
    """The process is asked to end: it cleans up as after Ctrl-C."""

    def __init__(self) -> None:
        super().__init__(ASKED)


@contextmanager
def ends_when_asked() -> Iterator[None]:
    """Within it SIGTERM raises Terminated, once: what cleans up then is not interrupted again."""
    if threading.current_thread() is not threading.main_thread():  # whose process it is minds its signals
        yield
        return

    def leave(number: int, frame: object) -> None:
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        raise Terminated

    before = signal.signal(signal.SIGTERM, leave)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before or signal.SIG_DFL)
