"""A batch through its substeps by compiled code, in as many threads as there are cores for."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec
from itertools import pairwise

import numpy as np

from gpsim.channels import FloatArray, IntArray
from gpsim.kernels import codes
from gpsim.kernels.program import Program

WORTH_A_THREAD = 50_000  # rows times substeps: below, a thread's start is not worth it


@dataclass(frozen=True)
class Commands:
    """What reaches the simulator, known beforehand.

    acted: (U, K, A), the first `before` of the K before the window; which: (B,) the place in U of each row's; finely:
    they are one a substep, else one a transition.
    """

    acted: FloatArray
    which: IntArray
    before: int
    finely: bool


@dataclass(frozen=True)
class Past:
    """What was before windows: `depth` states up to their start are wanted.

    earlier: (W, M + 1) s, the clock up to their start, (W, 0) where it is even; stood: (W,) 1 where nothing had moved.
    """

    depth: int
    earlier: FloatArray
    stood: IntArray


@cache
def can_compile() -> bool:
    """Whether numba is there."""
    return find_spec("numba") is not None


def marched(
    program: Program,
    n: int,
    starts: FloatArray,
    values: FloatArray,
    clock: FloatArray,
    window: IntArray,
    commands: Commands,
    threads: int = 1,
    past: Past | None = None,
) -> tuple[FloatArray, FloatArray]:
    """(B, L + 1, S) states at the transitions' ends; (B, D + L n, S) at the substeps' ends where the `past` matters.

    The first D of these are the past, the last of which is the start. n: substeps of a transition; starts: (B, S);
    values: `program.values`; clock: (W, L + 1) s, of each row's `window` (B,).
    """
    from gpsim.kernels.march import march  # which imports numba

    (rows, states), length = starts.shape, clock.shape[1] - 1
    layout = program.layout.copy()
    layout[codes.SUBSTEPS], layout[codes.PER_SUBSTEP] = n, int(commands.finely)
    out = np.empty((rows, length + 1, states))
    past = past or Past(0, np.empty((len(clock), 0)), np.zeros(len(clock), dtype=np.int64))
    passed = np.empty((rows, past.depth + length * n, states) if past.depth else (0, 0, 0))
    tables = (layout, program.terms, program.conditions, program.curves, program.knots, program.believed)
    given = (_own(values), _own(starts), _own(clock), _own(past.earlier), past.stood, window)
    told = (_own(commands.acted), commands.which, commands.before)
    arguments = (*tables, program.kept, program.rest, *given, *told, out, passed, past.depth)
    parts = max(min(threads, rows * length * n // WORTH_A_THREAD), 1)
    edges = np.linspace(0, rows, parts + 1).astype(int)
    if parts == 1:
        march(*arguments, 0, rows)
        return out, passed
    with ThreadPoolExecutor(parts - 1) as pool:
        begun = [pool.submit(march, *arguments, a, b) for a, b in pairwise(edges[1:])]
        march(*arguments, 0, edges[1])
        for other in begun:
            other.result()
    return out, passed


def _own(array: FloatArray) -> FloatArray:
    """As compiled code takes it: in C's order, and free to be written to, though it does not."""
    return np.require(array, dtype=np.float64, requirements=["C", "W"])
