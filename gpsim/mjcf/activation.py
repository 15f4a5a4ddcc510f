"""What actuators with an activation of their own have made of commands: filters, integrators, a DC motor's current.

No recording holds it. A filter forgets and an integrator does not, so that the commands before say what theirs is; a
current follows its voltage within milliseconds, and begins where it would stay. Activations are (B, na), NaN where that
is still to be found from the first state: a servo's begins where its joint is, the others at 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from gpsim.channels import BoolArray, FloatArray, IntArray
from gpsim.errors import UsageError
from gpsim.mjcf.batches import Pool
from gpsim.mjcf.optional import mujoco, quiet

KEY = "activations"
"""Under what a memory holds them."""


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
    known = {
        int(k) for k in (dyn.mjDYN_INTEGRATOR, dyn.mjDYN_FILTER, dyn.mjDYN_FILTEREXACT, dyn.mjDYN_DCMOTOR)
    }
    for i, kind in zip(own, kinds, strict=True):
        current = float(model.actuator_dynprm[i, 0]) > 0.0 and int(model.actuator_actnum[i]) == 1
        if int(kind) not in known or (kind == dyn.mjDYN_DCMOTOR and not current):
            raise UsageError(
                f"{where}: {str(model.actuator(i).name) or f'actuator{i}'} has an activation that no command before it "
                "tells (a muscle, a controller's integral, heat, bristles); leave that out of the model"
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
