"""Tasks: initial states, reward, termination; no dynamics."""

from gpsim.tasks.balance import Balance
from gpsim.tasks.goal import GoalReaching
from gpsim.tasks.own import OwnTask, never
from gpsim.tasks.registry import TASKS
from gpsim.tasks.task import Actions, Start, Task
