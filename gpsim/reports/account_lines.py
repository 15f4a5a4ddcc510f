"""An account for the terminal: never more than so many lines and columns, whatever names and numbers it holds.

Where an account is too long, its parts are cut in a fixed order: first what a second line says, then rows of the table.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import zip_longest

from rich.cells import cell_len, set_cell_size

from gpsim.reports.account import Account, Fit
from gpsim.reports.account_effects import Row
from gpsim.reports.quantities import ELLIPSIS, shortened
from gpsim.reports.sheets import printable

LINES, COLUMNS = 24, 100
INDENT = 9  # columns of a part's name
WIDTH = COLUMNS - INDENT
BAR, SHORT_BAR = 10, 4  # columns of a full bar; where sizes or names would be cut
PERCENT = 6  # columns of a share beside it
EIGHTHS = " ▏▎▍▌▋▊▉"
HEADS = ("effect", "size ± (90 %)", "share of mismatch", "how sure", "law holds?")
SHORT_HEADS = (*HEADS[:2], "share", *HEADS[3:])
GAP = 2  # columns between two of the table
WIDEST = (34, 34, len(HEADS[2]), 9, 13)  # columns that the table's columns may take
NARROWEST = 22  # columns of a name before the sizes beside it make room
WORD = 60  # columns of a word: a longer one, a path, would push all others off its line
NAME = 24  # letters of a channel in the line of the fit


@dataclass(frozen=True)
class Limits:
    """How many lines each part may take.

    names, sizes: of a row; gates: whether rows say where they act; members: lines for the joints of a group.
    """

    rows: int = 7
    names: int = 3
    sizes: int = 3
    gates: bool = True
    members: int = 4
    verdict: int = 2
    where: int = 3
    slight: int = 2
    rival: int = 2
    differs: int = 5
    left: int = 5
    fit: int = 2
    next: int = 3
    geometry: int = 6


_CLOSER = Limits(names=2, where=2, differs=4, left=4, fit=1, next=2, geometry=5)
_CLOSE = replace(_CLOSER, sizes=2, members=3, slight=1, rival=1, differs=3, left=3, geometry=4)
_CLOSEST = replace(_CLOSE, names=1, sizes=1, gates=False, members=2, geometry=3)
LIMITS = (Limits(), _CLOSER, _CLOSE, replace(_CLOSE, sizes=1), _CLOSEST, replace(_CLOSEST, rows=5))
"""The first that fits is taken: the last always does."""


def account_lines(account: Account) -> list[str]:
    """At most LINES lines of at most COLUMNS columns; parts stand apart where there is room."""
    parts: list[list[str]] = []
    for limits in LIMITS:
        parts = [part for part in _parts(account, limits) if part]
        if sum(map(len, parts)) <= LINES:
            break
    spare = LINES - sum(map(len, parts)) - (len(parts) - 1)
    lines: list[str] = []
    for part in parts:
        lines += [""] * (spare >= 0 and bool(lines)) + part
    return lines[:LINES]


def _parts(account: Account, limits: Limits) -> Iterator[list[str]]:
    yield _part("Verdict", [f"{account.verdict}: {account.sentence}"], limits.verdict)
    yield _part("Where", [account.where], limits.where)
    yield _part("Geometry", account.geometry, limits.geometry)
    what = _table(account.rows, limits)
    what += wrapped(account.slight, WIDTH, limits.slight) if account.slight else []
    yield _named(
        "What", [*what, *(x for rival in account.rivals for x in wrapped(rival, WIDTH, limits.rival))]
    )
    yield _part("Differs", account.differs, limits.differs)
    yield _part("Left", account.left, limits.left)
    head = max((cell_len(fit.title) + 1 for fit in account.fit), default=0)
    yield _named("Fit", [line for fit in account.fit for line in _fit(fit, head, limits.fit)])
    following = _part("Next", account.next, limits.next)
    if account.command is not None and account.command_here is not None:
        # Whole, or with DIR for a folder whose name is too long to stand here.
        whole = account.command == _one_line(account.command) and cell_len(account.command) <= WIDTH
        following.append(" " * INDENT + (account.command if whole else account.command_here))
    yield following


def _part(name: str, sentences: Sequence[str], most: int) -> list[str]:
    """Sentences below each other, the first ones first; each gets a line before any gets a second one."""
    sentences = [sentence for sentence in sentences if sentence][:most]
    lines: list[str] = []
    for i, sentence in enumerate(sentences):
        lines += wrapped(sentence, WIDTH, most - len(lines) - (len(sentences) - 1 - i))
    return _named(name, lines)


def _named(name: str, lines: Sequence[str]) -> list[str]:
    return [f"{name if i == 0 else '':<{INDENT}}{line}".rstrip() for i, line in enumerate(lines)]


def _fit(fit: Fit, indent: int, most: int) -> list[str]:
    """One group of errors: as many channels as find room, and how many more there are."""
    told = [_one_line(f"{shortened(change.channel, NAME)} {change.said}") for change in fit.changes]
    lines = [fit.missing]
    for count in range(len(told), 0, -1):
        shown = told[:count] + ([f"{len(told) - count} more"] if count < len(told) else [])
        lines = _filled([*(f"{one} ·" for one in shown[:-1]), shown[-1]], WIDTH - indent, most)
        if not lines[-1].endswith(ELLIPSIS):
            break
    return [f"{fit.title if i == 0 else '':<{indent}}{line}" for i, line in enumerate(lines)]


def _table(rows: Sequence[Row], limits: Limits) -> list[str]:
    if not rows:
        return []
    shown = rows[: limits.rows]
    for heads, full in ((HEADS, BAR), (SHORT_HEADS, SHORT_BAR)):
        cells = [
            (_one_line(r.effect), _sizes(r, limits.sizes), _share(r, full), r.certainty, r.law) for r in shown
        ]
        longest = [max((_labelled(*size) for size in s), key=cell_len, default="") for _, s, *_ in cells]
        needed = _needed([heads, *((c[0], size, *c[2:]) for c, size in zip(cells, longest, strict=True))])
        widths = list(needed)
        for _ in range(sum(widths) + GAP * (len(widths) - 1) - WIDTH):  # names, which wrap, make room first
            widths[0 if widths[0] > NARROWEST or widths[0] >= widths[1] else 1] -= 1
        if widths[1] == needed[1] and (limits.names > 1 or widths[0] == needed[0]):
            break
    lines = [_line(heads, widths)]
    for row, (effect, sizes, *numbers) in zip(shown, cells, strict=True):
        names = _in_lines(effect, widths[0], limits.names)
        told = [_labelled(*size, widths[1]) for size in sizes]
        first, *others = zip_longest(names, told or [""], fillvalue="")
        lines.append(_line((*first, *numbers), widths))
        lines += [_line((*other, "", "", ""), widths) for other in others]
        joints = [f"{joint} {its} ·" for joint, its in row.members]
        if joints:
            joints[-1] = joints[-1].removesuffix(" ·")
            lines += [f"  {line}" for line in _filled(joints, WIDTH - 2, limits.members)]
        for text in (row.gate, row.instead) if limits.gates else ():
            lines += wrapped(text, WIDTH - 2, limits.names) if text else []
    if len(rows) > len(shown):
        lines.append(f"{ELLIPSIS} and {len(rows) - len(shown)} more in report.html")
    return lines


def _sizes(row: Row, most: int) -> list[tuple[str, str]]:
    """A size a line; on one where they find room together."""
    together = ", ".join(_labelled(*size) for size in row.sizes)
    if cell_len(together) <= WIDEST[1]:
        return [("", together)]
    sizes = list(row.sizes[:most])
    return [*sizes[:-1], (sizes[-1][0], f"{sizes[-1][1]} {ELLIPSIS}")] if len(row.sizes) > most else sizes


def _labelled(name: str, size: str, width: int | None = None) -> str:
    """A parameter's name and its size; of both the name makes room."""
    if width is not None and name:
        name = _fitting(name, max(width - cell_len(size) - 1, 1))
    return _one_line(f"{name} {size}")


