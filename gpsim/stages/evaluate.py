"""evaluate: the thesis's three layers - one step, rollouts, returns - on the target."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from gpsim import evaluation as layers
from gpsim.artifacts import Artifact, Recipe
from gpsim.channels import BoolArray, FloatArray
from gpsim.corrected import EffectsPlant, Features, GpCorrection, arrived_inputs
from gpsim.diagnosis.assessment import replayed
from gpsim.diagnosis.data import rebased
from gpsim.environments import Act, collect_episodes, policy_actor, random_actor
from gpsim.errors import UsageError
from gpsim.files import Json, plain, read_object, write_json
from gpsim.recordings import Recording, read_recording
from gpsim.residuals import Residuals, either_wraps, holding_out
from gpsim.settings import positive, truth
from gpsim.simulators import Plant
from gpsim.stages import (
    build_residuals,
    building,
    certify,
    evaluate_deployed,
    fit_gp,
    safety,
    train_gp_policy,
)
from gpsim.stages.building import base_plant, drivable, make_task, target_plant
from gpsim.stages.diagnose_loop import find_diagnosis
from gpsim.stages.policy_files import read_policy, write_arrays
from gpsim.stages.stage import Request, Stage, generator
from gpsim.stages.train_gp_policy import TRAINED_BY, full_return, needs_diagnosis, policy_names

DEPLOYED = "GP-Sample"
"""The policy that the thesis deploys: what it visits on the target, the recording should have covered."""


def check(request: Request) -> None:
    """Raise UsageError for settings of the evaluation that would only fail when everything else is done."""
    policy_names(request)
    if train_gp_policy.robust(request):
        raise UsageError(
            "robustness=posterior is only for train-gp-policy; to evaluate such a policy, name it Posterior in "
            "evaluate.policies"
        )
    _ = request.start_seed
    truth(request.config["sample_noise"], "sample_noise")
    for key in ("episodes", "one_step_episodes", "rollouts", "rollout_steps"):
        positive(request.config["evaluate"][key], f"evaluate.{key}")
    if safety.safe(request):
        safety.check(request)
        if (policy := request.config["deploy"]["policy"]) not in policy_names(request):
            raise UsageError(
                f"deploy.policy: '{policy}' is not one of evaluate.policies: {', '.join(policy_names(request))}"
            )


def recipe(request: Request) -> Recipe:
    """Target, simulator and task; parents are the policies, the GPs and the certified starts.

    With `deployed` logs, or a target that is known by its logs alone, what there is to evaluate instead.
    """
    if request.config["deployed"] is not None:
        return evaluate_deployed.recipe(request)
    check(request)
    if not drivable(request.config):
        return _judged_recipe(request, needs_diagnosis(request))
    parents = {
        "residuals": build_residuals.STAGE.need(request),
        "gp": fit_gp.STAGE.need(request),
        "certified": certify.STAGE.need(request),
    }
    source = TRAINED_BY["Source"][0].need(request.having(variant="source"))
    if needs_diagnosis(request):
        parents["diagnosis"] = find_diagnosis(request)
    for name in policy_names(request):
        stage, settings = TRAINED_BY[name]
        parents[name] = stage.need(request.having(**settings))
    keys = ["simulator", "target", "task", "evaluate", "sample_noise", "gp"]
    if safety.safe(request):
        keys += ["deploy", "correction"]
        parents |= safety.rests_on(request)
    config = request.section(*keys)
    if (words := building.measured_on(request)) is not None:
        config["measured_on"] = words
    return Recipe("evaluate", config, {**parents, "driver": source}, {"seed": request.seed})


def write(request: Request, recipe: Recipe, folder: Path) -> Json:
    """Write evaluation.json, returns.csv and rollouts.safetensors; a task with a goal adds trips.csv and its paths."""
    if request.config["deployed"] is not None:
        return evaluate_deployed.write(request, recipe, folder)
    if not drivable(request.config):
        return _write_judged(request, recipe, folder)
    request.progress(0, 3, "one step")
    drivers: dict[str, str | None] = {"policy": "driver", "random": None}
    if DEPLOYED in recipe.parents:
        drivers["deployed"] = DEPLOYED
    visited = {name: _visit(request, recipe, driver) for name, driver in drivers.items()}
    gp = recipe.parents["gp"].path
    scores = {name: _scores(request, gp, visited[name]) for name in ("policy", "random")}
    residuals = build_residuals.read_residuals(recipe.parents["residuals"])
    training = _own_inputs(request, residuals)[fit_gp.rows_of(request, residuals)]
    request.progress(1, 3, "rollouts")
    rollout = _rollouts(request, recipe, folder)
    request.progress(2, 3, "returns")
    task, names = certify.goal_task(request), policy_names(request)
    trips: dict[str, layers.Trips] = {}
    if task is not None:
        trips = certify.drive_all(request, recipe, folder, names, _training_plants(request, recipe))
    returns = {name: trip.returns for name, trip in trips.items()} or _returns(request, recipe)
    starts = pd.read_csv(recipe.parents["certified"].path / "certified.csv")
    certified = starts["certified"].to_numpy(dtype=np.bool_)
    table = pd.DataFrame({**returns, "certified": certified.astype(int)})
    table.to_csv(folder / "returns.csv", index_label="start", lineterminator="\n")
    reached = {name: trip.reached[None] for name, trip in trips.items()} or None
    alone = {name: values[None] for name, values in returns.items()}  # of one seed
    by_set = layers.start_sets(alone, certified, full_return(make_task(request.config)), reached)
    if task is not None:
        away = layers.behind(task, certify.evaluation_starts(request))  # which starts face away from the goal
        parts = {
            part: {name: getattr(trip, part)[None] for name, trip in trips.items()}
            for part in ("reached", "steps", "path")
        }
        solved = layers.success_by_set(layers.AllTrips(**parts, behind=away), by_set)
    else:
        solved = {"own_simulator": _promised(request, recipe)}
    outside = {n: layers.outside_range(_own_inputs(request, data), training) for n, data in visited.items()}
    evaluation = {"experiment": request.config["experiment"], "seed": request.seed, "seeds": [request.seed]}
    if "measured_on" in recipe.config:
        evaluation["measured_on"] = recipe.config["measured_on"]
    evaluation |= {key: layers.summarise_all(alone, chosen) for key, chosen in by_set.items()}
    evaluation |= {"share": {key: float(chosen.mean()) for key, chosen in by_set.items()}, **solved}
    evaluation["outside_recording"] = outside
    if "Posterior" in recipe.parents:
        evaluation |= certify.robustness(request, recipe, returns)
    if safety.safe(request):
        policy = recipe.parents[str(request.config["deploy"]["policy"])]
        evaluation["safe_deployment"] = safety.safe_deployment(request, policy)
    evaluation |= {"one_step": scores["policy"], "one_step_random": scores["random"], "rollout": rollout}
    write_json(folder / "evaluation.json", plain(evaluation))
    request.progress(3, 3, "done")
    return {}


def read_returns(artifact: Artifact) -> tuple[dict[str, FloatArray], np.ndarray]:
    """Returns (N,) by policy, and which starts are certified (N,)."""
    table = pd.read_csv(artifact.path / "returns.csv", index_col="start")
    certified = table.pop("certified").to_numpy(dtype=np.bool_)
    return {str(name): table[name].to_numpy(dtype=np.float64) for name in table.columns}, certified


def _training_plants(request: Request, recipe: Recipe) -> dict[str, Plant]:
    """What each policy was trained in, by its name; of what domain randomisation draws, the middle."""
    found = train_gp_policy.simulators_of(request, recipe.parents["gp"].path, recipe.parents.get("diagnosis"))
    if "Posterior" in recipe.parents:
        found["Posterior"] = certify.what_is_open(request, recipe)
    return {**found, "Domain randomisation": found["Source"], "Target": target_plant(request.config)}


def _visit(request: Request, recipe: Recipe, driver: str | None) -> Residuals:
    """Fresh target episodes driven by the policy of the parent `driver`, or at random.

    The first policy draws its actions, as it did while it was recorded; the deployed one takes its most probable ones.
    """
    section, base = request.config["evaluate"], base_plant(request.config)
    task = make_task(request.config).on_target()
    rng = generator(request.start_seed, f"evaluate/one-step/{driver}")
    act: Act = random_actor(task, rng)
    if driver is not None:
        act = policy_actor(read_policy(recipe.parents[driver].path), None if driver == DEPLOYED else rng)
    count = positive(section["one_step_episodes"], "evaluate.one_step_episodes")
    episodes = collect_episodes(target_plant(request.config), task, act, count, rng)
    return building.residuals_of(base, episodes, rng)


def _rollouts(request: Request, recipe: Recipe, folder: Path) -> dict[str, Any]:
    section, task = request.config["evaluate"], make_task(request.config)
    target = target_plant(request.config)
    rng = generator(request.start_seed, "evaluate/rollouts")
    count = positive(section["rollouts"], "evaluate.rollouts")
    steps = positive(section["rollout_steps"], "evaluate.rollout_steps")
    begin = task.start(count, rng)
    start, act = begin.states, random_actor(task, rng)
    chosen = [task.command(act(task.observe(start, begin.context))) for _ in range(steps)]
    actions = np.stack(chosen, axis=1)
    trained = _training_plants(request, recipe)
    order = ("Target", "Source", "GP-Mean", "GP-Sample", "Effects")
    plants = {name: trained[name] for name in order if name in trained}
    paths = {
        name: layers.roll_out(plant, start, actions, generator(request.start_seed, "evaluate/rollouts/noise"))
        for name, plant in plants.items()
    }
    write_arrays(folder / "rollouts.safetensors", {name: path[:8] for name, path in paths.items()})
    found: dict[str, Any] = {"horizon_s": steps * target.dt, "rollouts": count, "dt": target.dt}
    for name in (name for name in plants if name != "Target"):
        found[name] = layers.compare(paths[name], paths["Target"], target.state)
    return found


def _returns(request: Request, recipe: Recipe) -> dict[str, FloatArray]:
    task, target = make_task(request.config), target_plant(request.config)
    start, found = certify.evaluation_starts(request), {}
    for name in policy_names(request):
        act = policy_actor(read_policy(recipe.parents[name].path))
        rng = generator(request.start_seed, "evaluate/returns")  # the same noise for all, which are compared
        found[name] = layers.episode_returns(target, task, act, start, rng)
    return found


def _promised(request: Request, recipe: Recipe) -> dict[str, float]:
    """What every policy earns from the same starts, on average, in the simulator that it was trained in."""
    task, start = make_task(request.config), certify.evaluation_starts(request)
    names, plants = policy_names(request), _training_plants(request, recipe)
    if "Domain randomisation" in names:
        plants["Domain randomisation"] = building.randomised_plant(request.config)
    found = {}
    for name in names:
        act, rng = read_policy(recipe.parents[name].path).act, generator(request.start_seed, "evaluate/own")
        on = task.on_target() if name == "Target" else task
        found[name] = float(layers.episode_returns(plants[name], on, act, start, rng).mean())
    return found


def notes(artifact: Artifact) -> list[str]:
    """What was found of recorded deployments; or what was judged or measured on, and where to be wary."""
    evaluation = read_object(artifact.path / "evaluation.json")
    if "deployed" in evaluation:
        return evaluate_deployed.notes(artifact)
    if "not_driven" in evaluation:
        return [f"judged on {evaluation['judged_on']}", str(evaluation["not_driven"])]
    said = [f"measured on {evaluation['measured_on']}"] if "measured_on" in evaluation else []
    warnings = layers.coverage_warnings(evaluation.get("outside_recording") or {})
    said += layers.robustness_lines(evaluation.get("robustness") or {})
    if "safe_deployment" in evaluation:
        said += safety.safety_lines(evaluation["safe_deployment"])
    return [*said, *(f"warning: {text}" for text in warnings)]


EVERY = slice(None)


def _scores(
    request: Request, gp_folder: Path, data: Residuals, rows: BoolArray | slice = EVERY
) -> dict[str, Any]:
    """Rate to the scores of mean and sample on `rows` of the transitions; commands arrive from the ones before, too."""
    plant = train_gp_policy.corrected_plant(request, gp_folder)
    correction = plant.correction
    assert isinstance(correction, GpCorrection)
    inputs, late = arrived_inputs(plant, data)
    mean, variance = correction.predictor.mean_and_variance(correction.features(inputs[rows]))
    result = layers.OneStep(
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


def _own_inputs(request: Request, data: Residuals) -> FloatArray:
    """(N, D): the GPs' inputs of transitions."""
    return Features.of(building.input_names(request), data.channels)(data.inputs)


