"""Lanes: so many rows of a batch are stepped together, each number of all of them in a row of one small array.

Every loop over them has a length and offsets that are known when it is compiled, so that a processor does several lanes
at once. What is not known then (which coordinate, which slope) is copied to where it is expected.
"""

from __future__ import annotations

from typing import Final

LANES: Final = 32

# Where the numbers begin: state at a substep's begin, command, state of a stage, rates, forces, parameters.
X: Final = 0
X1: Final = 1 * LANES
X2: Final = 2 * LANES
X3: Final = 3 * LANES
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
# Slopes of this stage and of the first one, and their sum; where a substep ends; what is added to the rates.
K: Final = 24 * LANES
K1: Final = 28 * LANES
SUM: Final = 32 * LANES
AHEAD: Final = 36 * LANES
EXTRA: Final = 40 * LANES
# Of the coordinate that is looked at: position, speed, rate, what a unit force does to its rate and to both.
POSITION: Final = 43 * LANES
SPEED: Final = 44 * LANES
OWN: Final = 45 * LANES
REACTS: Final = 46 * LANES
M: Final = 47 * LANES
M1: Final = 48 * LANES
# Dry friction: its direction, its size, the load.
BEGUN: Final = 49 * LANES
AGAINST: Final = 50 * LANES
MOST: Final = 51 * LANES
BEFORE: Final = 52 * LANES
LOAD: Final = 53 * LANES
LIGHTER: Final = 54 * LANES
# Room for a law's value, and for others.
ONE: Final = 55 * LANES
OTHER: Final = 56 * LANES
SIZE: Final = 57 * LANES
