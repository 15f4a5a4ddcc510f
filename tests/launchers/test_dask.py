"""The same jobs on Dask: the same bytes, a lost worker's work done again, failures with the node's name."""

import logging
import os
import signal
import socket
import subprocess
import sys
from functools import partial
from pathlib import Path
from unittest.mock import Mock

import pytest

from gpsim.errors import UsageError
from gpsim.launchers import Dask, JobFailedError, Local, Task, run_tasks

distributed = pytest.importorskip("distributed")
psutil = pytest.importorskip("psutil")  # Dask brings it
pytestmark = pytest.mark.filterwarnings("ignore")  # Dask's own
POINTS = ["collect.policy=random", "collect.episodes=2", "seed=range(3)"]


@pytest.fixture(scope="module")
def address():
    with distributed.LocalCluster(
        n_workers=2,
        threads_per_worker=1,
        processes=True,
        dashboard_address=":0",
        silence_logs=logging.CRITICAL,
    ) as cluster:
        yield cluster.scheduler_address


def silent(*_):
    pass


def run(address, tasks, update=silent, **more):
    said = []
    launcher = Dask(address, announce=said.append)
    found = {o.label: o for o in run_tasks(launcher, tasks, update, **more)}
    assert "http://" in said[0]
    return found


def doubled(number, progress):
    progress(0, 0, "begins")
    return 2 * number


def refused(progress):
    raise UsageError("the log is empty")


def broken(progress):
    return 1 // 0


def killing(mark, progress):
    """The first process that runs it dies of it, once its last act is on the disk."""
    try:
        Path(mark).touch(exist_ok=False)
    except FileExistsError:
        return "again"
    return os.kill(os.getpid(), signal.SIGKILL)


def test_tasks_run_elsewhere_and_say_so(address):
    told = []
    found = run(
        address,
        [Task(f"t{i}", partial(doubled, i), (f"t{i - 1}",) if i else ()) for i in range(4)],
        lambda *m: told.append(m),
    )
    assert [found[f"t{i}"].result for i in range(4)] == [0, 2, 4, 6]
    assert {o.node for o in found.values()} == {socket.gethostname()}
    assert any(m[3] == f"begins on {socket.gethostname()}" for m in told)
    assert not list(Path().iterdir())  # no mark of the folder stays


def test_a_failure_names_the_node_and_a_mistake_brings_its_traceback(address):
    node = socket.gethostname()
    with pytest.raises(UsageError, match=rf"^the log is empty \(on {node}\)$"):
        run(address, [Task("bad", refused)])
    with pytest.raises(JobFailedError, match=rf"worse failed on {node}:\n(.|\n)*ZeroDivisionError"):
        run(address, [Task("worse", broken)])
    found = run(address, [Task("bad", refused), Task("good", partial(doubled, 1))], keep_going=True)
    assert found["good"].result == 2


def test_the_work_of_a_worker_that_was_killed_is_done_by_another(address, tmp_path):
    found = run(
        address, [Task("k", partial(killing, str(tmp_path / "mark"))), Task("t", partial(doubled, 1))]
    )
    assert found["k"].result == "again"
    assert found["t"].result == 2


def test_a_folder_that_workers_do_not_see_is_refused():
    from gpsim.launchers.dask_jobs import Errand, carry_out
    from gpsim.trust import lent

    report = carry_out(Errand("t", partial(doubled, 1), "/nowhere/at/all", "no-such-mark", 0.0, lent()))
    assert "workers need a shared file system" in report.refusal


def listening(process):
    """Address and port on which a process and its children take connections."""
    every = [process, *process.children(recursive=True)]
    found = (c for p in every for c in p.net_connections("inet") if c.status == psutil.CONN_LISTEN)
    return {tuple(c.laddr) for c in found}


