"""MuJoCo, imported where it is needed: everything else of gpsim runs without it."""

from __future__ import annotations

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
