"""Drawing worlds: the same seed and trial number give the same world, every family comes as often.

A deck says how many effects a trial has, places say what a family can act on, `draw` makes the world.
"""

from gpsim.trials.drawing.draws import (
    ALIKE,
    COUNTS,
    CURVES_FROM,
    DECK_SIZE,
    LONG,
    SIZE,
    WORDS_FROM,
    draw,
    first_family,
    stratum_of,
)
from gpsim.trials.drawing.machine_draws import (
    ARM,
    KINDS,
    MACHINES_FROM,
    counts,
    draw_machine,
    kind_of,
    machine_rank,
)
from gpsim.trials.drawing.nuisances import of_body, places_of, systems_of, within
from gpsim.trials.drawing.plan_draws import HIDDEN, PLANS_FROM, box_of, draw_plan, plan_rank, slow_waves
from gpsim.trials.drawing.rough_draws import ROUGH_FROM, draw_rough, rank_of

__all__ = [
    "ALIKE",
    "ARM",
    "COUNTS",
    "CURVES_FROM",
    "DECK_SIZE",
    "HIDDEN",
    "KINDS",
    "LONG",
    "MACHINES_FROM",
    "PLANS_FROM",
    "ROUGH_FROM",
    "SIZE",
    "WORDS_FROM",
    "box_of",
    "counts",
    "draw",
    "draw_machine",
    "draw_plan",
    "draw_rough",
    "first_family",
    "kind_of",
    "machine_rank",
    "of_body",
    "places_of",
    "plan_rank",
    "rank_of",
    "slow_waves",
    "stratum_of",
    "systems_of",
    "within",
]
