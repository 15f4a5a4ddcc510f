"""The tasks that come with gpsim: one line each."""

from __future__ import annotations

from collections.abc import Mapping

from gpsim.tasks.balance import Balance
from gpsim.tasks.goal import GoalReaching
from gpsim.tasks.task import Task

TASKS: Mapping[str, type[Task]] = {"balance": Balance, "goal": GoalReaching}
