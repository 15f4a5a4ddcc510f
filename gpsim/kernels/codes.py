"""The numbers by which compiled code knows systems, laws, gates and schemes, and the columns of its tables."""

from __future__ import annotations

from typing import Final

# Systems.
CARTPOLE: Final = 0
PENDULUM: Final = 1
SLIDER: Final = 2
UNICYCLE: Final = 3
ACKERMANN: Final = 4
SERVO_JOINT: Final = 5

# Schemes.
FINE: Final = 0
EULER: Final = 1
SEMI_IMPLICIT: Final = 2
RK4: Final = 3

# Laws of the catalogue are numbered by kind, in hundreds (see `gpsim.kernels.tables`): smooth forces; dry friction, by
# the normal force, by what drives; parameters, twists, drives; commands that come late, and what else becomes of them.
PUSHES: Final = 100
GRIPS: Final = 200
WEIGHED: Final = 300
LOADED: Final = 400
BELIEVED: Final = 500
TURNS: Final = 600
GIVES: Final = 700
LATE: Final = 800
PASSES: Final = 900
KIND_WIDTH: Final = 100

# Laws that are none of these: tables, and those with hidden states.
FORCE_CURVE: Final = 1
GRIP_CURVE: Final = 2
TURN_CURVE: Final = 3
SLIP_CURVE: Final = 4
RATE_CURVE: Final = 5
DRIVE_CURVE: Final = 6
BRISTLES: Final = 7
ELASTIC: Final = 8

# Where a twist's law acts: alone, or first, further on or last of several that are one term.
ALONE: Final = 0
OPENING: Final = 1
WITHIN: Final = 2
CLOSING: Final = 3

# Conditions of gates: a region of a channel, moments, an episode, a hat over a channel.
REGION: Final = 0
SINCE: Final = 1
UNTIL: Final = 2
EPISODE: Final = 3
HAT: Final = 4

# Columns of a term: its law, where it acts, its first value, its conditions (from, to), its curve, or the action that
# drives it or is driven.
LAW: Final = 0
ON: Final = 1
VALUE: Final = 2
GATE: Final = 3
GATE_END: Final = 4
CURVE: Final = 5
TERM_WIDTH: Final = 6

# Columns of a condition: its kind, the channel (of state, then action), whether that wraps, the values of its edges
# (of a hat the place of its knot; of others the moment, the episode), its knots.
KIND: Final = 0
CHANNEL: Final = 1
WRAPS: Final = 2
LOW: Final = 3
HIGH: Final = 4
KNOTS: Final = 5
KNOTS_END: Final = 6
CONDITION_WIDTH: Final = 7

# Columns of a curve: inputs (a channel each, -1 for none), whether they wrap, their knots.
FIRST: Final = 0
FIRST_WRAPS: Final = 1
FIRST_KNOTS: Final = 2
FIRST_END: Final = 3
SECOND: Final = 4
SECOND_WRAPS: Final = 5
SECOND_KNOTS: Final = 6
SECOND_END: Final = 7
CURVE_WIDTH: Final = 8

# The numbers of a layout: the system, the scheme and so on; where the terms of each site begin, and where all end.
SYSTEM: Final = 0
SCHEME: Final = 1
HELD: Final = 2
STATES: Final = 3
ACTIONS: Final = 4
SUBSTEPS: Final = 5
PER_SUBSTEP: Final = 6
LOOKS_AHEAD: Final = 7
STILL: Final = 8
FORCES: Final = 9
DRY: Final = 10
PARAMETERS: Final = 11
TWISTS: Final = 12
RATES: Final = 13
TERMS: Final = 14
CHANGING: Final = 15
WIDTH: Final = 16
LOOKS: Final = 17
UNEVEN: Final = 18

# Columns of the actuators' table: the law, its action, its first value, its conditions (from, to), its first place in
# memory, how many commands it remembers, whether others follow on the same way.
MEMORY: Final = 5
DEPTH: Final = 6
FOLLOWED: Final = 7
ACTUATOR_WIDTH: Final = 8
