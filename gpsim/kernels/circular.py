"""Sine and cosine of many numbers at once, to the last bit or two up to a million.

Cody and Waite (1980), Software Manual for the Elementary Functions: a multiple of pi/2 is taken off in three parts; the
rest is put into Taylor polynomials that end below rounding on [-pi/4, pi/4].
"""

from __future__ import annotations

from typing import Final

from gpsim.channels import FloatArray
from gpsim.kernels.compiling import compiled
from gpsim.kernels.lanes import ANGLE, COS, SIN

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
