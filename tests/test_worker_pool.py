"""Worker processes leave nothing behind when the parent ends them."""

import os
import tempfile
import time
from pathlib import Path

import pytest

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
