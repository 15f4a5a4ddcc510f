"""Worker processes leave nothing behind when the parent ends them."""

import multiprocessing
import os
import signal
import tempfile
import threading
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest

from gpsim.stages.trial_jobs import run_trials
from gpsim.workers import begin_worker, worker_pool


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
        list(run_trials(partial(slow_trial, tmp_path), range(6), 1, lambda *_: None))
    assert begun_after(tmp_path) == ["0"]


def test_after_a_failure_no_further_trial_begins(tmp_path: Path):
    with pytest.raises(ArithmeticError, match="trial 0"):
        list(run_trials(partial(failing_trial, tmp_path), range(6), 1, lambda *_: None))
    assert begun_after(tmp_path) == ["0"]


def test_every_trial_is_run_once_and_told():
    told = []
    found = dict(run_trials(abs, range(-5, 0), 2, lambda done, of, note: told.append((done, of, note))))
    assert found == {-n: n for n in range(1, 6)}
    assert [(done, of) for done, of, _ in told] == [(n, 5) for n in range(1, 6)]
    assert {note for *_, note in told} == {f"trial {n}" for n in range(-5, 0)}
