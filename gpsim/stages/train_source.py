"""train-source: the first policy, and the two reference policies (domain randomisation, the target itself)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium.spaces import Discrete
from numpy.typing import NDArray

from gpsim.artifacts import Recipe
from gpsim.channels import FloatArray
from gpsim.environments import BatchedEnv
from gpsim.errors import UsageError
from gpsim.files import Json, disk_errors
from gpsim.policies import Expert
from gpsim.policies.training.settings import TRAINING_FORMAT, PpoSettings, SacSettings, observation_scale
from gpsim.settings import choice
from gpsim.simulators import Plant
from gpsim.stages import building
from gpsim.stages.building import base_plant, make_task
from gpsim.stages.policy_files import write_checkpoints, write_curve, write_policy
from gpsim.stages.stage import IN_NUMBERS, Request, Stage, derived_seed
from gpsim.tasks import Task

TRACKERS = ("tensorboard",)
FOLDER = "tracking"


def tracks(request: Request) -> bool:
    """Whether trainings are tracked; raises UsageError where that is asked for and cannot be."""
    asked = request.config["track"]
    if asked is None:
        return False
    choice(asked, TRACKERS, "track")
    if find_spec("tensorboard") is None:
        raise UsageError("track=tensorboard: TensorBoard is not installed; pip install 'gpsim[tensorboard]'")
    return True


def events_of(request: Request, recipe: Recipe, purpose: str) -> Path | None:
    """An empty folder for the event files of one training, or None; those of an earlier try at it are removed.

    They hold wall-clock times, and artifacts are made of their recipe alone: so they lie beside the artifacts, never in
    them, and `track` is part of no recipe. The folder is named by the recipe:
    <runs_dir>/<experiment>/tracking/train-source-source-seed0-1f0c9ab2.
    """
    if not tracks(request):
        return None
    name = f"{purpose.replace('/', '-')}-seed{request.seed}-{recipe.key[:8]}"
    folder = request.store.shelf(FOLDER) / name
    with disk_errors(folder):
        for earlier in folder.rglob("events.out.tfevents.*"):
            earlier.unlink()
        folder.mkdir(parents=True, exist_ok=True)
    return folder


def tracking_remarks(request: Request) -> list[str]:
    """Where event files lie and how they are looked at."""
    if not tracks(request):
        return []
    return [f"event files of the training: tensorboard --logdir {request.store.shelf(FOLDER)}"]


VARIANTS: Mapping[str, tuple[Callable[[Mapping[str, Any]], Plant], tuple[str, ...]]] = {
    "source": (base_plant, ()),
    "randomised": (building.randomised_plant, ("randomise",)),
    "target": (building.target_plant, ("target",)),
}
"""What a policy is trained in, and the settings that this rests on beside those of all."""
ROUND = 60_000
"""Environment steps that a round of expert iteration takes as long as: a scale for the progress."""


def recipe(request: Request) -> Recipe:
    """Everything the policy depends on; only the target variant depends on the target."""
    variant = choice(request.config["variant"], tuple(VARIANTS), "variant")
    config = request.section("variant", "simulator", "task", "policy", *VARIANTS[variant][1])
    return Recipe("train-source", config, {}, {"seed": request.seed})


def write(request: Request, recipe: Recipe, folder: Path) -> Json:
    """Train and write the policy and its learning curve."""
    variant = str(recipe.config["variant"])
    plant, task = VARIANTS[variant][0](request.config), make_task(request.config)
    if variant == "target":
        task = task.on_target()
    model = base_plant(request.config) if variant == "randomised" else None  # the middle of what is drawn
    purpose = f"train-source/{variant}"
    return train(request, plant, task, purpose, folder, model, events_of(request, recipe, purpose))


def settings_for(request: Request, task: Task) -> PpoSettings | SacSettings:
    """The algorithm and its hyper-parameters; raises UsageError for those that do not go with the task."""
    settings = building.training_settings(request.config)
    discrete = isinstance(task.action_space, Discrete)
    if discrete != isinstance(settings, PpoSettings):
        kind, fits = ("discrete", "ppo") if discrete else ("continuous", "sac")
        raise UsageError(f"policy: this task's actions are {kind}; choose policy={fits}")
    observation_scale(task.observation_space, settings.observation_scale)
    if isinstance(settings, PpoSettings) and settings.expert_rounds:
        building.expert_search(request.config, settings.expert_width)
    return settings


def train(
    request: Request,
    plant: Plant,
    task: Task,
    purpose: str,
    folder: Path,
    model: Plant | None = None,
    events: Path | None = None,
) -> Json:
    """Train a policy on a plant; seeds of network and environment come from the loop's seed and the purpose.

    model: what an expert looks ahead in, where that is not the plant itself. events: a folder for event files.
    """
    # torch takes seconds to load, and only training needs it
    from gpsim.policies.training.expert_iteration import improved
    from gpsim.policies.training.ppo import train_ppo
    from gpsim.policies.training.sac import train_sac

    settings = settings_for(request, task)
    places, weights, search = (
        derived_seed(request.seed, f"{purpose}/{part}") for part in ("environment", "policy", "expert")
    )
    if isinstance(settings, PpoSettings):
        env = BatchedEnv(plant, task, settings.n_envs, places)
        total = settings.total_steps + settings.expert_rounds * ROUND

        def told(done: int, _: int, said: str) -> None:
            request.progress(done, total, said)

        policy, curve, critic = train_ppo(env, settings, weights, told, events=events)
        if settings.expert_rounds:
            most = settings.reward_scale / (1.0 - settings.gamma)

            def worth(observations: NDArray[np.float32]) -> FloatArray:
                """The critic's word for what lies behind the expert's horizon."""
                return np.clip(critic.logits(observations)[:, 0].astype(np.float64) / most, -1.0, 1.2)

            ahead = building.expert_search(request.config, settings.expert_width)
            expert = Expert(model or plant, task, ahead, settings.expert_horizon, worth)
            begun = settings.total_steps
            apart = events / "expert" if events is not None else None

            def rounds(turn: int, _: int, said: str) -> None:
                told(begun + turn * ROUND, 0, said)

            policy, checkpoints = improved(policy, plant, expert, settings, search, rounds, apart)
            write_checkpoints(folder, checkpoints)
    else:
        env = BatchedEnv(plant, task, settings.n_envs, places, settings.action_repeat)
        policy, curve, checkpoints = train_sac(env, settings, weights, request.progress, events)
        write_checkpoints(folder, checkpoints)
    write_policy(folder, policy)
    write_curve(folder, curve)
    return {"environment_steps": int(curve.steps[-1]) * env.repeat}


STAGE = Stage(
    "train-source", recipe, write, remarks=tracking_remarks, format=TRAINING_FORMAT, code=IN_NUMBERS
)
