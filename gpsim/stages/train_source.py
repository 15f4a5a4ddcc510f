"""train-source: the first policy, and the two reference policies (domain randomisation, the target itself)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from gymnasium.spaces import Discrete

from gpsim.artifacts import Recipe
from gpsim.envs import BatchedEnv
from gpsim.errors import UsageError
from gpsim.files import Json
from gpsim.learning import TRAINING_FORMAT, PpoSettings, SacSettings, observation_scale
from gpsim.settings import choice
from gpsim.simulators.plant import Plant
from gpsim.stages.building import base_plant, make_task, randomised_plant, target_plant, training_settings
from gpsim.stages.code import IN_NUMBERS
from gpsim.stages.policy_files import write_checkpoints, write_curve, write_policy
from gpsim.stages.stage import Request, Stage, derived_seed
from gpsim.tasks import Task

VARIANTS = ("source", "randomised", "target")
_EXTRA = {"source": (), "randomised": ("randomise",), "target": ("target",)}


def recipe(request: Request) -> Recipe:
    """Everything the policy depends on; only the target variant depends on the target."""
    variant = choice(request.config["variant"], VARIANTS, "variant")
    config = request.section("variant", "simulator", "task", "policy", *_EXTRA[variant])
    return Recipe("train-source", config, {}, {"seed": request.seed})


def write(request: Request, recipe: Recipe, folder: Path) -> Json:
    """Train and write the policy and its learning curve."""
    variant = str(recipe.config["variant"])
    plants: dict[str, Callable[[Mapping[str, Any]], Plant]] = {
        "source": base_plant,
        "randomised": randomised_plant,
        "target": target_plant,
    }
    task = make_task(request.config)
    if variant == "target":
        task = task.on_target()
    return train(request, plants[variant](request.config), task, f"train-source/{variant}", folder)


def settings_for(request: Request, task: Task) -> PpoSettings | SacSettings:
    """The algorithm and its hyper-parameters; raises UsageError for those that do not go with the task."""
    settings = training_settings(request.config)
    discrete = isinstance(task.action_space, Discrete)
    if discrete != isinstance(settings, PpoSettings):
        kind, fits = ("discrete", "ppo") if discrete else ("continuous", "sac")
        raise UsageError(f"policy: this task's actions are {kind}; choose policy={fits}")
    observation_scale(task.observation_space, settings.observation_scale)
    return settings


def train(request: Request, plant: Plant, task: Task, purpose: str, folder: Path) -> Json:
    """Train a policy on a plant; seeds of network and environment come from the loop's seed and the purpose."""
    from gpsim.policies import train_ppo, train_sac  # torch takes seconds to load, and only training needs it

    settings = settings_for(request, task)
    places, weights = (derived_seed(request.seed, f"{purpose}/{part}") for part in ("environment", "policy"))
    if isinstance(settings, PpoSettings):
        env = BatchedEnv(plant, task, settings.n_envs, places)
        policy, curve = train_ppo(env, settings, weights, request.progress)
    else:
        env = BatchedEnv(plant, task, settings.n_envs, places, settings.action_repeat)
        policy, curve, checkpoints = train_sac(env, settings, weights, request.progress)
        write_checkpoints(folder, checkpoints)
    write_policy(folder, policy)
    write_curve(folder, curve)
    return {"environment_steps": int(curve.steps[-1]) * env.repeat}


STAGE = Stage(
    "train-source",
    "Train a policy in the base simulator (variant=source|randomised|target).",
    recipe,
    write,
    format=TRAINING_FORMAT,
    code=IN_NUMBERS,
)
