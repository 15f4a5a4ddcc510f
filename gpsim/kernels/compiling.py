"""Functions that numba compiles, once a machine: what it makes is kept in a folder that this room's sources name.

This file is imported by files of the room that hold such functions, and they by nobody until something is compiled
(see `gpsim.kernels.program`): numba takes longer to be imported than `gpsim --help` to answer.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, TypeVar

import numba

Function = TypeVar("Function", bound=Callable[..., Any])
ROOM = Path(__file__).parent
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
        with _kept_in(folder()):
            made: Any = numba.njit(signature, nogil=True, error_model="numpy", cache=True)(function)
        return made  # type: ignore[no-any-return]  # called as the function itself

    return make


def folder() -> Path:
    """Where compiled functions are kept: in the package where it may be written to, else in the user's cache.

    Numba looks at the one file that holds a function, and would not see that a law in another one has changed: the
    folder is named by all of them.
    """
    digest = hashlib.sha256()
    for path in sorted(ROOM.glob("*.py")):
        digest.update(path.read_bytes())
    name = f"kernels-{digest.hexdigest()[:16]}"
    given = os.environ.get("NUMBA_CACHE_DIR")
    if given:
        return Path(given) / name
    for parent in (ROOM / "__pycache__", _users_cache() / "gpsim"):
        with suppress(OSError):
            (parent / name).mkdir(parents=True, exist_ok=True)
            if os.access(parent / name, os.W_OK):
                return parent / name
    return Path(tempfile.gettempdir()) / f"gpsim-{os.getuid()}-{name}"


def _users_cache() -> Path:
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")


@contextmanager
def _kept_in(place: Path) -> Iterator[None]:
    """Within it numba keeps what it compiles in `place`."""
    before = numba.config.CACHE_DIR  # type: ignore[attr-defined]  # set when numba is imported
    numba.config.CACHE_DIR = str(place)  # type: ignore[attr-defined]
    try:
        yield
    finally:
        numba.config.CACHE_DIR = before  # type: ignore[attr-defined]
