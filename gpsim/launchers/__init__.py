"""Where independent jobs run: in processes of this machine, on a Dask scheduler, or on a SLURM cluster through Dask.

    running     every task as soon as what it waits for is done, on a `concurrent.futures.Executor`
    launcher    which executor, from the settings `launcher.*`
    local       processes of this machine
    dask_jobs   a Dask scheduler: the client's side, and what runs on a worker
    slurm       workers as SLURM jobs, and who may give them orders

Only settings, requests and results travel through Dask, as its own serialisation of plain arguments. Artifacts lie on
a file system that all share, or travel as files with their digest; they are never pickled.
"""

from gpsim.launchers.launcher import Dask, Launcher, Local, Slurm, launcher_from
from gpsim.launchers.local import run_tasks
from gpsim.launchers.running import JobFailedError, Outcome, Progress, Task, Update

__all__ = [
    "Dask",
    "JobFailedError",
    "Launcher",
    "Local",
    "Outcome",
    "Progress",
    "Slurm",
    "Task",
    "Update",
    "launcher_from",
    "run_tasks",
]
