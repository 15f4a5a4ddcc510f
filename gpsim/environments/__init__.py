"""Environments: a simulator or target with a task, to be driven and recorded."""

from gpsim.environments.collect import Act, collect_episodes, dithered_actor, policy_actor, random_actor
from gpsim.environments.envs import BatchedEnv, Episodes
from gpsim.environments.single import SingleEnv
from gpsim.environments.stand_in import Sweep, drive_plan

__all__ = [
    "Act",
    "BatchedEnv",
    "Episodes",
    "SingleEnv",
    "Sweep",
    "collect_episodes",
    "dithered_actor",
    "drive_plan",
    "policy_actor",
    "random_actor",
]
