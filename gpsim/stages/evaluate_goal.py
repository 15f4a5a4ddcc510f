"""Layer 3 of a task with a goal: trips on the target from every start, and some beside the simulator's (Figure 4.3)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from safetensors.numpy import load_file

from gpsim.artifacts import Artifact, Recipe
from gpsim.channels import BoolArray, FloatArray
from gpsim.corrected import PosteriorPlant
from gpsim.environments import policy_actor
from gpsim.evaluation import Trips, behind, episode_returns, mean_and_worst, take_trips
from gpsim.simulators import Plant
from gpsim.stages import certify
from gpsim.stages.building import make_task, target_plant
from gpsim.stages.policy_files import read_policy, write_arrays
from gpsim.stages.stage import Request, generator
from gpsim.stages.train_gp_policy import posterior_plant
from gpsim.tasks import GoalReaching, Start

TRIPS, PATHS = "trips.csv", "paths.safetensors"


def goal_task(request: Request) -> GoalReaching | None:
    """The task on the target if it has a goal."""
    task = make_task(request.config).on_target()
    return task if isinstance(task, GoalReaching) else None


def drive_all(
    request: Request, recipe: Recipe, folder: Path, names: tuple[str, ...], simulators: Mapping[str, Plant]
) -> dict[str, Trips]:
    """Every policy's trips on the target; writes trips.csv, and paths.safetensors of one place with all its headings.

    simulators: what each policy was trained in; its trips there are the dotted lines of Figure 4.3.
    """
    task, start = goal_task(request), certify.evaluation_starts(request)
    assert task is not None
    endless = replace(task, ends_at_edge=False)  # in simulation nothing stops at the floor's edge
    seed = request.start_seed
    target = target_plant(request.config)
    acts = {name: policy_actor(read_policy(recipe.parents[name].path)) for name in names}
    # The same noise for every policy: they are compared with one another.
    trips = {
        name: take_trips(target, task, acts[name], start, generator(seed, "evaluate/returns"))
        for name in names
    }
    _table(trips, behind(task, start)).to_csv(folder / TRIPS, index=False, lineterminator="\n")
    rows = _one_place(task, start)
    shown = Start(start.states[rows], start.context[rows])
    paths: dict[str, FloatArray] = {"goal": shown.context}
    for name in names:
        paths[f"target/{name}"] = trips[name].paths[rows][:, :, :3]
        paths[f"simulator/{name}"] = take_trips(
            simulators[name], endless, acts[name], shown, generator(seed, "evaluate/paths")
        ).paths
    write_arrays(folder / PATHS, paths)
    return trips


def facing_away(request: Request) -> BoolArray:
    """(N,): evaluation starts that face away from the goal."""
    task = goal_task(request)
    assert task is not None
    return behind(task, certify.evaluation_starts(request))


def read_trips(artifact: Artifact) -> tuple[dict[str, dict[str, np.ndarray]], BoolArray]:
    """Part (reached, steps, path) -> policy -> (N,), and which starts face away from the goal (N,)."""
    table = pd.read_csv(artifact.path / TRIPS)
    found: dict[str, dict[str, np.ndarray]] = {"reached": {}, "steps": {}, "path": {}}
    away = np.zeros(0, dtype=np.bool_)
    for name, rows in table.groupby("policy", sort=False):
        found["reached"][str(name)] = rows["reached"].to_numpy(dtype=np.bool_)
        found["steps"][str(name)] = rows["steps"].to_numpy(dtype=np.float64)
        found["path"][str(name)] = rows["path"].to_numpy(dtype=np.float64)
        away = rows["behind"].to_numpy(dtype=np.bool_)
    return found, away


def read_paths(artifact: Artifact) -> dict[str, FloatArray]:
    """Goal (H, 2), target/POLICY and simulator/POLICY (H, T + 1, 3)."""
    return dict(load_file(artifact.path / PATHS))


def _table(trips: Mapping[str, Trips], away: BoolArray) -> pd.DataFrame:
    frames = [
        pd.DataFrame(
            {
                "policy": name,
                "start": np.arange(len(trip.steps)),
                "behind": away.astype(int),
                "reached": trip.reached.astype(int),
                "steps": trip.steps.astype(int),
                "path": trip.path,
                "return": trip.returns,
            }
        )
        for name, trip in trips.items()
    ]
    return pd.concat(frames, ignore_index=True)


def _one_place(task: GoalReaching, start: Start) -> np.ndarray:
    """The starts of the place nearest to the middle, one a heading."""
    nearest = int(np.argmin(np.hypot(start.states[:, 0], start.states[:, 1])))
    first = nearest - nearest % task.evaluation_headings
    return np.arange(first, min(first + task.evaluation_headings, len(start.states)))


def what_is_open(request: Request, recipe: Recipe) -> PosteriorPlant:
    """What the policy Posterior was trained in."""
    return posterior_plant(request.having(correction="effects+gp"), recipe.parents["diagnosis"])


def robustness(
    request: Request, recipe: Recipe, on_target: Mapping[str, FloatArray]
) -> dict[str, dict[str, dict[str, Any]]]:
    """Mean and worst tenth of every policy's returns, on the target and on targets drawn from the posterior.

    on_target: policy to returns (N,). Every start has a draw of its own, the same for every policy.
    """
    task, start = make_task(request.config).on_target(), certify.evaluation_starts(request)
    drawn = what_is_open(request, recipe)

    def returns(name: str) -> FloatArray:
        act = policy_actor(read_policy(recipe.parents[name].path))
        return episode_returns(drawn, task, act, start, generator(request.start_seed, "evaluate/posterior"))

    both = {"target": on_target, "posterior": {name: returns(name) for name in on_target}}
    return {
        "robustness": {
            where: {name: mean_and_worst(values) for name, values in found.items()}
            for where, found in both.items()
        }
    }
