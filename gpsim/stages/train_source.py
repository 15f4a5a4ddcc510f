"""train-source: the first policy, and the two reference policies (domain randomisation, the target itself)."""

from __future__ import annotations

from pathlib import Path

from gpsim.artifacts import Json, Recipe
from gpsim.envs import BatchedEnv
from gpsim.settings import choice
from gpsim.simulators.plant import Plant
from gpsim.stages.building import base_plant, make_task, ppo_settings, randomised_plant, target_plant
from gpsim.stages.policy_files import write_curve, write_policy
from gpsim.stages.stage import Request, Stage, derived_seed

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
    plants: dict[str, Plant] = {
        "source": base_plant(request.config),
        "randomised": randomised_plant(request.config),
        "target": target_plant(request.config),
    }
    return train(request, plants[variant], f"train-source/{variant}", folder)


def train(request: Request, plant: Plant, purpose: str, folder: Path) -> Json:
    """Train a policy on a plant; seeds of network and environment come from the loop's seed and the purpose."""
    from gpsim.policies import train_ppo  # torch takes seconds to load, and only training needs it

    settings, task = ppo_settings(request.config), make_task(request.config)
    env = BatchedEnv(plant, task, settings.n_envs, derived_seed(request.seed, f"{purpose}/environment"))
    policy, curve = train_ppo(
        env, settings, derived_seed(request.seed, f"{purpose}/policy"), request.progress
    )
    write_policy(folder, policy)
    write_curve(folder, curve)
    return {"environment_steps": int(curve.steps[-1])}


STAGE = Stage(
    "train-source", "Train a policy in the base simulator (variant=source|randomised|target).", recipe, write
)
