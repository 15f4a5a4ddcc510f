"""What actuators make of commands: the forces of motors and servos, and activations that filter, integrate or flow.

A force is said in closed form, since MuJoCo says it a step later. An activation no recording holds: a filter forgets
and an integrator does not, so that the commands before say what theirs is; a current follows its voltage within
milliseconds, and begins where it would stay. Activations are (B, na), NaN where that is still to be found from the
first state: a servo's begins where its joint is, the others at 0.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from gpsim.channels import BoolArray, FloatArray, IntArray
from gpsim.errors import UsageError
from gpsim.mjcf.batches import Pool
from gpsim.mjcf.naming import Names, called
from gpsim.mjcf.optional import mujoco, quiet

KEY = "activations"
"""Under what a memory holds them."""


def motors_on(model: Any, names: Names) -> dict[str, tuple[int, ...]]:
    """Coordinate -> its actuators, where each one's force follows from its command and its joint alone."""
    found: dict[str, list[int]] = defaultdict(list)
    for i, action in enumerate(names.action.names):
        if action in names.drives:
            found[names.drives[action]].append(i)
    plain = {on: tuple(own) for on, own in found.items() if all(plain_drive(model, i) for i in own)}
    return {on: own for on, own in plain.items() if on in {c.name for c in names.coordinates}}


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
    gains, biases = (fields.get(n, getattr(model, n)) for n in ("actuator_gainprm", "actuator_biasprm"))
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


@dataclass(frozen=True)
class Activations:
    """Of every activation its actuator, time constant [s] and limits; if it integrates, is a current, a servo's."""

    actuators: IntArray
    constants: FloatArray
    low: FloatArray
    high: FloatArray
    integrates: BoolArray
    flows: BoolArray
    follows: BoolArray

    def __bool__(self) -> bool:
        return len(self.actuators) > 0

    def rest(self, count: int) -> FloatArray:
        """(B, na) where an episode begins: no current flows."""
        return np.where(self.flows, 0.0, np.full((count, len(self.actuators)), np.nan))

    def held(self, command: FloatArray) -> FloatArray:
        """(B, na) where a command (B, A) is all that is known: what it was long ago, of an integrator what it is."""
        return np.where(self.flows, np.nan, np.clip(command[:, self.actuators], self.low, self.high))

    def after(
        self, commands: FloatArray, steps: FloatArray, first: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """(B, na) what they are after commands (B, K, A), each held so long (B, K) s; (B, K, na) their means meanwhile.

        Exact but for limits that are reached on the way. Of a current: what it is not known to be.
        """
        given, level, means = commands[:, :, self.actuators], np.array(first), []
        for u, h in zip(given.transpose(1, 0, 2), steps.T[:, :, None], strict=True):
            far = np.maximum(h, 1e-12) / self.constants
            mean = u + (level - u) * -np.expm1(-far) / far
            end = np.where(self.integrates, level + h * u, u + (level - u) * np.exp(-far))
            means.append(np.clip(np.where(self.integrates, level + h / 2 * u, mean), self.low, self.high))
            level = np.clip(end, self.low, self.high)
        return np.where(self.flows, np.nan, level), np.stack(means, axis=1)

    def begin(self, pool: Pool, known: FloatArray) -> None:
        """Write what is known of the first simulations, which have their states and commands, and find the rest."""
        count, b = len(known), pool.simulations
        act, slopes, lengths = (b.bind(name) for name in ("act", "act_dot", "actuator_length"))
        act[:count] = np.where(np.isnan(known), 0.0, known)
        if not np.isnan(known).any():
            return
        with quiet():
            b.forward(np.arange(count))
        there = np.where(self.follows, lengths[:count][:, self.actuators], 0.0)
        settled = np.where(self.flows, self.constants * slopes[:count], there)
        act[:count] = np.where(np.isnan(known), np.clip(settled, self.low, self.high), known)


def activations_of(model: Any, where: str) -> Activations:
    """Those of a model; raises UsageError for what nothing tells: muscles, and more than a current of a DC motor."""
    dyn, own = mujoco().mjtDyn, [i for i in range(model.nactuator) if model.actuator_actnum[i]]
    kinds = model.actuator_dyntype[own]
    kept = dyn.mjDYN_INTEGRATOR, dyn.mjDYN_FILTER, dyn.mjDYN_FILTEREXACT, dyn.mjDYN_DCMOTOR
    for i, kind in zip(own, kinds, strict=True):
        current = float(model.actuator_dynprm[i, 0]) > 0.0 and int(model.actuator_actnum[i]) == 1
        if int(kind) not in map(int, kept) or (kind == dyn.mjDYN_DCMOTOR and not current):
            raise UsageError(
                f"{where}: {called(model, 'actuator', i)} has an activation that the commands do not determine (a "
                "muscle, a controller's integral, heat, bristles); remove it from the model"
            )
    limited = np.asarray(model.actuator_actlimited, dtype=np.bool_)[own]
    ends = model.actuator_actrange[own]
    return Activations(
        np.array(own, dtype=np.int64),
        np.maximum(model.actuator_dynprm[own, 0], 1e-9),
        np.where(limited, ends[:, 0], -np.inf),
        np.where(limited, ends[:, 1], np.inf),
        kinds == int(dyn.mjDYN_INTEGRATOR),
        kinds == int(dyn.mjDYN_DCMOTOR),
        model.actuator_biasprm[own, 1] != 0.0,
    )
