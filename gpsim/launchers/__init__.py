"""Where independent jobs run: in processes of this machine, on a Dask scheduler, or on a SLURM cluster through Dask.

    tasks         a task, how it ended, and what an executor is
    running       every task as soon as what it waits for is done, on whichever executor
    launcher      which executor, from the settings `launcher.*`
    opening       that executor, while it is needed
    local         processes of this machine
    dask_client   a Dask scheduler: the client's side
    dask_worker   the same: what runs on the worker
    security      who may give orders to a scheduler that is started here
    slurm         workers as SLURM jobs
    parcels       files that travel where there is no shared file system

Only settings, requests and results travel through Dask, as its own serialisation of plain arguments. Artifacts lie on
a file system that all share, or travel as files with their digest; they are never pickled.
"""

from gpsim.launchers.launcher import Dask, Launcher, Local, Slurm, launcher_from
from gpsim.launchers.parcels import settle
from gpsim.launchers.running import run_tasks
from gpsim.launchers.tasks import Outcome, Progress, Task, Update

__all__ = [
    "Dask",
    "Launcher",
    "Local",
    "Outcome",
    "Progress",
    "Slurm",
    "Task",
    "Update",
    "launcher_from",
    "run_tasks",
    "settle",
]
