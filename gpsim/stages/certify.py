"""certify: which of the evaluation's starts a search over action sequences can solve."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from gpsim.artifacts import Artifact, Json, Recipe
from gpsim.channels import BoolArray
from gpsim.evaluation.certify import balance_search
from gpsim.settings import positive
from gpsim.stages.building import base_plant, make_task, target_plant
from gpsim.stages.stage import Request, Stage, generator
from gpsim.tasks import Start


def recipe(request: Request) -> Recipe:
    """The target, the task and the starts; independent of the loop's seed."""
    evaluate = request.config["evaluate"]
    config = request.section("target", "task", "certify")
    starts = {key: evaluate[key] for key in ("episodes", "start_seed")}
    return Recipe("certify", {**config, "starts": starts}, {}, {})


def evaluation_starts(request: Request) -> Start:
    """The starts of layer 3, the same for every policy and seed."""
    section = request.config["evaluate"]
    count = positive(section["episodes"], "evaluate.episodes")
    return make_task(request.config).start(count, generator(section["start_seed"], "evaluate/starts"))


def write(request: Request, recipe: Recipe, folder: Path) -> Json:
    """Write certified.csv: one row a start."""
    task, start = make_task(request.config), evaluation_starts(request)
    base = base_plant(request.config)
    g, half = base.parameters["gravity"], base.parameters["pole_half_length"]
    search = balance_search(g, half, positive(request.config["certify"]["width"], "certify.width"))
    solvable = search.solvable(target_plant(request.config), task, start, request.progress)
    columns = {name: start.states[:, i] for i, name in enumerate(base.state.names)}
    table = pd.DataFrame({**columns, "certified": solvable.astype(int)})
    table.to_csv(folder / "certified.csv", index=False, lineterminator="\n")
    return {}


def read_certified(artifact: Artifact) -> BoolArray:
    """(N,) True on certified starts."""
    return pd.read_csv(artifact.path / "certified.csv")["certified"].to_numpy(dtype=np.bool_)


STAGE = Stage("certify", "Search which of the evaluation's starts can be solved at all.", recipe, write)
