"""Environments: a simulator or target with a task, to be driven and recorded."""

from gpsim.environments.active import ActiveSettings, Model, collect_actively
from gpsim.environments.collect import (
    Act,
    as_sensed,
    collect_episodes,
    dithered_actor,
    first_of,
    policy_actor,
    random_actor,
)
from gpsim.environments.envs import BatchedEnv, Episodes, SingleEnv
from gpsim.environments.stand_in import Sweep, drive_plan
