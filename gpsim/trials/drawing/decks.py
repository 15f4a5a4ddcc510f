"""How many effects a trial has, and which family comes first: every stratum in its share, every family as often."""

from __future__ import annotations

import numpy as np

from gpsim.trials import catalogue, outside
from gpsim.trials.worlds import Stratum

COUNTS: dict[Stratum, int] = {"single": 10, "pair": 5, "triple": 3, "none": 15, "unknown": 5}
LONG: tuple[Stratum, ...] = ("single", "none")  # two long worlds close every deck
DECK_SIZE = sum(COUNTS.values()) + len(LONG)
SIZE = {"single": 1, "pair": 2, "triple": 3, "none": 0, "unknown": 1, "words": 1}
WORDS_FROM = 50_000
"""Behind it are the numbers of worlds with one of the newer families each; decks never come that far."""


def stratum_of(number: int) -> tuple[Stratum, bool, int]:
    """Stratum of trial `number` (from 1), whether it is long, and its rank among those of its stratum."""
    if number > WORDS_FROM:
        return "words", False, number - WORDS_FROM - 1
    deck, place = divmod(number - 1, DECK_SIZE)
    cards: list[Stratum] = [s for s, count in COUNTS.items() for _ in range(count)]
    # Interleaved by a fixed stride that shares no factor with the deck, so that every part of a proof holds all.
    shuffled = [cards[(17 * i + 5) % len(cards)] for i in range(len(cards))] + list(LONG)
    stratum = shuffled[place]
    per_deck = COUNTS[stratum] + LONG.count(stratum)
    return stratum, place >= len(cards), deck * per_deck + shuffled[:place].count(stratum)


def first_family(seed: int, stratum: Stratum, rank: int) -> str | None:
    """The first effect of a world: each family (or kind) once in every cycle, cycles in an order of their own."""
    if stratum == "none":
        return None
    names = list(catalogue.DECK)
    if stratum == "words":
        names = sorted(catalogue.WORDS)
    if stratum == "unknown":
        names = sorted(outside.drawn(seed))
    cycle, place = divmod(rank, len(names))
    order = np.random.default_rng([seed, SIZE[stratum], stratum == "unknown", cycle]).permutation(len(names))
    return str(names[order[place]])
