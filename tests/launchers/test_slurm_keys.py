"""Workers of SLURM jobs show the command's key. SLURM itself is played by three scripts, as `make test-cluster` has one."""

import os
from functools import partial
from pathlib import Path

import pytest

from gpsim.launchers import Slurm, Task, run_tasks

pytest.importorskip("dask_jobqueue")
pytest.importorskip("cryptography")
pytestmark = pytest.mark.filterwarnings("ignore")  # Dask's own
SCRIPTS = {
    "sbatch": 'cp "$1" job.sh; setsid bash "$1" >/dev/null 2>&1 </dev/null & echo "Submitted batch job $!"; sleep 0.2',
    "scancel": 'for job in "$@"; do kill -TERM -- -"$job"; done',
    "squeue": "exit 0",
}


def doubled(number, progress):
    return 2 * number


def test_a_slurm_worker_gives_itself_out_by_the_commands_key(tmp_path, monkeypatch):
    bin_folder = tmp_path / "bin"
    bin_folder.mkdir()
    for name, text in SCRIPTS.items():
        (bin_folder / name).write_text(f"#!/bin/bash\n{text}\n")
        (bin_folder / name).chmod(0o755)
    monkeypatch.setenv("PATH", f"{bin_folder}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent))
    said = []
    launcher = Slurm(
        None, None, "00:10:00", "1GB", 1, (), (), (), 0, 1, "lo", None, "logs", announce=said.append
    )
    [outcome] = run_tasks(launcher, [Task("a", partial(doubled, 2))], lambda *told: None)
    assert outcome.result == 4
    assert said[0].startswith("Dask's dashboard: http://127.0.0.1:")
    job = Path("job.sh").read_text()
    assert "dask_worker tls://127.0.0.1:" in job
    assert "PRIVATE" not in job
    assert not list(Path("logs").glob(".tls-*"))
