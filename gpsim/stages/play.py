"""collect --plan: a finished plan played on the target, and what happened as a recording."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from gpsim.artifacts import Recipe, read_artifact
from gpsim.channels import FloatArray
from gpsim.files import Json
from gpsim.recordings import Episode, write_recording
from gpsim.simulators import Plant
from gpsim.stages.building import base_plant, recording_of, target_plant
from gpsim.stages.plan import Played, read_plan
from gpsim.stages.stage import Request, Stage, generator


def stage_for(plan: Path) -> Stage:
    """The stage for a finished plan; its recording is of the stage `collect`."""
    return Stage(
        "collect",
        lambda request: _recipe(request, plan),
        lambda request, recipe, folder: _write(request, plan, folder),
        format=1,
    )


def _recipe(request: Request, plan: Path) -> Recipe:
    _opened(request, plan)
    parents = {"plan": read_artifact(plan, "plan")}
    return Recipe("collect", request.section("simulator", "target"), parents, {"seed": request.seed})


def _opened(request: Request, plan: Path) -> Played:
    target = target_plant(request.config)
    return read_plan(plan, base_plant(request.config).simulator, target.dt)


def _write(request: Request, plan: Path, folder: Path) -> Json:
    played, base, target = _opened(request, plan), base_plant(request.config), target_plant(request.config)
    rng = generator(request.seed, "collect/episodes")
    episodes = tuple(
        _episode(target, str(i), played.start, commands, rng) for i, commands in enumerate(played.commands)
    )
    recording = recording_of(base, episodes, "plan", request.seed)
    write_recording(recording, folder)
    return {"transitions": recording.transition_count}


def _episode(
    target: Plant, name: str, start: FloatArray, commands: FloatArray, rng: np.random.Generator
) -> Episode:
    state, memory = start[None].copy(), target.begin(1, rng)
    seen = [target.measure(state, memory, rng)[0]]
    for command in commands:
        state = target.step(state, command[None], memory, rng)
        seen.append(target.measure(state, memory, rng)[0])
    return Episode(name, target.dt * np.arange(len(commands) + 1, dtype=np.float64), np.stack(seen), commands)
