"""What a compiled model must be before anything is made of it: of a sane step and size, finite, and able to move."""

from __future__ import annotations

from typing import Any

import numpy as np

from gpsim.errors import Terminated, UsageError
from gpsim.limits import MODEL_BODIES, MODEL_JOINTS, allowed, more
from gpsim.mjcf.faults import one_line
from gpsim.mjcf.optional import mujoco

SHORTEST, LONGEST = 1e-6, 1.0  # s, the steps of models
FINITE = ("qpos0", "body_", "jnt_", "dof_", "actuator_", "geom_")
"""Fields of a model, or how their names begin, in which every number is finite."""


def check_model(model: Any, where: str) -> None:
    """Raises UsageError for a model that no simulation can be made of. where: what the message calls it."""
    step = float(model.opt.timestep)
    if not SHORTEST <= step <= LONGEST:
        raise UsageError(
            f"{where}: its timestep is {step:g} s, gpsim takes steps of {SHORTEST:g} to {LONGEST:g} s; "
            "mend timestep in <option>"
        )
    for what, found, limit in (
        ("bodies", int(model.nbody), MODEL_BODIES),
        ("degrees of freedom", int(model.nv), MODEL_JOINTS),
    ):
        if found > allowed(limit):
            raise UsageError(
                f"{where}: it has {found} {what}, the limit is {allowed(limit)}; {more(found, limit)}"
            )
    _check_text(model, where)
    for name in dir(model):
        if name.startswith(FINITE):
            _check_finite(getattr(model, name), name, where)
    _check_finite(model.opt.gravity, "gravity", where)
    _check_moves(model, where)


def _check_text(model: Any, where: str) -> None:
    """MuJoCo takes any bytes for a name, and Python cannot ask for one that is no text."""
    try:
        bytes(model.names).decode()
    except UnicodeDecodeError as error:
        raise UsageError(
            f"{where}: a name in it is no UTF-8 text; save the model's files as UTF-8"
        ) from error


def _check_finite(values: Any, name: str, where: str) -> None:
    if isinstance(values, np.ndarray) and values.dtype.kind == "f" and np.isnan(values).any():
        row = int(np.argwhere(np.isnan(values))[0][0])
        raise UsageError(f"{where}: {name} of number {row} is not a number (nan); fix it in the model")


def _check_moves(model: Any, where: str) -> None:
    """MuJoCo ends a simulation, not only a step, where its memory is too small for what touches."""
    mj = mujoco()
    try:
        mj.mj_forward(model, mj.MjData(model))
    except Terminated:
        raise
    except Exception as error:
        raise UsageError(f"{where}: MuJoCo cannot simulate it: {one_line(error)}") from error
