"""certify: which of the evaluation's starts can be solved; and what is driven from them: trips to a goal, draws."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from gpsim.artifacts import Artifact, Recipe
from gpsim.channels import BoolArray, FloatArray
from gpsim.corrected import PosteriorPlant
from gpsim.environments import policy_actor
from gpsim.errors import UsageError
from gpsim.evaluation import Trips, behind, episode_returns, mean_and_worst, solvable, take_trips
from gpsim.files import Json
from gpsim.mjcf.gym_task import GymTask
from gpsim.policies import balance_search
from gpsim.settings import positive
from gpsim.simulators import Plant
from gpsim.stages.building import make_task, target_plant
from gpsim.stages.policy_files import read_policy, write_arrays
from gpsim.stages.stage import Request, Stage, generator
from gpsim.stages.train_gp_policy import posterior_plant
from gpsim.targets import FrictionCartPole, Limo
from gpsim.tasks import GoalReaching, Start


def recipe(request: Request) -> Recipe:
    """The target, the task and the starts; independent of the loop's seed."""
    config = request.section("target", "task", "certify")
    positive(request.config["certify"]["width"], "certify.width")
    count = positive(request.config["evaluate"]["episodes"], "evaluate.episodes")
    starts = {"episodes": count, "start_seed": request.start_seed}
    return Recipe("certify", {**config, "starts": starts}, {}, {})


def evaluation_starts(request: Request) -> Start:
    """The starts of layer 3, the same for every policy and seed."""
    section = request.config["evaluate"]
    count = positive(section["episodes"], "evaluate.episodes")
    rng = generator(request.start_seed, "evaluate/starts")
    return make_task(request.config).evaluation_starts(count, rng)


def write(request: Request, recipe: Recipe, folder: Path) -> Json:
    """Write certified.csv: one row a start."""
    task, start = make_task(request.config), evaluation_starts(request)
    target = target_plant(request.config)
    more = {}
    if isinstance(task, GoalReaching):
        solved = _by_geometry(target, task, start, task.floor)
        # What the thesis's own arena would have left of them, had its edge counted.
        more["certified_in_arena"] = _by_geometry(target, task, start, task.arena).astype(int)
    elif isinstance(task, GymTask):  # no search knows its robot: none of its starts is left out
        solved = np.ones(len(start.states), dtype=np.bool_)
    elif isinstance(target, FrictionCartPole):
        # The target's own parameters: the search must not depend on what the simulator believes.
        g, half = target.parameters["gravity"], target.parameters["pole_half_length"]
        search = balance_search(g, half, positive(request.config["certify"]["width"], "certify.width"))
        solved = search.solvable(target, task, start, request.progress)
    else:
        raise UsageError(
            "certify: only the starts of a cart-pole can be searched; choose target=friction or sticking"
        )
    columns = {name: start.states[:, i] for i, name in enumerate(target.state.names)}
    table = pd.DataFrame({**columns, "certified": solved.astype(int), **more})
    table.to_csv(folder / "certified.csv", index=False, lineterminator="\n")
    return {}


def _by_geometry(target: Plant, task: GoalReaching, start: Start, floor: float) -> BoolArray:
    """Paths of a car with the target's least turning radius, at the slowest speed that allows it throughout."""
    if not isinstance(target, Limo):
        raise UsageError("certify: only target=limo has a turning radius to search paths with")
    speed = min(task.speed[1], task.turn[1] * target.turning_radius)
    longest = speed * target.dt * task.max_steps
    return solvable(start.states, start.context, target.turning_radius, floor / 2.0, longest)


def notes(artifact: Artifact) -> list[str]:
    """How many."""
    table = pd.read_csv(artifact.path / "certified.csv")
    lines = [f"{int(table['certified'].sum())} of {len(table)} starts can be solved"]
    if "certified_in_arena" in table:
        inside = int(table["certified_in_arena"].sum())
        lines.append(f"{inside} if an episode ended at the edge of the training arena")
    return lines


STAGE = Stage("certify", recipe, write, notes, format=1)


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
    task, start = goal_task(request), evaluation_starts(request)
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
    away = behind(task, start).astype(int)
    columns = [
        {
            "policy": name,
            "start": np.arange(len(trip.steps)),
            "behind": away,
            "reached": trip.reached.astype(int),
            "steps": trip.steps.astype(int),
            "path": trip.path,
            "return": trip.returns,
        }
        for name, trip in trips.items()
    ]
    table = pd.concat([pd.DataFrame(each) for each in columns], ignore_index=True)
    table.to_csv(folder / TRIPS, index=False, lineterminator="\n")
    nearest = int(np.argmin(np.hypot(start.states[:, 0], start.states[:, 1])))  # the place in the middle
    first = nearest - nearest % task.evaluation_headings
    rows = np.arange(first, min(first + task.evaluation_headings, len(start.states)))  # one a heading
    shown = Start(start.states[rows], start.context[rows])
    paths: dict[str, FloatArray] = {"goal": shown.context}
    for name in names:
        there = take_trips(simulators[name], endless, acts[name], shown, generator(seed, "evaluate/paths"))
        paths[f"target/{name}"], paths[f"simulator/{name}"] = trips[name].paths[rows][:, :, :3], there.paths
    write_arrays(folder / PATHS, paths)
    return trips


def read_trips(artifact: Artifact) -> tuple[dict[str, dict[str, np.ndarray]], BoolArray]:
    """Part (reached, steps, path) -> policy -> (N,), and which starts face away from the goal (N,)."""
    table = pd.read_csv(artifact.path / TRIPS)
    parts = {"reached": np.bool_, "steps": np.float64, "path": np.float64}
    found: dict[str, dict[str, np.ndarray]] = {part: {} for part in parts}
    away = np.zeros(0, dtype=np.bool_)
    for name, rows in table.groupby("policy", sort=False):
        for part, kind in parts.items():
            found[part][str(name)] = rows[part].to_numpy(dtype=kind)
        away = rows["behind"].to_numpy(dtype=np.bool_)
    return found, away


def what_is_open(request: Request, recipe: Recipe) -> PosteriorPlant:
    """What the policy Posterior was trained in."""
    return posterior_plant(request.having(correction="effects+gp"), recipe.parents["diagnosis"])


def returns_of(request: Request, plant: Plant, policy: Artifact, start: Start, purpose: str) -> FloatArray:
    """(N,) what a policy earns on its target or a stand-in; who is compared has one purpose, so one noise."""
    act, task = policy_actor(read_policy(policy.path)), make_task(request.config).on_target()
    return episode_returns(plant, task, act, start, generator(request.start_seed, purpose))


def robustness(
    request: Request, recipe: Recipe, on_target: Mapping[str, FloatArray]
) -> dict[str, dict[str, dict[str, Any]]]:
    """Mean and worst tenth of every policy's returns, on the target and on targets drawn from the posterior.

    on_target: policy to returns (N,). Every start has a draw of its own, the same for every policy.
    """
    drawn, start = what_is_open(request, recipe), evaluation_starts(request)
    earned = {
        name: returns_of(request, drawn, recipe.parents[name], start, "evaluate/posterior")
        for name in on_target
    }
    both = {"target": on_target, "posterior": earned}
    told = {
        where: {n: mean_and_worst(values) for n, values in found.items()} for where, found in both.items()
    }
    return {"robustness": told}
