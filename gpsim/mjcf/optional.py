"""MuJoCo, imported where it is needed: everything else of gpsim runs without it."""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from typing import Any

from gpsim.errors import UsageError

LEAST = (4, 0)  # mujoco.batch


@lru_cache(maxsize=1)
def mujoco() -> Any:
    """The package; raises UsageError where it is not installed, or too old."""
    try:
        import mujoco as package
    except ImportError as error:
        raise UsageError("a MuJoCo model needs mujoco: pip install 'gpsim[mujoco]'") from error
    said = str(package.__version__)
    if tuple(int(part) for part in said.split(".")[:2]) < LEAST:
        raise UsageError(
            f"a MuJoCo model needs mujoco 4 or later, installed is {said}: pip install -U 'gpsim[mujoco]'"
        )
    return package


@lru_cache(maxsize=1)
def batch() -> Any:
    """The module that steps many simulations of one model."""
    mujoco()
    from mujoco import batch as package

    return package


@contextmanager
def quiet() -> Iterator[None]:
    """Within it MuJoCo's warnings are counted, not printed nor written to a file: a fit tries unstable values, too."""
    mj = mujoco()
    before = mj.get_mju_user_warning()
    mj.set_mju_user_warning(_nothing())
    try:
        yield
    finally:
        mj.set_mju_user_warning(before)


@lru_cache(maxsize=1)
def _nothing() -> Any:
    """A C function of a text that does nothing of note: Python's own cannot be called from MuJoCo's threads."""
    length = ctypes.cast(ctypes.CDLL(None).strlen, ctypes.c_void_p).value
    assert length is not None
    return ctypes.CFUNCTYPE(None, ctypes.c_char_p)(length)
