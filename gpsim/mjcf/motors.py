"""What motors and servos give at the joints that they drive: in closed form, since MuJoCo says it a step later."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from typing import Any

import numpy as np

from gpsim.channels import FloatArray
from gpsim.mjcf.naming import Names
from gpsim.mjcf.optional import mujoco


def motors_on(model: Any, names: Names) -> dict[str, tuple[int, ...]]:
    """Coordinate -> its actuators, where each one's force follows from its command and its joint alone."""
    found: dict[str, list[int]] = defaultdict(list)
    for i, action in enumerate(names.action.names):
        if action in names.drives:
            found[names.drives[action]].append(i)
    moved = {c.name for c in names.coordinates}
    return {
        on: tuple(own) for on, own in found.items() if on in moved and all(plain_drive(model, i) for i in own)
    }


def given(
    model: Any,
    motors: tuple[int, ...],
    command: FloatArray,
    position: FloatArray,
    speed: FloatArray,
    fields: Mapping[str, FloatArray],
) -> FloatArray:
    """(B,): the force at a joint of actuators under commands (B, A); fields (B, ...): where they are not the model's.

    The gain times the command, and a bias by length and speed, within the actuator's range (MuJoCo, "Computation",
    "Force generation"), within the joint's.
    """
    gains, biases = (
        fields.get(name, getattr(model, name)) for name in ("actuator_gainprm", "actuator_biasprm")
    )
    total = np.zeros(len(command))
    for i in motors:
        gear = float(model.actuator_gear[i, 0])
        bias = biases[..., i, :]
        force = gains[..., i, 0] * command[:, i]
        if int(model.actuator_biastype[i]) == mujoco().mjtBias.mjBIAS_AFFINE:
            force = force + bias[..., 0] + gear * (bias[..., 1] * position + bias[..., 2] * speed)
        if model.actuator_forcelimited[i]:
            force = np.clip(force, *model.actuator_forcerange[i])
        total += gear * force
    joint = int(model.actuator_trnid[motors[0], 0])
    return np.clip(total, *model.jnt_actfrcrange[joint]) if model.jnt_actfrclimited[joint] else total


def plain_drive(model: Any, index: int) -> bool:
    """Whether an actuator's force follows from its command and its joint alone: no activation, and no function."""
    mj = mujoco()
    gain, bias = int(model.actuator_gaintype[index]), int(model.actuator_biastype[index])
    fixed = gain == mj.mjtGain.mjGAIN_FIXED and not model.actuator_actnum[index]
    return fixed and bias in (mj.mjtBias.mjBIAS_NONE, mj.mjtBias.mjBIAS_AFFINE)
