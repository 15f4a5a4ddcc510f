"""Text in figures: every name is shown letter by letter, whatever it holds, and short enough to leave room for data.

Matplotlib reads what stands between two `$` as a formula, drops legend labels that begin with `_`, and warns of letters
that its font lacks. Names are data: none of this may happen to them.
"""

from __future__ import annotations

import unicodedata
from collections.abc import Iterator
from functools import cache

from matplotlib.artist import Artist
from matplotlib.axis import Tick
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties, findfont
from matplotlib.ft2font import FT2Font
from matplotlib.text import Text

FAMILY = "DejaVu Sans"  # comes with matplotlib: the same on every machine
UNKNOWN = "\N{REPLACEMENT CHARACTER}"
ELLIPSIS = "…"
LONGEST = 28  # letters of a name in a figure,
LABEL = 18  # beside an axis that is no longer than that,
LONGEST_UNIT = 12  # and of a unit
_NO_WIDTH = "\N{ZERO WIDTH SPACE}"


def shortened(name: str, most: int = LONGEST) -> str:
    """A name of at most so many letters: the middle of a longer one becomes an ellipsis, as ends tell names apart."""
    if len(name) <= most:
        return name
    end = (most - 1) // 2
    return f"{name[: most - 1 - end]}{ELLIPSIS}{name[len(name) - end :] if end else ''}"


def named(name: str, unit: str = "", most: int = LONGEST) -> str:
    """`name [unit]` for an axis, both shortened; the name alone where there is no unit."""
    return f"{shortened(name, most)} [{shortened(unit, LONGEST_UNIT)}]" if unit else shortened(name, most)


def legend_label(name: str, most: int = LONGEST) -> str:
    """A name as a legend's label: of one that begins with `_` matplotlib would show nothing."""
    label = shortened(name, most)
    return f"{_NO_WIDTH}{label}" if label.startswith("_") else label


def drawable(text: str) -> str:
    """What the font can draw of a text: letters that it lacks are replaced, marks without a shape left out."""
    known = _letters()
    kept = (c for c in text if c == "\n" or ord(c) in known or unicodedata.category(c) != "Cf")
    return "".join(c if c == "\n" or ord(c) in known else UNKNOWN for c in kept)


def make_literal(figure: Figure) -> None:
    """Every text of a figure shows its own letters; numbers at ticks are left as their formatter writes them."""
    for text in _texts(figure):
        text.set_parse_math(False)
        text.set_text(drawable(text.get_text()))


def _texts(artist: Artist) -> Iterator[Text]:
    for child in artist.get_children():
        if isinstance(child, Tick):
            continue
        if isinstance(child, Text):
            yield child
        yield from _texts(child)


@cache
def _letters() -> frozenset[int]:
    """Code points that the font has in all weights that are used."""
    weights = (FontProperties(family=FAMILY, weight=weight) for weight in ("normal", "bold"))
    return frozenset.intersection(*(frozenset(FT2Font(findfont(w)).get_charmap()) for w in weights))
