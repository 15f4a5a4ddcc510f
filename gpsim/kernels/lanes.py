"""Lanes: so many rows of a batch are stepped together, each number of all of them in a row of one small array.

Every loop over them has offsets that are known when it is compiled, so that a processor does several lanes at once.
"""

from __future__ import annotations

from typing import Final

LANES: Final = 64
TOGETHER: Final = 8  # so many at once, at most; lanes that are left over are filled up to a multiple

# Where the numbers begin: state at a substep's begin, command, state of a stage, rates, forces, parameters.
X: Final = 0
X1: Final = 1 * LANES
U: Final = 4 * LANES
U1: Final = 5 * LANES
Y: Final = 6 * LANES
Y1: Final = 7 * LANES
Y2: Final = 8 * LANES
Y3: Final = 9 * LANES
R: Final = 10 * LANES
R1: Final = 11 * LANES
R2: Final = 12 * LANES
F: Final = 13 * LANES
F1: Final = 14 * LANES
P: Final = 15 * LANES
P1: Final = 16 * LANES
P2: Final = 17 * LANES
P3: Final = 18 * LANES
P4: Final = 19 * LANES
# An angle, its sine and cosine; when the substep begins, its length.
ANGLE: Final = 20 * LANES
SIN: Final = 21 * LANES
COS: Final = 22 * LANES
T: Final = 23 * LANES
H: Final = 24 * LANES
# The slope of this stage, and a mean of those so far; rates before something changed them; where a substep ends.
K: Final = 25 * LANES
K1: Final = 29 * LANES
SUM: Final = 33 * LANES
AHEAD: Final = 37 * LANES
# What a unit force on a coordinate does to both rates.
M: Final = 41 * LANES
M1: Final = 42 * LANES
# Dry friction: the speed it is against, its direction, its size, what would hold the coordinate; the load.
BEGUN: Final = 43 * LANES
AGAINST: Final = 44 * LANES
MOST: Final = 45 * LANES
HOLDS: Final = 46 * LANES
BEFORE: Final = 47 * LANES
LOAD: Final = 48 * LANES
LIGHTER: Final = 49 * LANES
# Room for a law's value.
ONE: Final = 50 * LANES
# When the transition began.
BEGAN: Final = 51 * LANES
# The commands as they reached the drives.
REACHED: Final = 52 * LANES
# How far the bristles of each coordinate are bent.
BENT: Final = 54 * LANES
# How far the drive of each action is twisted, and how fast; how a coordinate moves without it, and what it adds.
TWIST: Final = 56 * LANES
FREE: Final = 60 * LANES
LIGHT: Final = 61 * LANES
GIVEN: Final = 62 * LANES
SIZE: Final = 63 * LANES
