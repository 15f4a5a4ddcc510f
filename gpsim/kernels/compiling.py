"""Functions that numba compiles, once a machine: what it makes is kept in a folder that this room's sources name.

What lies there is run as it is found, so nobody else may be able to write there.

This file is imported by files of the room that hold such functions, and they by nobody until something is compiled
(see `gpsim.kernels.program`): numba takes longer to be imported than `gpsim --help` to answer.
"""

from __future__ import annotations

import hashlib
import math
import multiprocessing
import os
import tempfile
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import numba

from gpsim.private import ExposedError, own_folder

Function = TypeVar("Function", bound=Callable[..., Any])
ROOM = Path(__file__).parent
FAMILIES = ROOM.parent / "effects" / "families"  # whose laws are compiled, too
I1, I2, F1, F2, F3 = "int64[::1]", "int64[:, ::1]", "float64[::1]", "float64[:, ::1]", "float64[:, :, ::1]"
"""Types of arrays in signatures: of whole numbers and others, of one to three dimensions."""
UNCALLED: Any = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
"""Python never calls it: what would let it is not made, which saves a tenth of the compilation."""


def compiled(function: Function) -> Function:
    """A function that is called by compiled ones alone; it becomes a part of them."""
    made: Any = numba.njit(nogil=True, error_model="numpy", **UNCALLED)(function)
    return made  # type: ignore[no-any-return]  # called as the function itself


def entry(signature: str) -> Callable[[Function], Function]:
    """A function that Python calls: compiled for these types when it is made, or read from disk."""

    def make(function: Function) -> Function:
        place = folder()
        with _kept_in(place):
            made: Any = numba.njit(signature, nogil=True, error_model="numpy", cache=place is not None)(
                function
            )
        return made  # type: ignore[no-any-return]  # called as the function itself

    return make


def folder() -> Path | None:
    """Where compiled functions are kept: in the package where it may be written to, else in a folder of the user's own.

    That is in the user's cache or in the temporary folder; None where others can write there, too. Numba looks at the
    one file that holds a function, and would not see that a law in another one has changed: the folder is named by all
    of them.
    """
    digest = hashlib.sha256()
    for path in [*sorted(ROOM.glob("*.py")), *sorted(FAMILIES.glob("*.py"))]:
        digest.update(path.read_bytes())
    name = f"kernels-{digest.hexdigest()[:16]}"
    given = os.environ.get("NUMBA_CACHE_DIR")
    if given:
        return Path(given) / name
    with suppress(OSError):
        package = ROOM / "__pycache__" / name
        package.mkdir(parents=True, exist_ok=True)
        if os.access(package, os.W_OK):
            return package
    refused = []
    for users in (_users_cache, _temporary):
        try:
            place = own_folder(own_folder(users()) / name)
            if os.access(place, os.W_OK):
                return place
        except (OSError, RuntimeError, ExposedError) as error:
            refused.append(str(error))
    _say_once(f"compiled functions cannot be stored; each process compiles them: {'; '.join(refused)}")
    return None


def is_compiled() -> bool:
    """Whether this machine has compiled anything yet: the first time takes a minute."""
    place = folder()
    return place is not None and any(place.glob("*.nbi"))


def _users_cache() -> Path:
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "gpsim"


def _temporary() -> Path:
    return Path(tempfile.gettempdir()) / f"gpsim-{os.getuid()}"


@cache
def _say_once(text: str) -> None:
    if multiprocessing.parent_process() is None:  # whoever started a worker has said it
        warnings.warn(f"{text}; give NUMBA_CACHE_DIR=FOLDER of your own", UserWarning, stacklevel=2)


@contextmanager
def _kept_in(place: Path | None) -> Iterator[None]:
    """Within it numba keeps what it compiles in `place`."""
    if place is None:
        yield
        return
    before = numba.config.CACHE_DIR  # type: ignore[attr-defined]  # set when numba is imported
    numba.config.CACHE_DIR = str(place)  # type: ignore[attr-defined]
    try:
        yield
    finally:
        numba.config.CACHE_DIR = before  # type: ignore[attr-defined]


FAR = 1e6  # what a diverging simulation is clipped to: far beyond any state, and its square is still a number


@compiled
def place(at: int) -> int:
    """An offset that is not negative, which the compiler then knows: no index is counted from an array's end.

    Loops over lanes from an offset that is found while it runs become vectors only so.
    """
    return max(at, 0)


@compiled
def larger(a: float, b: float) -> float:
    """As np.maximum: not a number where one of them is not."""
    return a if a >= b or a != a else b


@compiled
def smaller(a: float, b: float) -> float:
    """As np.minimum."""
    return a if a <= b or a != a else b


@compiled
def clipped(x: float, low: float, high: float) -> float:
    """As np.clip."""
    return smaller(larger(x, low), high)


@compiled
def sign(x: float) -> float:
    """As np.sign: 0 of both zeros."""
    return 1.0 if x > 0.0 else (-1.0 if x < 0.0 else (0.0 if x == 0.0 else x))


@compiled
def wrapped(angle: float) -> float:
    """As `gpsim.channels.wrap_angle`: [rad] in [-pi, pi)."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


@compiled
def clip_diverged(x: float) -> float:
    """A state that may have diverged, within FAR."""
    return FAR if x != x else min(max(x, -FAR), FAR)


@compiled
def blended(share: float, acted: float, untouched: float) -> float:
    """As `gpsim.effects.actuation.blended`."""
    return acted if share == 1.0 else share * acted + (1.0 - share) * untouched
