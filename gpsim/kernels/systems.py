"""The built-in simulators for lanes of rows: what gpsim/simulators writes for batches, where it is explained.

Sine and cosine of many numbers at once, to the last bit or two up to a million: Cody and Waite (1980), Software Manual
for the Elementary Functions: a multiple of pi/2 is taken off in three parts; the rest is put into Taylor polynomials
that end below rounding on [-pi/4, pi/4].
"""

from __future__ import annotations

import math
from typing import Final

from gpsim.channels import FloatArray
from gpsim.kernels import codes
from gpsim.kernels.compiling import clipped, compiled
from gpsim.kernels.lanes import (
    ANGLE,
    COS,
    F1,
    LANES,
    LOAD,
    M1,
    P1,
    P2,
    P3,
    P4,
    R1,
    R2,
    SIN,
    U1,
    Y1,
    Y2,
    Y3,
    F,
    K,
    M,
    P,
    R,
    U,
    Y,
)

PER_QUARTER: Final = 0.6366197723675814  # 2 / pi
# pi / 2 in parts of 33 bits, so that products with whole numbers below 2^20 are exact.
FIRST: Final = 1.57079632673412561417
SECOND: Final = 6.07710050630396597660e-11
THIRD: Final = 2.02226624879595063154e-21
WHOLE: Final = 6755399441055744.0  # 1.5 * 2^52: adding it rounds to a whole number


@compiled
def sine_and_cosine(b: FloatArray, lanes: int) -> None:
    """Fill SIN and COS from ANGLE."""
    for i in range(lanes):
        x = b[ANGLE + i]
        q = (x * PER_QUARTER + WHOLE) - WHOLE
        r = ((x - q * FIRST) - q * SECOND) - q * THIRD
        z = r * r
        s = r + r * z * (
            -1.0 / 6.0
            + z * (1.0 / 120.0 + z * (-1.0 / 5040.0 + z * (1.0 / 362880.0 + z * (-1.0 / 39916800.0 + z * (
                1.0 / 6227020800.0 + z * (-1.0 / 1307674368000.0 + z * (1.0 / 355687428096000.0)))))))
        )  # fmt: skip
        c = 1.0 + z * (
            -0.5
            + z * (1.0 / 24.0 + z * (-1.0 / 720.0 + z * (1.0 / 40320.0 + z * (-1.0 / 3628800.0 + z * (
                1.0 / 479001600.0 + z * (-1.0 / 87178291200.0 + z * (1.0 / 20922789888000.0)))))))
        )  # fmt: skip
        # What has flown off beyond all angles stays within a circle.
        s, c = min(max(s, -1.0), 1.0), min(max(c, -1.0), 1.0)
        quarter = q - 4.0 * ((q * 0.25 - 0.375 + WHOLE) - WHOLE)
        odd = quarter == 1.0 or quarter == 3.0
        sine, cosine = (c if odd else s), (s if odd else c)
        b[SIN + i] = -sine if quarter >= 2.0 else sine
        b[COS + i] = -cosine if quarter == 1.0 or quarter == 2.0 else cosine


@compiled
def rates(b: FloatArray, lanes: int, system: int, held: int) -> None:
    """Fill R from the stage's state, commands, parameters and forces; SIN and COS are of what turns."""
    if system == codes.CARTPOLE:
        for i in range(lanes):
            m, half = b[P2 + i], b[P3 + i]
            total, lever = b[P1 + i] + m, m * half
            push = b[U + i] + lever * b[Y3 + i] * b[Y3 + i] * b[SIN + i] + b[F + i]
            turn = m * b[P + i] * half * b[SIN + i] + b[F1 + i]
            m12, m22 = lever * b[COS + i], 4.0 / 3.0 * m * half * half
            determinant = total * m22 - m12 * m12
            b[R + i] = (m22 * push - m12 * turn) / determinant
            b[R1 + i] = (total * turn - m12 * push) / determinant
        # Where a force of constraint holds one coordinate still: what it does to both rates is as m22 to -m12 for the
        # cart, as -m12 to m11 for the pole.
        if held == 0:
            for i in range(lanes):
                b[R1 + i] += b[COS + i] / (4.0 / 3.0 * b[P3 + i]) * b[R + i]
                b[R + i] = 0.0
        elif held == 1:
            for i in range(lanes):
                b[R + i] += b[P2 + i] * b[P3 + i] * b[COS + i] / (b[P1 + i] + b[P2 + i]) * b[R1 + i]
                b[R1 + i] = 0.0
    elif system == codes.PENDULUM:
        for i in range(lanes):
            torque = b[U + i] + b[F + i]
            b[R + i] = (torque / (b[P1 + i] * b[P2 + i]) - b[P + i] * b[SIN + i]) / b[P2 + i]
    elif system == codes.SLIDER:
        for i in range(lanes):
            b[R + i] = (b[U + i] + b[F + i]) / b[P + i]
    elif system == codes.SERVO_JOINT:
        for i in range(lanes):
            wanted = b[P1 + i] * (b[U + i] - b[Y + i]) - b[P2 + i] * b[Y1 + i]
            given = clipped(wanted, -b[P3 + i], b[P3 + i])
            b[LOAD + i] = given
            b[R + i] = (given - b[P4 + i] * b[SIN + i] + b[F + i]) / b[P + i]
    elif system == codes.ACKERMANN:
        for i in range(lanes):
            b[R + i] = b[U + i]
            b[R1 + i] = 0.0
            b[R2 + i] = b[U + i] * math.tan(b[U1 + i]) / b[P + i]
    else:
        for i in range(lanes):
            b[R + i] = b[U + i]
            b[R1 + i] = 0.0
            b[R2 + i] = b[U1 + i]


