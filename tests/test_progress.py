"""What the loop says of itself while it runs."""

import sys

import pytest
from gpsim.cli import progress


@pytest.fixture
def clock(monkeypatch):
    now = [0.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    return now


def test_the_whole_loop_has_its_own_count_and_time_left(clock, capsys):
    with progress.Board(5) as board:
        board.finish("a", "kept a", kept=True)
        clock[0] = 120.0
        board.finish("b", "made b")
        clock[0] = 240.0
        for job in ("c", "d", "e"):
            board.finish(job, f"made {job}")
    lines = capsys.readouterr().err.splitlines()
    # What was kept says nothing of the pace.
    assert lines[0] == "kept a (1 of 5 jobs)"
    assert lines[1] == "made b (2 of 5 jobs, about 6 min left)"
    assert lines[2] == "made c (3 of 5 jobs, about 4 min left)"
    assert lines[4] == "made e (5 of 5 jobs)"


def test_a_single_job_has_no_count(capsys):
    with progress.Board() as board:
        board.finish("a", "made a")
    assert capsys.readouterr().err == "made a\n"


@pytest.mark.parametrize("terminal", [True, False])
def test_what_happens_once_is_said_once_to_who_watches_and_only_if_something_is_done(
    capsys, monkeypatch, terminal
):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: terminal)
    seen = []
    report = progress.saying_once(lambda *told: seen.append(told), "compiling")
    report(0, 100, "begun")
    assert capsys.readouterr().err == ""
    report(5, 100, "going on")
    report(6, 100, "going on")
    assert capsys.readouterr().err == ("compiling\n" if terminal else "")
    assert seen == [(0, 100, "begun"), (5, 100, "going on"), (6, 100, "going on")]
