"""evaluate, where the target is known by its logs alone: layers 1 and 2 on the recording, and why no layer 3."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from gpsim.artifacts import Artifact, Recipe
from gpsim.channels import BoolArray, FloatArray
from gpsim.corrected import EffectsPlant, Features, GpCorrection, arrived_inputs
from gpsim.diagnosis.assessment import replayed
from gpsim.diagnosis.data import rebased
from gpsim.evaluation import WARM_UP, OneStep, compare, replay, windows_of
from gpsim.files import Json, plain, write_json
from gpsim.recordings import Episode, Recording, read_recording
from gpsim.residuals import Residuals, either_wraps, first_held_out, holding_out
from gpsim.settings import positive
from gpsim.stages import build_residuals, building, fit_gp, train_gp_policy
from gpsim.stages.building import base_plant
from gpsim.stages.diagnose_loop import find_diagnosis
from gpsim.stages.policy_files import write_arrays
from gpsim.stages.stage import Request, generator
from gpsim.stages.train_gp_policy import simulators_of

EVERY = slice(None)


def scores(
    request: Request, gp_folder: Path, data: Residuals, rows: BoolArray | slice = EVERY
) -> dict[str, Any]:
    """Rate to the scores of mean and sample on `rows` of the transitions; commands arrive from the ones before, too."""
    plant = train_gp_policy.corrected_plant(request, gp_folder)
    correction = plant.correction
    assert isinstance(correction, GpCorrection)
    inputs, late = arrived_inputs(plant, data)
    mean, variance = correction.predictor.mean_and_variance(correction.features(inputs[rows]))
    result = OneStep(
        data.values[rows],
        mean + late[rows],
        variance,
        correction.predictor.noise_variances,
        data.episode[rows],
    )
    rng = generator(request.start_seed, "evaluate/one-step/sample")
    return {
        name: result.scores(i, rng, sample_noise=correction.sample_noise)
        for i, name in enumerate(data.rate.names)
    }


def training_inputs(request: Request, residuals: Residuals) -> FloatArray:
    """(N, D): the GPs' own inputs on the rows that they were conditioned on."""
    return own_inputs(request, residuals)[fit_gp.rows_of(request, residuals)]


def own_inputs(request: Request, data: Residuals) -> FloatArray:
    """(N, D): the GPs' inputs of transitions."""
    return Features.of(building.input_names(request), data.channels)(data.inputs)


WHY = (
    "layer 3 is left out: the target is known by its logs alone, there is nothing to drive; play an exported policy on "
    "the robot (gpsim export policy) and score its logs (gpsim evaluate experiment=limo deployed=BAG)"
)


def recipe(request: Request, with_effects: bool) -> Recipe:
    """The simulator and what corrects it; the policies are for the robot, not for this."""
    parents = {"residuals": build_residuals.STAGE.need(request), "gp": fit_gp.STAGE.need(request)}
    if with_effects:
        parents["diagnosis"] = find_diagnosis(request)
    config = request.section("simulator", "target", "evaluate", "sample_noise", "gp")
    return Recipe("evaluate", config, parents, {"seed": request.seed})


def write(request: Request, recipe: Recipe, folder: Path) -> Json:
    """Write evaluation.json and rollouts.safetensors."""
    data = build_residuals.read_residuals(recipe.parents["residuals"])
    held_out = bool(data.test.any())
    judged = data.take(data.test) if held_out else data
    request.progress(0, 2, "one step")
    one_step = scores(request, recipe.parents["gp"].path, data, data.test if held_out else EVERY)
    request.progress(1, 2, "rollouts")
    evaluation = {
        "experiment": request.config["experiment"],
        "seed": request.seed,
        "seeds": [request.seed],
        "judged_on": "held-out episodes"
        if held_out
        else "the training episodes: the recording holds nothing out",
        "not_driven": WHY,
        "one_step": one_step,
        "rollout": _rollouts(request, recipe, judged, folder),
    }
    write_json(folder / "evaluation.json", plain(evaluation))
    request.progress(2, 2, "done")
    return {}


def judged_episodes(recording: Recording, numbers: list[int]) -> list[Episode]:
    """What is held out of these episodes; whole ones where nothing is held out of them."""
    held, out = first_held_out(recording), []
    for episode, begins in ((recording.episodes[i], int(held[i])) for i in numbers):
        first = begins if begins < len(episode.t) else 0
        if first < len(episode):
            out.append(
                replace(
                    episode,
                    t=episode.t[first:],
                    states=episode.states[first:],
                    actions=episode.actions[first:],
                )
            )
    return out


def _rollouts(request: Request, recipe: Recipe, judged: Residuals, folder: Path) -> dict[str, Any]:
    section, base = request.config["evaluate"], base_plant(request.config)
    recording = read_recording(build_residuals.recording_folder(request))
    numbers = np.unique(judged.episode).tolist()
    windows = windows_of(
        judged_episodes(holding_out(recording, build_residuals.check(request)), numbers),
        positive(section["rollout_steps"], "evaluate.rollout_steps"),
        positive(section["rollouts"], "evaluate.rollouts"),
        dt=recording.dt,
        state=recording.state,
    )
    channels = either_wraps(base.state, recording.state)
    rng = generator(request.start_seed, "evaluate/rollouts")
    steps = windows.recorded.shape[1] - 1
    found: dict[str, Any] = {
        "horizon_s": steps * base.dt, "rollouts": len(windows.states), "dt": base.dt, "warm_up_s": WARM_UP * base.dt,
    }  # fmt: skip
    paths = {"Target": windows.recorded}
    for name, plant in simulators_of(
        request, recipe.parents["gp"].path, recipe.parents.get("diagnosis")
    ).items():
        if isinstance(plant, EffectsPlant):
            places = [(numbers[i], t) for i, t in zip(windows.episode, windows.t, strict=True)]
            paths[name] = _replayed(plant, recording, places, steps, recipe.parents["diagnosis"])
        else:
            paths[name] = replay(plant, windows, rng)
        found[name] = compare(paths[name], windows.recorded, channels)
    write_arrays(folder / "rollouts.safetensors", {name: path[:8] for name, path in paths.items()})
    return found


def _replayed(
    plant: EffectsPlant,
    recording: Recording,
    places: Sequence[tuple[int, float]],
    steps: int,
    diagnosis: Artifact,
) -> FloatArray:
    """Rollouts that begin in these episodes at these moments, on the clock that the diagnosis looked at."""
    diagnosed = diagnosis.manifest["config"].get("episodes")
    _, origin = rebased(replace(recording, episodes=recording.episodes[:diagnosed], held_out=None))
    samples = [(i, int(np.searchsorted(recording.episodes[i].t, t))) for i, t in places]
    moved = tuple(replace(episode, t=episode.t - origin) for episode in recording.episodes)
    return replayed(plant, replace(recording, episodes=moved), samples, steps)
