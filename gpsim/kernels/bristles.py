"""Friction with bristles for lanes of rows (see `gpsim.effects.bristles`)."""

from __future__ import annotations

import math

from gpsim.channels import FloatArray, IntArray
from gpsim.kernels.codes import BRISTLES, CARTPOLE, DRY, HELD, LAW, ON, PARAMETERS, SYSTEM, VALUE
from gpsim.kernels.compiling import compiled
from gpsim.kernels.lanes import BENT, LANES, M1, R1, X1, Y1, H, M, R
from gpsim.kernels.scalars import larger, place
from gpsim.kernels.systems import mobility

ROUNDS, EXACT = 60, 1e-12


@compiled
def level(force: float, still: float, slow: float, speed: float) -> float:
    """What slides at a speed."""
    more = larger(still - force, 0.0)
    return larger(force + (more * math.exp(-((speed / slow) ** 2)) if more > 0.0 else 0.0), 1e-300)


@compiled
def shares(a: float) -> tuple[float, float]:
    """(1 - e^-a) / a and what is left of 1, over a."""
    first = 1.0 - a / 2 if a < 1e-5 else -math.expm1(-a) / a
    second = 0.5 - a / 6 + a * a / 24 if a < 1e-3 else (1.0 + math.expm1(-a) / a) / a
    return first, second


@compiled
def missed(
    at: float,
    free: float,
    reacts: float,
    h: float,
    bend: float,
    damping: float,
    v: FloatArray,
    n: int,
    i: int,
) -> tuple[float, float]:
    """By how much a mean speed is not the one that its own mean force makes, and that force."""
    stiffness, way = v[n + 3, i], at * h
    a = stiffness * abs(way) / level(v[n, i], v[n + 1, i], v[n + 2, i], at)
    first, second = shares(a)
    end = bend * math.exp(-a) + way * first
    force = -(stiffness * (bend * first + way * second) + damping * (end - bend) / h)
    return at - free - h / 2 * reacts * force, force


@compiled
def mean_force(
    bend: float, speed: float, own: float, reacts: float, step: float, v: FloatArray, n: int, i: int
) -> float:
    """The mean force over a substep; the values of row i begin at n."""
    stiffness: float = v[n + 3, i]
    if step < 0.0:
        return -stiffness * bend
    h = larger(step, 1e-9)
    damping, free = math.sqrt(stiffness / reacts), speed + h / 2 * own
    furthest = larger(abs(bend), level(v[n, i], v[n + 1, i], v[n + 2, i], 0.0) / stiffness)
    most = h / 2 * reacts * (stiffness + 2 * damping / h) * furthest
    low, high = free - most, free + most
    left, force = missed(low, free, reacts, h, bend, damping, v, n, i)
    right, force = missed(high, free, reacts, h, bend, damping, v, n, i)
    close = EXACT * (abs(speed) + abs(free) + most)
    for _ in range(ROUNDS):
        at = high - right * (high - low) / (1.0 if right == left else right - left)
        off, force = missed(at, free, reacts, h, bend, damping, v, n, i)
        if abs(off) <= close:
            break
        if off * right < 0.0:
            low, left = high, right
        else:
            left *= 0.5
        high, right = at, off
    return force


@compiled
def yield_on(b: FloatArray, lanes: int, layout: IntArray, terms: IntArray, n: int, v: FloatArray) -> None:
    """Add to R what the bristles of the term n change."""
    on, at = terms[n, ON], terms[n, VALUE]
    mobility(b, lanes, layout[SYSTEM], layout[HELD], on)
    own, reacts, begun = place(R + on * LANES), place(M + on * LANES), place(X1 + 2 * on * LANES)
    bend = place(BENT + on * LANES)
    for i in range(lanes):
        force = mean_force(b[bend + i], b[begun + i], b[own + i], b[reacts + i], b[H + i], v, at, i)
        b[R + i] += b[M + i] * force
        if layout[SYSTEM] == CARTPOLE:
            b[R1 + i] += b[M1 + i] * force


@compiled
def bend_on(b: FloatArray, lanes: int, layout: IntArray, terms: IntArray, v: FloatArray) -> None:
    """Bend bristles on from X to Y, over a substep; not back in time."""
    for n in range(layout[DRY], layout[PARAMETERS]):
        if terms[n, LAW] == BRISTLES:
            at, on = terms[n, VALUE], terms[n, ON]
            bend, begun, ended = (
                place(BENT + on * LANES), place(X1 + 2 * on * LANES), place(Y1 + 2 * on * LANES)
            )  # fmt: skip
            for i in range(lanes):
                if b[H + i] >= 0.0:
                    speed = 0.5 * (b[begun + i] + b[ended + i])
                    way = speed * b[H + i]
                    a = v[at + 3, i] * abs(way) / level(v[at, i], v[at + 1, i], v[at + 2, i], speed)
                    first, _ = shares(a)
                    b[bend + i] = b[bend + i] * math.exp(-a) + way * first
