"""Which policies are compared, and the stage and settings that train each."""

from __future__ import annotations

from collections.abc import Mapping

from gpsim.errors import UsageError
from gpsim.gymtasks import GymTask
from gpsim.settings import texts
from gpsim.stages import train_gp_policy, train_source
from gpsim.stages.building import drivable
from gpsim.stages.stage import Request, Stage
from gpsim.tasks import Task

TRAINED_BY: Mapping[str, tuple[Stage, dict[str, str]]] = {
    "Source": (train_source.STAGE, {"variant": "source"}),
    "Domain randomisation": (train_source.STAGE, {"variant": "randomised"}),
    "GP-Mean": (train_gp_policy.STAGE, {"correction": "gp", "prediction": "mean"}),
    "GP-Sample": (train_gp_policy.STAGE, {"correction": "gp", "prediction": "sample"}),
    "Effects": (train_gp_policy.STAGE, {"correction": "effects"}),
    "Posterior": (train_gp_policy.STAGE, {"correction": "effects+gp", "robustness": "posterior"}),
    "Target": (train_source.STAGE, {"variant": "target"}),
}
"""The policies of Table 4.4, the one of the named effects, and the stage that trains each."""
DIAGNOSED = ("Effects", "Posterior")
"""Policies that need a diagnosis."""


def full_return(task: Task) -> int | None:
    """The return that means that a start is solved; None of a task whose rewards are its own affair."""
    return None if isinstance(task, GymTask) else task.max_steps


def policy_names(request: Request) -> tuple[str, ...]:
    """The policies to compare."""
    names = texts(request.config["evaluate"]["policies"], "evaluate.policies")
    unknown = [name for name in names if name not in TRAINED_BY]
    if unknown or not names:
        raise UsageError(
            f"evaluate.policies: '{(unknown or ['nothing'])[0]}' is not one of {', '.join(TRAINED_BY)}"
        )
    return tuple(name for name in dict.fromkeys(names) if name != "Target" or drivable(request.config))


def needs_diagnosis(request: Request) -> bool:
    """Whether a policy that is compared was trained in what a diagnosis found."""
    return not set(DIAGNOSED).isdisjoint(policy_names(request))
