"""Hydra's sweep grammar: words with several values -> every combination, resolved."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice, product
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.errors import HydraException

from gpsim.errors import UsageError

from .configuration import resolve
from .options import says_where, shown_words

if TYPE_CHECKING:
    from gpsim.stages.full_loop import Point

MOST = 100_000  # combinations: more is a slip of the pen


@dataclass(frozen=True)
class Combination:
    """One combination. words: all of them with one value each; swept: those of them that vary, key to value."""

    words: tuple[str, ...]
    swept: dict[str, str]


def points_of(words: Sequence[str]) -> list[Combination]:
    """Every combination of the values that the words give, the last word varying fastest; raises UsageError."""
    axes = [_values(word) for word in words]
    found = list(islice(product(*axes), MOST + 1))
    if len(found) > MOST:
        raise UsageError(f"sweep: more than {MOST} combinations; take fewer values")
    varying = [i for i, axis in enumerate(axes) if len(axis) > 1]
    pairs = [[each[i].partition("=") for i in varying] for each in found]
    return [Combination(each, {k: v for k, _, v in own}) for each, own in zip(found, pairs, strict=True)]


def _values(word: str) -> list[str]:
    """A word a value, as Hydra reads it."""
    try:
        override = OverridesParser.create().parse_override(word)
        if not override.is_sweep_override():
            return [word]
        if says_where(word):
            raise UsageError(f"{word}: a launcher setting takes one value; write a list as [a,b]")
        if "glob(" in word:
            raise UsageError(f"{word}: list the choices, as gp=raw,jump; patterns are not supported")
        if not override.is_discrete_sweep():
            raise UsageError(f"{word}: an interval is not a list of values; use range(...) or 1,2,3")
        found = [str(value) for value in islice(override.sweep_string_iterator(), MOST + 1)]
    except (HydraException, ValueError, TypeError) as error:
        raise UsageError(f"{word}: {' '.join(str(error).split())[:200]}") from error
    if not found:
        raise UsageError(f"{word}: no value in it")
    if len(set(found)) < len(found):
        raise UsageError(f"{word}: a value is there twice")
    return [f"{override.get_key_element()}={value}" for value in found]


def resolved(found: Sequence[Combination], config_dir: Path | None) -> list[Point]:
    """The requests; what differs by its seed alone is resolved once, which takes Hydra a tenth of a second."""
    from gpsim.stages.full_loop import Point
    from gpsim.stages.stage import Request

    known: dict[tuple[str, ...], dict[str, Any]] = {}
    points = []
    for point in found:
        seed = point.swept.get("seed", "")
        rest = tuple(word for word in point.words if not (seed.isdecimal() and word.startswith("seed=")))
        if rest not in known:
            known[rest] = resolve(rest, config_dir)
        request = Request(known[rest], shown_words(rest, config_dir))
        points.append(Point(point.swept, request.having(seed=int(seed)) if seed.isdecimal() else request))
    return points
