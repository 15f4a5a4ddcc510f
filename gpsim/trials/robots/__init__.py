"""Robots: worlds whose simulator is a MuJoCo model, from a seed to what truly happened and how much of it shows.

`ROBOTS` are models from wheels of others and one written here, `draw_robot` draws a world, `run` drives it, `Plant` is
what truly moves, `shown` says how much each effect shows, `recorded` is the log that a user would have.
"""

from gpsim.trials.robots.arms import arms_places, draw_arm
from gpsim.trials.robots.draws import (
    ROBOTS_FROM,
    STRENGTHS,
    draw_robot,
    places_of,
    planned,
    robot_rank,
    stratum_of,
)
from gpsim.trials.robots.driving import sound
from gpsim.trials.robots.models import ROBOTS, Files, Layout, Robot, files_of, layout_of, spec_of
from gpsim.trials.robots.plant import Plant, tilted
from gpsim.trials.robots.running import SHOWS, recorded, run, shown

__all__ = [
    "ROBOTS",
    "ROBOTS_FROM",
    "SHOWS",
    "STRENGTHS",
    "Files",
    "Layout",
    "Plant",
    "Robot",
    "arms_places",
    "draw_arm",
    "draw_robot",
    "files_of",
    "layout_of",
    "places_of",
    "planned",
    "recorded",
    "robot_rank",
    "run",
    "shown",
    "sound",
    "spec_of",
    "stratum_of",
    "tilted",
]
