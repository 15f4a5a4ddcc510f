"""Why a model does not compile, in one line: file, line and reason, as far as MuJoCo tells them."""

from __future__ import annotations

import re
from pathlib import Path

from gpsim.errors import UsageError

MOST = 240  # characters of what somebody else says
_LINE = re.compile(r"(?:, *line |Line number=)(\d+)")
_UNCLOSED = re.compile(r"XML_ERROR_MISMATCHED_ELEMENT.*?XMLElement name=(\w+)")
_NOISE = re.compile(
    r"(XML )?Error: |XML parse error \d+: |Schema violation: |ErrorID=\S+ \(\w+\)|XMLElement name=\w+"
)
_OF = re.compile(r" ?Element name '([^']*)'(?:, id \d+)?| ?Element '([^']*)'")


def compile_fault(path: Path, error: BaseException) -> UsageError:
    """A fault of an XML: MuJoCo's own words, behind the line that they are about."""
    said = one_line(error)
    number = int(found[1]) if (found := _LINE.search(said)) else _line_of(path, said)
    at = f"{path}, line {number}" if number else str(path)
    return UsageError(f"{at}: does not compile: {_reason(said)}")


def one_line(said: object) -> str:
    """One printable line of what MuJoCo, a file or somebody's code says, which may be several."""
    flat = " ".join(str(said).split())[:MOST]
    return "".join(c if c.isprintable() else "?" for c in flat)


def _reason(said: str) -> str:
    if (unclosed := _UNCLOSED.search(said)) is not None:
        return f"<{unclosed[1]}> is not closed, or by another's name"
    of = _OF.search(said)
    place = "" if of is None else f" (in '{of[1]}')" if of[1] else f" (in <{of[2]}>)" if of[2] else ""
    short = _NOISE.sub("", _LINE.sub("", _OF.sub("", said)))
    return " ".join(short.split()).strip(" ,") + place


def _line_of(path: Path, said: str) -> int:
    """The line that holds what the message quotes, 0 where it quotes nothing of the file."""
    quoted = [word for word in re.findall(r"'([^']*)'", said) if word]
    sought = [f'"{word}"' for word in quoted] or (["<key "] if "keyframe" in said else [])
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError):
        return 0
    return next((n for n, line in enumerate(lines, 1) if any(word in line for word in sought)), 0)
