"""Tasks: initial states, reward, termination; no dynamics."""

from gpsim.tasks.balance import Balance
from gpsim.tasks.goal import GoalReaching
from gpsim.tasks.task import Actions, Start, Task

__all__ = [
    "Actions",
    "Balance",
    "GoalReaching",
    "Start",
    "Task",
]
