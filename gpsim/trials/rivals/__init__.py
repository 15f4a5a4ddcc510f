"""What else could be said of a world: explanations as good as the truth, and another program's answer.

The rule for equivalents fits with the diagnosis's own engine, after the reveal; PySINDy is optional. Both are dear, so
what they find is kept.
"""

from gpsim.trials.rivals.equivalents import Listing, cached_listing
from gpsim.trials.rivals.fits import Rival, as_hypothesis
from gpsim.trials.rivals.machine_rivals import MachineListing, Seen, machine_listing
from gpsim.trials.rivals.plan_rivals import PLANNED, Second, compared, second_recordings
from gpsim.trials.rivals.robot_rivals import (
    WholeListing,
    afloat_rollouts,
    robot_rivals,
    whole_listing,
)

__all__ = [
    "PLANNED",
    "Listing",
    "MachineListing",
    "Rival",
    "Second",
    "Seen",
    "WholeListing",
    "afloat_rollouts",
    "as_hypothesis",
    "cached_listing",
    "compared",
    "machine_listing",
    "robot_rivals",
    "second_recordings",
    "whole_listing",
]
