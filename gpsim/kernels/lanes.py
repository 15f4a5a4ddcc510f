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
# An angle, its sine and cosine; when the substep begins, its length.
ANGLE: Final = 19 * LANES
SIN: Final = 20 * LANES
COS: Final = 21 * LANES
T: Final = 22 * LANES
H: Final = 23 * LANES
# The slope of this stage, and a mean of those so far; rates before something changed them; where a substep ends.
K: Final = 24 * LANES
K1: Final = 28 * LANES
SUM: Final = 32 * LANES
AHEAD: Final = 36 * LANES
# What a unit force on a coordinate does to both rates.
M: Final = 40 * LANES
M1: Final = 41 * LANES
# Dry friction: the speed it is against, its direction, its size, what would hold the coordinate; the load.
BEGUN: Final = 42 * LANES
AGAINST: Final = 43 * LANES
MOST: Final = 44 * LANES
HOLDS: Final = 45 * LANES
BEFORE: Final = 46 * LANES
LOAD: Final = 47 * LANES
LIGHTER: Final = 48 * LANES
# Room for a law's value.
ONE: Final = 49 * LANES
# When the transition began.
BEGAN: Final = 50 * LANES
# What is added to a rate in this transition.
PUSH: Final = 51 * LANES
# The commands as they reached the drives.
REACHED: Final = 52 * LANES
SIZE: Final = 54 * LANES
