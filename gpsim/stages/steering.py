"""A trained policy as what steers a machine while a plan is played around it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from gpsim.artifacts import Artifact
from gpsim.channels import FloatArray
from gpsim.errors import UsageError
from gpsim.planning import Steer
from gpsim.simulators import Simulator
from gpsim.stages.building import make_task
from gpsim.stages.policy_files import policy_artifact, read_policy

SAME = 1e-6  # relative difference of two control steps that is rounding


def policy_for(folder: Path, simulator: Simulator, dt: float) -> Artifact:
    """A finished policy that can steer this simulator at this control step; raises UsageError."""
    artifact = policy_artifact(folder)
    config = artifact.manifest["config"]
    task = make_task(config)
    if not (task.state.same_as(simulator.state) and task.action.same_as(simulator.action)):
        raise UsageError(
            f"--policy {folder}: steers {config['simulator']['name']}, whose channels are not those of {simulator.name}"
        )
    own = float(config["simulator"]["dt"])
    if not math.isclose(own, dt, rel_tol=SAME):
        raise UsageError(
            f"--policy {folder}: acts every {own:g} s, the diagnosis is of one command every {dt:g} s"
        )
    return artifact


def steering(folder: Path, config: Mapping[str, Any]) -> Steer:
    """What the policy in a folder commands. config: its simulator and task, whose first evaluation start it is given.

    It acts by its most probable action. A policy that picks one of several actions is replaced by their mean, each as
    probable as the policy finds it: between two full pushes there is nothing that a dither could be added to.
    """
    policy, task = read_policy(folder), make_task(config)
    context = task.evaluation_starts(1, np.random.default_rng(0)).context
    picks = policy.bounds is None
    each = task.command(np.arange(task.action_space.n)) if picks else np.empty((0, 0))  # type: ignore[attr-defined]

    def steer(seen: FloatArray) -> FloatArray:
        observations = task.observe(seen, np.repeat(context, len(seen), axis=0))
        if picks:
            return np.asarray(policy.probabilities(observations) @ each)
        return task.command(policy.act(observations))

    return steer
