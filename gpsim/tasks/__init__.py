"""Tasks: initial states, reward, termination; no dynamics."""

from collections.abc import Mapping

from gpsim.tasks.balance import Balance
from gpsim.tasks.goal import GoalReaching
from gpsim.tasks.own import OwnTask, never
from gpsim.tasks.task import Actions, Start, Task

TASKS: Mapping[str, type[Task]] = {"balance": Balance, "goal": GoalReaching}