@compiled
def turning(b: FloatArray, lanes: int, system: int) -> None:
    """Fill SIN and COS with those of what turns in the stage's state."""
    if system == codes.SLIDER:
        return
    if system == codes.PENDULUM or system == codes.SERVO_JOINT:
        for i in range(lanes):
            b[ANGLE + i] = b[Y + i]
    else:
        for i in range(lanes):
            b[ANGLE + i] = b[Y2 + i]
    sine_and_cosine(b, lanes)


@compiled
def slope(b: FloatArray, lanes: int, system: int, still: int) -> None:
    """Fill K with d state / dt of the stage; of states that are left out nothing."""
    if system == codes.CARTPOLE:
        for i in range(lanes):
            b[K + i] = b[Y1 + i]
            b[K + LANES + i] = b[R + i]
            b[K + 2 * LANES + i] = b[Y3 + i]
            b[K + 3 * LANES + i] = b[R1 + i]
    elif system == codes.PENDULUM or system == codes.SLIDER or system == codes.SERVO_JOINT:
        for i in range(lanes):
            b[K + i] = b[Y1 + i]
            b[K + LANES + i] = b[R + i]
    else:
        for i in range(lanes):
            b[K + i] = b[R + i] * b[COS + i] - b[R1 + i] * b[SIN + i]
            b[K + LANES + i] = b[R + i] * b[SIN + i] + b[R1 + i] * b[COS + i]
            b[K + 2 * LANES + i] = b[R2 + i]
    if still:
        for c in range(4):
            if still & (1 << c):
                for i in range(lanes):
                    b[K + c * LANES + i] = 0.0


@compiled
def mobility(b: FloatArray, lanes: int, system: int, held: int, on: int) -> None:
    """Fill M and M1 with what a unit force on a coordinate changes of the rates."""
    if system == codes.CARTPOLE:
        for i in range(lanes):
            m, half = b[P2 + i], b[P3 + i]
            m11, m12, m22 = b[P1 + i] + m, m * half * b[COS + i], 4.0 / 3.0 * m * half * half
            determinant = m11 * m22 - m12 * m12
            # Where the other coordinate is held, that takes off what it takes.
            alone = 1.0 / m22 if on else 1.0 / m11
            own = (m11 if on else m22) / determinant
            own, cross = (own, -m12 / determinant) if held < 0 else (alone, 0.0)
            b[M + i] = cross if on else own
            b[M1 + i] = own if on else cross
    elif system == codes.PENDULUM:
        for i in range(lanes):
            b[M + i] = 1.0 / (b[P1 + i] * b[P2 + i] * b[P2 + i])
    else:
        for i in range(lanes):
            b[M + i] = 1.0 / b[P + i]


@compiled
def normal_force(b: FloatArray, lanes: int, times: float) -> None:
    """Fill LOAD with the track's force on a cart-pole's cart, the rates changed by so many times M."""
    for i in range(lanes):
        turn = b[R1 + i] + times * b[M1 + i]
        lift = turn * b[SIN + i] + b[Y3 + i] * b[Y3 + i] * b[COS + i]
        b[LOAD + i] = (b[P1 + i] + b[P2 + i]) * b[P + i] - b[P2 + i] * b[P3 + i] * lift
