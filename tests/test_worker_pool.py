"""Worker processes leave nothing behind when the parent ends them."""

import multiprocessing
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest

from gpsim.errors import Terminated
from gpsim.launchers import Local
from gpsim.stages.jobs import run_trials
from gpsim.workers import WorkerDiedError, begin_worker, ends_when_asked, undisturbed, worker_pool


def hold_a_folder(place: str) -> None:
    with tempfile.TemporaryDirectory(dir=place):
        time.sleep(60)


def waited_for(condition) -> bool:
    until = time.monotonic() + 30
    while not condition() and time.monotonic() < until:
        time.sleep(0.05)
    return condition()


def test_an_interrupted_worker_takes_its_temporary_folder_with_it(tmp_path: Path):
    def interrupted():
        with worker_pool(1, begin_worker, os.getpid()) as pool:
            pool.submit(hold_a_folder, str(tmp_path))
            assert waited_for(lambda: any(tmp_path.iterdir()))
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert waited_for(lambda: not any(tmp_path.iterdir()))


def test_an_interrupted_pool_ends_with_jobs_at_hand(tmp_path: Path):
    """The executor hands out one job more than it has workers."""

    def interrupted():
        with worker_pool(2, begin_worker, os.getpid()) as pool:
            for _ in range(8):
                pool.submit(hold_a_folder, str(tmp_path))
            assert waited_for(lambda: len(list(tmp_path.iterdir())) == 2)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert waited_for(lambda: not multiprocessing.active_children())
    assert not any(tmp_path.iterdir())


HOLDS_THE_LOCK = """
import os, re, sys
from gpsim.workers import WorkerDiedError, begin_worker, worker_pool

def busy(place):
    with open(place, "w") as stream:
        stream.write(str(os.getpid()))
    re.match("(a+)+b", 60 * "a")  # years in C, and no other thread of Python runs meanwhile

if __name__ == "__main__":
    with worker_pool(1, begin_worker, os.getpid()) as pool:
        pool.submit(busy, sys.argv[1]).result()
"""


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere a thread has to look")
def test_the_kernel_ends_a_worker_whose_parent_was_killed(tmp_path: Path):
    """Though it be in the middle of C code, where no thread of its own can look whether the parent is there."""
    script, place = tmp_path / "busy.py", tmp_path / "pid"
    script.write_text(HOLDS_THE_LOCK)
    parent = subprocess.Popen([sys.executable, str(script), str(place)], stderr=subprocess.DEVNULL)
    assert waited_for(lambda: place.exists() and place.read_text())
    worker = int(place.read_text())
    parent.kill()
    parent.wait()
    try:
        assert waited_for(lambda: gone(worker))
    finally:
        if not gone(worker):
            os.kill(worker, signal.SIGKILL)


def gone(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] == "Z"
    except OSError:
        return True


def crash(how: str) -> None:
    if how == "exit":
        raise SystemExit(0)
    if how == "exits":
        os._exit(0)
    os.kill(os.getpid(), getattr(signal, how))


@pytest.mark.parametrize(
    ("how", "killed", "said"),
    [
        ("SIGSEGV", False, r"crashed \(SIGSEGV\)"),
        ("SIGKILL", True, r"was killed \(out of memory\?\)"),
        ("exits", False, r"ended by itself \(exit code 0\)"),
        ("exit", False, r"ended by itself \(exit code 1\)"),
    ],
)
def test_a_worker_that_is_gone_is_one_line_that_says_how(how: str, killed: bool, said: str):
    with pytest.raises(WorkerDiedError, match=f"a worker process {said}; run the same command") as caught:
        list(run_trials(partial(crash_of, how), range(2), Local(2), lambda *_: None))
    assert caught.value.killed == killed


def crash_of(how: str, number: int) -> None:
    crash(how)


