"""A batch through its substeps by compiled code, in as many threads as there are cores for."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec
from itertools import pairwise
from typing import Any

import numpy as np

from gpsim.channels import FloatArray, IntArray
from gpsim.effects import Chain
from gpsim.kernels import codes
from gpsim.kernels.program import Program
from gpsim.simulators import Memory

WORTH_A_THREAD = 50_000  # rows times substeps: below, a thread's start is not worth it


@dataclass(frozen=True)
class Commands:
    """What reaches the simulator, as far as it is known beforehand.

    acted: (U, K, A), the first `before` of the K before the window; which: (B,) the place in U of each row's; finely:
    they are one a substep, else one a transition. given: (W, L, A), what is commanded in the windows where what becomes
    of that depends on the state; at: the actuators at the windows' start, of U.
    """

    acted: FloatArray
    which: IntArray
    before: int
    finely: bool
    given: FloatArray | None = None
    at: Actuators | None = None


@dataclass(frozen=True)
class Actuators:
    """Actuators' table, what they remember (U, .), or (1, .) all rows alike, and whether their clock is uneven."""

    table: IntArray
    memories: FloatArray
    uneven: bool


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


def is_compiled() -> bool:
    """Whether nothing has to be compiled on this machine any more; the first time takes a minute."""
    if not can_compile():
        return True
    from gpsim.kernels import compiling  # with it comes numba

    return compiling.is_compiled()


def actuators_of(program: Program, memory: Memory, rows: int, *, even: bool) -> Actuators | None:
    """What compiled code needs of actuators in this state of memory; None where NumPy has to go on.

    even: whether the clock is.
    """
    if program.actuators is None:
        return None
    table, parts, uneven, at = program.actuators.copy(), [np.empty((rows, 0))], [], 0
    for line, i in zip(table, program.ways, strict=True):
        line[codes.MEMORY] = at
        if f"{i}/level" in memory:
            parts.append(memory[f"{i}/level"][:, None])
        elif f"{i}/past" in memory:
            line[codes.DEPTH] = memory[f"{i}/past"].shape[1]
            parts += [memory[f"{i}/past"], memory[f"{i}/length"], memory[f"{i}/head"][:, None]]
            uneven.append(bool(memory[f"{i}/uneven"].any()))
        at = sum(part.shape[1] for part in parts)
    if any(flag == even for flag in uneven):
        return None
    return Actuators(table, _own(np.concatenate(parts, axis=1)), not even)


def at_rest(program: Program, chain: Chain, step: float, *, even: bool) -> Actuators | None:
    """The same of actuators at rest on a grid of `step` s, the memory of one row for all, as `travelled` takes it."""
    memory = chain.actuation.rest(1, step)
    memory |= {key: np.full(1, float(not even)) for key in memory if key.endswith("/uneven")}
    return actuators_of(program, memory, 1, even=even)


