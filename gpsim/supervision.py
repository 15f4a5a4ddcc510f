"""What a command tells the process that waits for it: whose code it is about to call.

`cli/entry.py` runs every command in a child of its own and tells of the child's end, should nobody else. Here the child
speaks: where nobody waits, as in a program that uses gpsim as a library, nothing is said.
"""

from __future__ import annotations

import os
from contextlib import suppress

ENDED, FILE = "ended", "file"
"""Words that begin a line to the supervisor."""
_listener: int | None = None


def listen(descriptor: int | None) -> None:
    """From now on lines go to this file descriptor."""
    global _listener
    _listener = descriptor


def note(kind: str, text: str) -> None:
    """One line to the supervisor; a full pipe loses it."""
    if _listener is not None:
        with suppress(OSError):
            os.write(_listener, f"{kind} {' '.join(text.splitlines())}\n".encode(errors="replace"))


def calls(file: str) -> None:
    """A user's file, whose code this process calls from now on."""
    note(FILE, file)
