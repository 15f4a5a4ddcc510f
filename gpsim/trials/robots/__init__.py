"""Robots: worlds whose simulator is a MuJoCo model, from a seed to what truly happened and how much of it shows.

`models` are of wheels of others and some written here. `draw_robot` draws a world, `run` drives it, `Plant` moves,
`shown` says how much each effect shows, `recorded` is the log that a user would have. `draw_whole` draws a whole robot,
`run_whole` drives it, `shares_of` says what each effect asks of its joint. `draw_afloat` draws what floats or stands,
`run_afloat` keeps it up.
"""

from gpsim.trials.robots.afloat import draw_afloat
from gpsim.trials.robots.draws import draw_arm, draw_robot, stratum_of
from gpsim.trials.robots.driving import run, run_whole, sound
from gpsim.trials.robots.floating import kept_afloat, run_afloat, shown_afloat
from gpsim.trials.robots.models import Layout, Robot, files_of, layout_of, robot_of, spec_of
from gpsim.trials.robots.moving import SHOWS, recorded, shown
from gpsim.trials.robots.whole import (
    ROWS,
    body_torques,
    draw_whole,
    joint_torques,
    motion_of,
    of_body,
    shares_of,
)