WHY = (
    "no returns: the target is a log and cannot be driven; let the robot run an exported policy, then score its log: "
    "gpsim evaluate experiment=limo deployed=BAG"
)


def _judged_recipe(request: Request, with_effects: bool) -> Recipe:
    """The simulator and what corrects it; the policies are for the robot, not for this."""
    parents = {"residuals": build_residuals.STAGE.need(request), "gp": fit_gp.STAGE.need(request)}
    if with_effects:
        parents["diagnosis"] = find_diagnosis(request)
    config = request.section("simulator", "target", "evaluate", "sample_noise", "gp")
    return Recipe("evaluate", config, parents, {"seed": request.seed})


def _write_judged(request: Request, recipe: Recipe, folder: Path) -> Json:
    data = build_residuals.read_residuals(recipe.parents["residuals"])
    held_out = bool(data.test.any())
    judged = data.take(data.test) if held_out else data
    request.progress(0, 2, "one step")
    one_step = _scores(request, recipe.parents["gp"].path, data, data.test if held_out else EVERY)
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
        "rollout": _replayed_rollouts(request, recipe, judged, folder),
    }
    write_json(folder / "evaluation.json", plain(evaluation))
    request.progress(2, 2, "done")
    return {}


def _replayed_rollouts(request: Request, recipe: Recipe, judged: Residuals, folder: Path) -> dict[str, Any]:
    section, base = request.config["evaluate"], base_plant(request.config)
    recording = read_recording(build_residuals.recording_folder(request))
    numbers = np.unique(judged.episode).tolist()
    windows = layers.windows_of(
        safety.judged_episodes(holding_out(recording, build_residuals.check(request)), numbers),
        positive(section["rollout_steps"], "evaluate.rollout_steps"),
        positive(section["rollouts"], "evaluate.rollouts"),
        dt=recording.dt,
        state=recording.state,
    )
    channels = either_wraps(base.state, recording.state)
    rng = generator(request.start_seed, "evaluate/rollouts")
    steps = windows.recorded.shape[1] - 1
    found: dict[str, Any] = {"horizon_s": steps * base.dt, "rollouts": len(windows.states), "dt": base.dt}
    found["warm_up_s"] = layers.WARM_UP * base.dt
    paths = {"Target": windows.recorded}
    for name, plant in train_gp_policy.simulators_of(
        request, recipe.parents["gp"].path, recipe.parents.get("diagnosis")
    ).items():
        if isinstance(plant, EffectsPlant):
            places = [(numbers[i], t) for i, t in zip(windows.episode, windows.t, strict=True)]
            paths[name] = _replayed(plant, recording, places, steps, recipe.parents["diagnosis"])
        else:
            paths[name] = layers.replay(plant, windows, rng)
        found[name] = layers.compare(paths[name], windows.recorded, channels)
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


STAGE = Stage("evaluate", recipe, write, notes, format=2)
