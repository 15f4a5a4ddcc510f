"""Drawing worlds: the same seed and trial number give the same world, every family comes as often.

A deck says how many effects a trial has, places say what a family can act on, `draw` makes the world.
"""

from gpsim.trials.drawing.decks import COUNTS, DECK_SIZE, LONG, SIZE, first_family, stratum_of
from gpsim.trials.drawing.draws import ALIKE, draw
from gpsim.trials.drawing.places import of_body, places_of, systems_of
from gpsim.trials.drawing.rough_draws import ROUGH_FROM, draw_rough, rank_of, within

__all__ = [
    "ALIKE",
    "COUNTS",
    "DECK_SIZE",
    "LONG",
    "ROUGH_FROM",
    "SIZE",
    "draw",
    "draw_rough",
    "first_family",
    "of_body",
    "places_of",
    "rank_of",
    "stratum_of",
    "systems_of",
    "within",
]
