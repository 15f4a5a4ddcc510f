"""certify: which of the evaluation's starts a search over action sequences, or for a car geometry, can solve."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from gpsim.artifacts import Artifact, Recipe
from gpsim.channels import BoolArray
from gpsim.errors import UsageError
from gpsim.evaluation import turning
from gpsim.files import Json
from gpsim.gymtasks import GymTask
from gpsim.policies import balance_search
from gpsim.settings import positive
from gpsim.stages.building import make_task, target_plant
from gpsim.stages.stage import Request, Stage, generator
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
    if isinstance(task, GoalReaching):
        solvable = _by_geometry(request, task, start, task.floor)
        # What the thesis's own arena would have left of them, had its edge counted.
        small = {"certified_in_arena": _by_geometry(request, task, start, task.arena).astype(int)}
        _write_table(folder, target.state.names, start, solvable, small)
        return {}
    if isinstance(task, GymTask):  # no search knows its robot: none of its starts is left out
        _write_table(folder, target.state.names, start, np.ones(len(start.states), dtype=np.bool_), {})
        return {}
    if not isinstance(target, FrictionCartPole):
        raise UsageError(
            "certify: only a cart-pole's starts can be searched; choose target=friction or sticking"
        )
    # The target's own parameters: the search must not depend on what the simulator believes.
    g, half = target.parameters["gravity"], target.parameters["pole_half_length"]
    search = balance_search(g, half, positive(request.config["certify"]["width"], "certify.width"))
    solvable = search.solvable(target, task, start, request.progress)
    _write_table(folder, target.state.names, start, solvable, {})
    return {}


def _by_geometry(request: Request, task: GoalReaching, start: Start, floor: float) -> BoolArray:
    """Paths of a car with the target's least turning radius, at the slowest speed that allows it throughout."""
    target = target_plant(request.config)
    if not isinstance(target, Limo):
        raise UsageError("certify: only target=limo has a turning radius to search paths with")
    speed = min(task.speed[1], task.turn[1] * target.turning_radius)
    longest = speed * target.dt * task.max_steps
    return turning.solvable(start.states, start.context, target.turning_radius, floor / 2.0, longest)


def _write_table(
    folder: Path, names: tuple[str, ...], start: Start, solvable: BoolArray, more: dict[str, Any]
) -> None:
    columns = {name: start.states[:, i] for i, name in enumerate(names)}
    table = pd.DataFrame({**columns, "certified": solvable.astype(int), **more})
    table.to_csv(folder / "certified.csv", index=False, lineterminator="\n")


def notes(artifact: Artifact) -> list[str]:
    """How many."""
    table = pd.read_csv(artifact.path / "certified.csv")
    lines = [f"{int(table['certified'].sum())} of {len(table)} starts can be solved"]
    if "certified_in_arena" in table:
        lines.append(
            f"{int(table['certified_in_arena'].sum())} if the edge of the training arena ended an episode"
        )
    return lines


def read_certified(artifact: Artifact) -> BoolArray:
    """(N,) True on certified starts."""
    return pd.read_csv(artifact.path / "certified.csv")["certified"].to_numpy(dtype=np.bool_)


STAGE = Stage("certify", recipe, write, notes, format=1)
