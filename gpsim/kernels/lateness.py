"""What late sensors, and those with a lag, read of states that were passed (see `gpsim.effects.families`)."""

from __future__ import annotations

import numpy as np

from gpsim.channels import FloatArray, IntArray
from gpsim.effects import SensorLag
from gpsim.kernels.compiling import compiled, entry

CLOSE = 0.05  # of the longest of three steps: through states nearer to each other goes a line
trail, rest = compiled(SensorLag.law), compiled(SensorLag.rest)
I1, F1, F2, F3 = "int64[::1]", "float64[::1]", "float64[:, ::1]", "float64[:, :, ::1]"


@entry(f"void({F3}, int64, int64, int64, {F1}, {F2}, {F2}, {I1}, {F3})")
def delay(
    passed: FloatArray,
    depth: int,
    n: int,
    column: int,
    late: FloatArray,
    steps: FloatArray,
    when: FloatArray,
    window: IntArray,
    out: FloatArray,
) -> None:
    """Add to a column of out (B, L + 1, S) what it was a delay (B,) s ago less what it is.

    passed: (B, depth + L n, S) states, the first `depth` of them up to a window's start; steps: (W, L + 1) s, a substep
    of the transition that ends there; when: (W, depth + L n) s, of no columns where the clock is even.
    """
    nodes = min(4, depth)
    age, was = np.empty(4), np.empty(4)
    for row in range(len(out)):
        w = window[row]
        for k in range(out.shape[1]):
            newest = depth - 1 + k * n
            total, now = 0.0, passed[row, newest, column]
            if when.shape[1] == 0:
                back = min(late[row] / steps[w, k], depth - 2.0)
                first = min(max(int(back) - 1, 0), max(depth - 4, 0))
                for i in range(nodes):
                    weight = 1.0
                    for j in range(nodes):
                        if j != i:
                            weight *= (back - first - j) / (i - j)
                    total += weight * passed[row, newest - first - i, column]
            else:
                moment = min(late[row], when[w, newest] - when[w, newest - depth + 1])
                before = 0
                while before < depth - 1 and when[w, newest] - when[w, newest - before - 1] <= moment:
                    before += 1
                before = min(before, depth - 2)
                first = min(max(before - 1, 0), max(depth - 4, 0))
                for i in range(nodes):
                    age[i] = when[w, newest] - when[w, newest - first - i]
                    was[i] = passed[row, newest - first - i, column]
                shortest, longest = np.inf, -np.inf
                for i in range(nodes - 1):
                    shortest, longest = min(shortest, age[i + 1] - age[i]), max(longest, age[i + 1] - age[i])
                if shortest > CLOSE * longest:
                    for i in range(nodes):
                        weight = 1.0
                        for j in range(nodes):
                            if j != i:
                                weight *= (moment - age[j]) / (age[i] - age[j])
                        total += weight * was[i]
                else:
                    place = before - first
                    near, far = age[place], age[place + 1]
                    share = (moment - near) / (far - near if far > near else 1.0)
                    share = min(max(share, 0.0), 1.0)
                    total = was[place] + share * (was[place + 1] - was[place])
            out[row, k, column] += total - now


@entry(f"void({F3}, int64, int64, int64, {F1}, {F2}, {F2}, {I1}, {F3})")
def lag(
    passed: FloatArray,
    depth: int,
    n: int,
    column: int,
    constant: FloatArray,
    steps: FloatArray,
    when: FloatArray,
    window: IntArray,
    out: FloatArray,
) -> None:
    """Change a column of out (B, L + 1, S), and of passed, to what follows it with a time `constant` (B,) s.

    The other arrays are those of `delay`. Before the first state a straight line led to it, if two are known.
    """
    for row in range(len(out)):
        w, lasting = window[row], constant[row]
        last, behind = passed[row, 0, column], 0.0
        for m in range(passed.shape[1]):
            now = passed[row, m, column]
            if m > 0:
                if when.shape[1]:
                    h = when[w, m] - when[w, m - 1]
                else:
                    h = steps[w, (m - depth) // n + 1 if m >= depth else 0]
                behind, last = trail(now, h, behind, last, lasting)
            elif depth > 1:
                h = when[w, 1] - when[w, 0] if when.shape[1] else steps[w, 0]
                behind, last = rest(now, (passed[row, 1, column] - now) / max(h, 1e-12), lasting)
            else:
                last = now
            passed[row, m, column] = now - behind
            if m >= depth - 1 and (m - depth + 1) % n == 0:
                out[row, (m - depth + 1) // n, column] -= behind