def _share(row: Row, full: int) -> str:
    """A bar of block characters, as wide whatever the share, and its number; full: columns of the whole."""
    percent = row.percent if len(row.percent) <= PERCENT else row.percent.replace(" ", "")
    whole, rest = divmod(round(8 * full * min(max(row.share or 0.0, 0.0), 1.0)), 8)
    return f"{('█' * whole + (EIGHTHS[rest] if rest else '')).ljust(full)} {percent:>{PERCENT}}"


def _needed(table: Sequence[Sequence[str]]) -> list[int]:
    """Of every column: what its head and its cells need, not more than it may take."""
    longest = [max(map(cell_len, column)) for column in zip(*table, strict=True)]
    return [
        min(need, max(most, len(head))) for need, most, head in zip(longest, WIDEST, table[0], strict=True)
    ]


def _line(cells: Sequence[str], widths: Sequence[int]) -> str:
    fitted = (set_cell_size(_fitting(c, width), width) for c, width in zip(cells, widths, strict=True))
    return (" " * GAP).join(fitted).rstrip()


def _in_lines(text: str, width: int, most: int) -> list[str]:
    """A name in at most so many lines: broken between words, else behind a mark within a word; cut if still longer."""
    lines: list[str] = []
    for word in text.split(" "):
        for i, piece in enumerate(_pieces(word, width)):
            if lines and cell_len(lines[-1]) + (not i) + cell_len(piece) <= width:
                lines[-1] += " " * (not i) + piece
            else:
                lines.append(piece)
    return lines if len(lines) <= most else [_fitting(text, width)]


def _pieces(word: str, width: int) -> list[str]:
    """Parts of a word that fit a line each."""
    if cell_len(word) <= width:
        return [word]
    half, pieces = max(width // 2, 1), list[str]()
    for part in re.findall(r"[^_/.]+[_/.]*|[_/.]+", word):
        step = half if cell_len(part) > width else len(part)
        pieces += [part[at : at + step] for at in range(0, len(part), step)]
    return pieces


def wrapped(text: str, width: int, most: int) -> list[str]:
    """A text in at most so many lines of at most so many columns; an ellipsis where words are left out."""
    return _filled([_fitting(word, min(width, WORD)) for word in _one_line(text).split(" ")], width, most)


def _filled(words: Sequence[str], width: int, most: int) -> list[str]:
    """The same, of words that may hold spaces and are not broken there."""
    words = [_fitting(word, width) for word in words if word]
    lines: list[str] = []
    for i, word in enumerate(words):
        if lines and cell_len(lines[-1]) + 1 + cell_len(word) <= width:
            lines[-1] += f" {word}"
        elif len(lines) < most:
            lines.append(word)
        elif i:
            last = lines[-1]
            while cell_len(last) + 2 > width:  # words make room for the ellipsis
                last = last.rpartition(" ")[0] or last[:-1]
            return [*lines[:-1], f"{last.rstrip(' ,;·:')} {ELLIPSIS}"]
        else:
            return []
    return lines


def _fitting(word: str, width: int) -> str:
    """A word or cell of at most so many columns, its middle left out where it has more."""
    most = width
    while cell_len(word) > width and most > 0:
        word, most = shortened(word, most), most - 1
    return word


def _one_line(text: str) -> str:
    return " ".join(printable(text).split())
