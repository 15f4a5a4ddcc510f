"""Robots: worlds whose simulator is a MuJoCo model, from a seed to what truly happened and how much of it shows.

`ROBOTS` are models from wheels of others and one written here, `draw_robot` draws a world, `run` drives it, `Plant` is
what truly moves, `shown` says how much each effect shows, `recorded` is the log that a user would have. `draw_whole`
draws a whole robot, which may be any of `WHOLE`; `run_whole` drives it, `Stepped` is what truly moves, `shares_of` says
what each effect asks of its joint.
"""

from gpsim.trials.robots.draws import (
    ROBOTS_FROM,
    STRENGTHS,
    arms_places,
    draw_arm,
    draw_robot,
    places_of,
    planned,
    robot_rank,
    stratum_of,
)
from gpsim.trials.robots.driving import sound
from gpsim.trials.robots.models import ROBOTS, WHOLE, Files, Layout, files_of, layout_of, robot_of, spec_of
from gpsim.trials.robots.plant import Plant, tilted
from gpsim.trials.robots.running import SHOWS, Stepped, recorded, run, run_whole, shown, step_of
from gpsim.trials.robots.whole import (
    ROWS,
    WHOLE_FROM,
    body_torques,
    dealt,
    draw_whole,
    joint_torques,
    motion_of,
    of_body,
    shares_of,
    whole_rank,
)

__all__ = [
    "ROBOTS",
    "ROBOTS_FROM",
    "ROWS",
    "SHOWS",
    "STRENGTHS",
    "WHOLE",
    "WHOLE_FROM",
    "Files",
    "Layout",
    "Plant",
    "Stepped",
    "arms_places",
    "body_torques",
    "dealt",
    "draw_arm",
    "draw_robot",
    "draw_whole",
    "files_of",
    "joint_torques",
    "layout_of",
    "motion_of",
    "of_body",
    "places_of",
    "planned",
    "recorded",
    "robot_of",
    "robot_rank",
    "run",
    "run_whole",
    "shares_of",
    "shown",
    "sound",
    "spec_of",
    "step_of",
    "stratum_of",
    "tilted",
    "whole_rank",
]
