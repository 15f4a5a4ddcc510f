"""Text for a terminal: names may hold anything, and a terminal obeys control characters."""

from __future__ import annotations

import unicodedata

from rich.text import Text

_BIDIRECTIONAL = frozenset("\u061c\u200e\u200f\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069")
"""What makes text run the other way: a line would no longer say what it reads."""


def printable(text: object) -> str:
    """The text without control characters, line breaks and tabs apart; what no encoding can hold becomes `?`."""
    kept = (
        c for c in str(text) if c in "\n\t" or not (unicodedata.category(c) == "Cc" or c in _BIDIRECTIONAL)
    )
    return "".join("?" if unicodedata.category(c) == "Cs" else c for c in kept)


def literal(text: object, style: str = "") -> Text:
    """A text for Rich, in which `[red]` is no colour."""
    return Text(printable(text), style=style)
