"""A proof that is asked to end in the middle of a diagnosis ends with one line and leaves nothing half-made."""

import os
import signal
import subprocess
import sys
import time

import pytest


@pytest.mark.slow  # of a diagnosis tests/diagnosis/test_interrupted.py shows it
def test_asked_to_end_a_proof_says_a_line(tmp_path):
    out, rooms = tmp_path / "proof", tmp_path / "rooms"
    rooms.mkdir()
    words = ["prove", "--trials", "1", "--seed", "1", "--no-long", "--jobs", "1", "--out", str(out)]
    process = subprocess.Popen(
        [sys.executable, "-m", "gpsim", *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "TMPDIR": str(rooms)},
    )
    deadline = time.monotonic() + 120
    while not list(rooms.glob("gpsim-blind-*/recording/*")) and time.monotonic() < deadline:
        time.sleep(0.02)
    process.send_signal(signal.SIGTERM)
    _, complained = process.communicate(timeout=60)
    assert process.returncode == 143
    assert complained.splitlines() == [
        "interrupted: finished artifacts are whole, run the same command to carry on"
    ]
    assert not list((out / "diagnoses").iterdir())
    while list(rooms.iterdir()) and time.monotonic() < deadline:  # the worker's, which ends a moment later
        time.sleep(0.02)
    assert not list(rooms.iterdir())