def test_nobody_else_can_reach_or_order_what_is_started_here():
    """The scheduler runs what it is sent: it takes that from the command alone, which has the key."""
    pytest.importorskip("cryptography")
    from gpsim.launchers.dask_jobs import dask_workers
    from gpsim.launchers.running import run_in

    said, known = [], listening(psutil.Process())
    with dask_workers(Dask(workers=1, announce=said.append), silent) as workers:
        client = workers.client
        address = client.scheduler.address
        assert workers.executor.submit(os.getpid).result() != os.getpid()
        [done] = run_in(workers, [Task("t", partial(doubled, 2))], keep_going=False)
        assert done.result == 4
        opened = listening(psutil.Process()) - known
        assert {host for host, _ in opened} == {"127.0.0.1"}
        assert said[0].startswith("Dask's dashboard: http://127.0.0.1:")
        for stranger, keys in (
            (address, distributed.Security.temporary()),
            (address.replace("tls://", "tcp://"), None),
        ):
            with pytest.raises(OSError, match="certificate|imed out|reset|closed"):
                distributed.Client(stranger, timeout=2, set_as_default=False, security=keys)


def test_keys_for_other_machines_lie_in_a_folder_of_ones_own(tmp_path):
    pytest.importorskip("cryptography")
    from gpsim.launchers.slurm import cluster_keys

    with cluster_keys(tmp_path) as keys:
        [folder] = tmp_path.iterdir()
        assert folder.stat().st_mode & 0o777 == 0o700
        assert {path.stat().st_mode & 0o777 for path in folder.iterdir()} == {0o600}
        assert keys.require_encryption
        assert Path(keys.tls_worker_key).parent == folder
        assert keys.get_connection_args("worker")["ssl_context"] is not None
    assert not list(tmp_path.iterdir())


def test_a_tls_scheduler_without_a_certificate_is_one_line():
    with pytest.raises(UsageError, match=r"tls://127\.0\.0\.1:9 .*distributed\.comm\.tls\.ca-file"):
        run("tls://127.0.0.1:9", [Task("t", partial(doubled, 1))])


def points():
    from gpsim.cli.sweep import points_of, resolved

    return resolved(points_of(POINTS), None)


def sweep(launcher):
    from gpsim.stages import full_loop

    told = Mock(update=silent)
    artifact, missing = full_loop.run_grid(full_loop.grid_of(points(), "collect"), launcher, told)
    assert missing == 0
    return artifact, [call.args[2] for call in told.made.mock_calls]


@pytest.mark.slow
def test_artifacts_are_the_same_bytes_and_none_is_made_twice(address, tmp_path, monkeypatch, tree):
    homes = {name: tmp_path / name for name in ("here", "there")}
    for name, launcher in (("here", Local(1)), ("there", Dask(address))):
        homes[name].mkdir()
        monkeypatch.chdir(homes[name])
        artifact, made = sweep(launcher)
        assert made == [False] * 3
        again, kept = sweep(launcher)
        assert (again, kept) == (artifact, [True] * 3)
    assert tree(homes["here"]) == tree(homes["there"])
    assert len(tree(homes["there"])) > 6


def test_a_scheduler_that_does_not_answer_is_one_line(monkeypatch):
    monkeypatch.setattr("gpsim.launchers.dask_jobs.CONNECT", 1)
    with pytest.raises(UsageError, match="no Dask scheduler answers"):
        run("tcp://127.0.0.1:9", [Task("t", partial(doubled, 1))])


def test_a_scheduler_without_workers_is_told_of_and_waited_for(monkeypatch):
    monkeypatch.setattr("gpsim.launchers.dask_jobs.ALONE", 0.0)
    said = []
    with distributed.LocalCluster(
        n_workers=0, threads_per_worker=1, dashboard_address=":0", silence_logs=logging.CRITICAL
    ) as cluster:

        def announce(line):
            said.append(line)
            if line.startswith("waiting"):
                cluster.scale(1)

        launcher = Dask(cluster.scheduler_address, announce=announce)
        [outcome] = run_tasks(launcher, [Task("t", partial(doubled, 2))], silent)
        assert outcome.result == 4
        address = cluster.scheduler_address
    assert said[1].startswith(f"waiting: {address} has no workers; start some with: dask worker {address}")


def test_ctrl_c_stays_what_it_was():
    """Importing dask-jobqueue makes it an exit with code 0."""
    code = (
        "import signal; signal.signal(signal.SIGINT, signal.default_int_handler);"
        "import gpsim.launchers.dask_jobs;"
        "assert signal.getsignal(signal.SIGINT) is signal.default_int_handler"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
