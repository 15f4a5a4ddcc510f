"""evaluate with the policy Posterior: every policy on targets drawn from the posterior, beside the target."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from gpsim.artifacts import Recipe
from gpsim.channels import FloatArray
from gpsim.corrected import PosteriorPlant
from gpsim.environments import policy_actor
from gpsim.evaluation import episode_returns, mean_and_worst
from gpsim.stages import certify
from gpsim.stages.building import make_task
from gpsim.stages.policy_files import read_policy
from gpsim.stages.stage import Request, generator
from gpsim.stages.train_gp_policy import posterior_plant


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
