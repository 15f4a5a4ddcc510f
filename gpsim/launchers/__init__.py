"""Where independent jobs run: in processes of this machine, on a Dask scheduler, or on a SLURM cluster through Dask.

    running     which executor, from the settings `launcher.*`; every task as soon as what it waits for is done
    local       processes of this machine
    dask_jobs   a Dask scheduler: the client's side, and what runs on a worker
    slurm       workers as SLURM jobs, and who may give them orders

Only settings, requests and results travel through Dask, as its own serialisation of plain arguments. Artifacts lie on
a file system that all share; they are never pickled.
"""

from gpsim.launchers.local import run_tasks
from gpsim.launchers.running import (
    Dask,
    JobFailedError,
    Launcher,
    Local,
    Progress,
    Slurm,
    Task,
    launcher_from,
)