def test_asked_to_end_the_block_is_left_once_and_the_old_handler_is_back(interruptible: None):
    before = signal.getsignal(signal.SIGTERM)

    def asked():
        try:
            os.kill(os.getpid(), signal.SIGTERM)
            time.sleep(30)
        finally:
            os.kill(os.getpid(), signal.SIGTERM)  # asked again while it cleans up
            time.sleep(0.01)

    with pytest.raises(Terminated) as caught, ends_when_asked():
        asked()
    assert caught.value.code == 143
    assert signal.getsignal(signal.SIGTERM) == before


@pytest.mark.parametrize(
    ("number", "raised"), [(signal.SIGTERM, Terminated), (signal.SIGINT, KeyboardInterrupt)]
)
def test_a_request_waits_until_what_begins_has_begun(
    interruptible: None, number: int, raised: type[BaseException]
):
    begun = []

    def begin():
        with undisturbed():
            signal.raise_signal(number)
            signal.raise_signal(number)
            begun.append("all of it")

    before = signal.getsignal(number)
    with ends_when_asked(), pytest.raises(raised):
        begin()
    assert begun == ["all of it"]
    assert signal.getsignal(number) == before


def test_a_programs_own_processes_are_left_alone(tmp_path: Path):
    own = multiprocessing.get_context("spawn").Process(target=time.sleep, args=(60,))
    own.start()
    try:
        assert dict(run_trials(abs, [-1], Local(1), lambda *_: None)) == {-1: 1}
        with pytest.raises(ArithmeticError):
            list(run_trials(partial(failing_trial, tmp_path), [0], Local(1), lambda *_: None))
        assert own.is_alive()
    finally:
        own.kill()
        own.join()


def slow_trial(place: Path, number: int) -> int:
    (place / str(number)).touch()
    time.sleep(30)
    return number


def failing_trial(place: Path, number: int) -> int:
    (place / str(number)).touch()
    raise ArithmeticError(f"trial {number}")


def begun_after(place: Path) -> list[str]:
    """Which trials had begun when the last worker was gone."""
    assert waited_for(lambda: not multiprocessing.active_children())
    return sorted(path.name for path in place.iterdir())


@pytest.fixture
def interruptible() -> Iterator[None]:
    """What a shell starts in the background ignores interrupts, and so do its tests."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def test_after_an_interrupt_no_further_trial_begins(tmp_path: Path, interruptible: None):
    def interrupt():
        waited_for(lambda: any(tmp_path.iterdir()))
        os.kill(os.getpid(), signal.SIGINT)

    threading.Thread(target=interrupt).start()
    with pytest.raises(KeyboardInterrupt):
        list(run_trials(partial(slow_trial, tmp_path), range(6), Local(1), lambda *_: None))
    assert begun_after(tmp_path) == ["0"]


def test_after_a_failure_no_further_trial_begins(tmp_path: Path):
    with pytest.raises(ArithmeticError, match="trial 0"):
        list(run_trials(partial(failing_trial, tmp_path), range(6), Local(1), lambda *_: None))
    assert begun_after(tmp_path) == ["0"]


def test_every_trial_is_run_once_and_told():
    told = []
    found = dict(
        run_trials(abs, range(-5, 0), Local(2), lambda done, of, note: told.append((done, of, note)))
    )
    assert found == {-n: n for n in range(1, 6)}
    assert [(done, of) for done, of, _ in told] == [(n, 5) for n in range(1, 6)]
    assert {note for *_, note in told} == {f"trial {n}" for n in range(-5, 0)}


def count_of(many, said):
    return len(many), said["count"]


def test_a_job_is_what_it_was_when_it_was_submitted():
    """The executor packs jobs in a thread of its own: a dictionary that grew meanwhile ended a diagnosis."""
    many, said = [0.5] * 2_000_000, {"count": 1}
    with worker_pool(1, begin_worker, os.getpid()) as pool:
        begun = pool.submit(count_of, many, said)
        said["count"] = 2
        assert begun.result() == (len(many), 1)
