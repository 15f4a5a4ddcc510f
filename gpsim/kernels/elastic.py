"""Elastic drives for lanes of rows (see `gpsim.effects.elastic`)."""

from __future__ import annotations

import math

from gpsim.channels import FloatArray, IntArray
from gpsim.kernels.codes import CURVE, ELASTIC, FORCES, HELD, LAW, ON, SYSTEM, VALUE
from gpsim.kernels.compiling import compiled
from gpsim.kernels.lanes import FREE, GIVEN, LANES, LIGHT, TWIST, X1, Y1, H, R, U
from gpsim.kernels.scalars import larger, place
from gpsim.kernels.systems import rates, turning

CRITICAL = 1e-6


@compiled
def waves(gamma: float, square: float, step: float) -> tuple[float, float]:
    """e^-gh cosh(r h) and e^-gh sinh(r h) / r of an oscillator."""
    root = math.sqrt(abs(gamma * gamma - square))
    angle, faded = root * step, math.exp(-gamma * step)
    if gamma * gamma > square:
        slow, fast = math.exp(-square / (gamma + root) * step), math.exp(-(gamma + root) * step)
        cosh, sinh = (slow + fast) / 2, (slow - fast) / 2
    else:
        cosh, sinh = faded * math.cos(angle), faded * math.sin(angle)
    return cosh, faded * step if angle < CRITICAL else sinh / root


@compiled
def twisted(
    twist: float, rate: float, push: float, reacts: float, step: float, v: FloatArray, n: int, i: int
) -> tuple[float, float, float]:
    """Twist and its rate after a substep, and the mean of what it transmits; the values of row i begin at n."""
    light = 1.0 / v[n + 2, i] + reacts
    square, gamma = light * v[n, i], light * v[n + 1, i] / 2
    cosh, sinh = waves(gamma, square, step)
    rest = push / square
    end = rest + (cosh + gamma * sinh) * (twist - rest) + sinh * rate
    speed = -square * sinh * (twist - rest) + (cosh - gamma * sinh) * rate
    return end, speed, (push - (speed - rate) / step) / light


@compiled
def react(b: FloatArray, lanes: int, layout: IntArray, on: int, u: int) -> None:
    """Fill FREE with how a coordinate is accelerated without its command, LIGHT with what a unit of that adds."""
    own = place(R + on * LANES)
    for i in range(lanes):
        b[u + i] = 0.0
    rates(b, lanes, layout[SYSTEM], layout[HELD])
    for i in range(lanes):
        b[FREE + i], b[u + i] = b[own + i], 1.0
    rates(b, lanes, layout[SYSTEM], layout[HELD])
    for i in range(lanes):
        b[LIGHT + i] = b[own + i] - b[FREE + i]


@compiled
def transmit(b: FloatArray, lanes: int, layout: IntArray, terms: IntArray, v: FloatArray) -> None:
    """Change U to what elastic drives transmit of it, a mean over the substep."""
    for n in range(layout[FORCES]):
        if terms[n, LAW] == ELASTIC:
            u, at, z = (
                place(U + terms[n, CURVE] * LANES),
                terms[n, VALUE],
                place(TWIST + 2 * terms[n, CURVE] * LANES),
            )
            for i in range(lanes):
                b[GIVEN + i] = b[u + i]
            react(b, lanes, layout, terms[n, ON], u)
            for i in range(lanes):
                held = v[at, i] * b[z + i] + v[at + 1, i] * b[z + LANES + i]
                push = b[GIVEN + i] / v[at + 2, i] - b[FREE + i]
                _, _, mean = twisted(
                    b[z + i], b[z + LANES + i], push, b[LIGHT + i], larger(b[H + i], 1e-9), v, at, i
                )
                b[u + i] = held if b[H + i] < 0.0 else mean


@compiled
def turn_on(b: FloatArray, lanes: int, layout: IntArray, terms: IntArray, v: FloatArray) -> None:
    """Twist elastic drives on, from X to Y, over a substep, by what drives gave in U; not back in time."""
    for n in range(layout[FORCES]):
        if terms[n, LAW] == ELASTIC:
            on, at = terms[n, ON], terms[n, VALUE]
            u, z = place(U + terms[n, CURVE] * LANES), place(TWIST + 2 * terms[n, CURVE] * LANES)
            begun, ended = place(X1 + 2 * on * LANES), place(Y1 + 2 * on * LANES)
            for i in range(lanes):
                b[GIVEN + i] = b[u + i]
            turning(b, lanes, layout[SYSTEM])
            react(b, lanes, layout, on, u)
            for i in range(lanes):
                b[u + i], h, free = b[GIVEN + i], larger(b[H + i], 1e-9), b[GIVEN + i] / v[at + 2, i]
                moved, reacts = (b[ended + i] - b[begun + i]) / h, b[LIGHT + i]
                _, _, mean = twisted(b[z + i], b[z + LANES + i], free, reacts, h, v, at, i)
                _, _, less = twisted(0.0, 0.0, 1.0, reacts, h, v, at, i)
                own = (moved - reacts * mean) / (1.0 - reacts * less)
                end, speed, _ = twisted(b[z + i], b[z + LANES + i], free - own, reacts, h, v, at, i)
                if b[H + i] >= 0.0:
                    b[z + i], b[z + LANES + i] = end, speed