def travelled(
    program: Program,
    n: int,
    values: FloatArray,
    clock: FloatArray,
    window: IntArray,
    given: FloatArray,
    actuators: Actuators,
    threads: int = 1,
    led: tuple[FloatArray, FloatArray] | None = None,
) -> FloatArray:
    """(U, L n, A) what reaches the simulator in the windows.

    given: (W, L, A) the windows' commands, of each row's `window` (U,); led: clock (W, M + 1) s and commands (W, M, A)
    of whole control steps that lead up to them, on an even clock. The actuators are as the first of all these finds
    them.
    """
    from gpsim.kernels.acting import travel  # which imports numba

    rows, (length, actions) = len(window), given.shape[1:]
    out = np.empty((rows, length * n, actions))
    layout = _layout(program, n, finely=True, uneven=actuators.uneven)
    earlier, told = led or (np.empty((len(clock), 1)), np.empty((len(clock), 0, actions)))
    tables = (layout, actuators.table, program.conditions, program.knots, _own(values))
    told_of = (_own(earlier), _own(told), _own(clock), window, _own(given))
    arguments = (*tables, *told_of, actuators.memories, out)
    _shared(travel, arguments, rows, rows * length * n, threads)
    return out


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
    bends: FloatArray | None = None,
) -> tuple[FloatArray, FloatArray]:
    """(B, L + 1, S) states at the transitions' ends; (B, D + L n, S) at the substeps' ends where the `past` matters.

    The first D of these are the past, the last of which is the start. n: substeps of a transition; starts: (B, S);
    values: `program.values`; clock: (W, L + 1) s, of each row's `window` (B,); bends: (B, 6) how far bristles
    are bent and drives twisted at the start.
    """
    from gpsim.kernels.march import march

    (rows, states), length = starts.shape, clock.shape[1] - 1
    at = commands.at or Actuators(np.empty((0, codes.ACTUATOR_WIDTH), np.int64), np.empty((0, 0)), False)
    memories = at.memories if len(at.memories) else np.empty((len(commands.acted), 0))
    layout = _layout(program, n, finely=commands.finely, uneven=at.uneven)
    out = np.empty((rows, length + 1, states))
    past = past or Past(0, np.empty((len(clock), 0)), np.zeros(len(clock), dtype=np.int64))
    passed = np.empty((rows, past.depth + length * n, states) if past.depth else (0, 0, 0))
    tables = (layout, program.terms, program.conditions, program.curves, program.knots, program.believed)
    told = (_own(values), _own(starts), _own(clock), _own(past.earlier), past.stood, window)
    known = (_own(commands.acted), commands.which, commands.before)
    given = np.empty((0, 0, 0)) if commands.given is None else _own(commands.given)
    bent = np.empty((rows, 0)) if bends is None else _own(bends)
    arguments = (*tables, program.kept, program.rest, at.table, *told, *known, given, memories, bent)
    _shared(march, (*arguments, out, passed, past.depth), rows, rows * length * n, threads)
    return out, passed


def read_late(
    passed: FloatArray,
    past: Past,
    n: int,
    column: int,
    late: FloatArray,
    steps: FloatArray,
    when: FloatArray,
    window: IntArray,
    out: FloatArray,
    *,
    lags: bool = False,
) -> None:
    """Change a column of the states out (B, L + 1, S) to what a sensor reads that is `late` (B,) s.

    lags: it follows with a lag of that time constant, and the states that were passed change, too. steps: (W, L + 1) s,
    a substep of the transition that ends there; when: (W, D + L n) s, when the states were that were passed, of no
    columns where the clock is even.
    """
    from gpsim.kernels.lateness import delay, lag

    read = lag if lags else delay
    read(passed, past.depth, n, column, _own(late), _own(steps), _own(when), window, out)


def _layout(program: Program, n: int, *, finely: bool, uneven: bool) -> IntArray:
    layout = program.layout.copy()
    layout[codes.SUBSTEPS], layout[codes.PER_SUBSTEP], layout[codes.UNEVEN] = n, int(finely), int(uneven)
    return layout


def _shared(
    function: Callable[..., None], arguments: tuple[Any, ...], rows: int, work: int, threads: int
) -> None:
    """Rows 0 to `rows` by as many threads as are worth their start."""
    parts = max(min(threads, work // WORTH_A_THREAD), 1)
    if parts == 1:
        function(*arguments, 0, rows)
        return
    edges = np.linspace(0, rows, parts + 1).astype(int)
    with ThreadPoolExecutor(parts - 1) as pool:
        begun = [pool.submit(function, *arguments, a, b) for a, b in pairwise(edges[1:])]
        function(*arguments, 0, edges[1])
        for other in begun:
            other.result()


def _own(array: FloatArray) -> FloatArray:
    """As compiled code takes it: in C's order, and free to be written to, though it does not."""
    if array.dtype == np.float64 and array.flags.carray:
        return array
    return np.require(array, dtype=np.float64, requirements=["C", "W"])
