"""The true law of a world that proves measured curves, where the recording went."""

from __future__ import annotations

from typing import Any

import numpy as np

from gpsim.channels import FloatArray, wrap_angle
from gpsim.trials import outside
from gpsim.trials.worlds import SYSTEMS, Run, World

PLACES = 201  # inputs at which the law is told, as often where the recording was more often
EDGE = 0.005  # of all samples on either side, that are left out


def true_curve(world: World, truth: Run) -> dict[str, Any] | None:
    """What answer.json says of the law; None of a world without one.

    family: of a curve of it; input: its channel; at: values of the input that were visited, evenly by how often; adds:
    what the law adds there to what the base makes of it. second: the turn rates (rad/s) of a law of a vehicle's speed.
    """
    (effect,) = world.effects if len(world.effects) == 1 else (None,)
    if effect is None or effect.family not in outside.CURVES:
        return None
    law = outside.CURVES[effect.family](effect.values)
    channel = law.input_of(effect.on, world.system)
    if isinstance(law, outside.Twist):
        v, w = _some(truth.commands.reshape(-1, truth.commands.shape[2])).T
        told = {"at": v, "adds": law.twist(v, w, np.zeros((len(v), 3)))[1] - w, "second": w}
    else:
        x = _spread(_visited(world, truth, channel))
        told = {"at": x, "adds": law.adds(x)}
    return {
        "family": law.quantity,
        "input": channel,
        **{key: [float(f"{value:.6g}") for value in values] for key, values in told.items()},
    }


def _visited(world: World, truth: Run, channel: str) -> FloatArray:
    system = SYSTEMS[world.system]
    if channel in system.action:
        return truth.commands[..., list(system.action).index(channel)].ravel()
    x = truth.sampled[:-1, :, system.names.index(channel)].ravel()
    return wrap_angle(x) if system.state[channel] == "rad" else x


def _spread(x: FloatArray) -> FloatArray:
    return np.asarray(np.quantile(x, np.linspace(EDGE, 1.0 - EDGE, PLACES)))


def _some(rows: FloatArray) -> FloatArray:
    return np.asarray(rows[np.linspace(0, len(rows) - 1, PLACES).astype(int)])
