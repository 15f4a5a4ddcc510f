"""Two processes that want the same artifact in one runs/: one makes it, the other waits and finds it."""

import signal
import subprocess
import sys
from pathlib import Path

import pytest
from gpsim.cli.configuration import resolve
from gpsim.cli.progress import Board

from gpsim.artifacts import Recipe, held
from gpsim.stages.stage import Request, Stage

MAKER = """
import sys, time
from pathlib import Path
from gpsim.artifacts import Recipe
from gpsim.stages.stage import Request, Stage

place, until = Path(sys.argv[1]), Path(sys.argv[2])

def write(request, recipe, folder):
    with (place / "writers").open("a") as stream:
        stream.write("wrote\\n")
    print("writing", flush=True)
    while not until.exists():
        time.sleep(0.01)
    (folder / "answer").write_text("42")

config = {"runs_dir": str(place / "runs"), "experiment": "any"}
tell = lambda done, total, note: print(note, flush=True)
stage = Stage("slow", lambda request: Recipe("slow", {"n": 1}, {}, {}), write, format=1)
artifact, existed = stage.make(Request(config, progress=tell))
print(artifact.path, existed, flush=True)
"""


def started(place: Path, until: str = "go") -> subprocess.Popen:
    words = [sys.executable, "-c", MAKER, str(place), str(place / until)]
    return subprocess.Popen(words, stdout=subprocess.PIPE, text=True)


def line(process: subprocess.Popen) -> str:
    assert process.stdout is not None
    return process.stdout.readline().strip()


def test_the_second_waits_for_the_first_and_takes_what_it_made(tmp_path):
    with started(tmp_path) as first:
        assert line(first) == "writing"
        with started(tmp_path) as second:
            assert line(second) == f"waiting for process {first.pid}, which is making it"
            (tmp_path / "go").touch()
            made = tmp_path / "runs/any/slow/v0001"
            assert line(first) == f"{made} False"
            assert line(second) == f"{made} True"
    assert (tmp_path / "writers").read_text() == "wrote\n"
    assert [p.name for p in (tmp_path / "runs/any/slow").iterdir()] == ["v0001"]


def test_who_waits_takes_over_from_one_that_is_killed(tmp_path):
    with started(tmp_path, "never") as first:
        assert line(first) == "writing"
        with started(tmp_path) as second:
            assert line(second).startswith(f"waiting for process {first.pid}")
            (tmp_path / "go").touch()
            first.send_signal(signal.SIGKILL)
            assert line(second) == "writing"
            assert line(second) == f"{tmp_path / 'runs/any/slow/v0001'} False"
    assert (tmp_path / "writers").read_text() == "wrote\nwrote\n"
    assert [p.name for p in (tmp_path / "runs/any/slow").iterdir()] == ["v0001"]


def test_what_a_killed_process_left_blocks_nobody_and_goes(tmp_path):
    with started(tmp_path, "never") as first:
        assert line(first) == "writing"
        first.kill()
    shelf, notes = tmp_path / "runs/any/slow", []
    assert list(shelf.glob(".making-*.lock"))
    stage = Stage("slow", lambda request: Recipe("slow", {"n": 2}, {}, {}), lambda *_: None, format=1)
    config = {"runs_dir": str(tmp_path / "runs"), "experiment": "any"}
    stage.make(Request(config, progress=lambda *told: notes.append(told)))
    assert not notes
    assert [p.name for p in shelf.iterdir()] == ["v0001"]


def test_a_failed_writer_holds_nothing(tmp_path):
    def failing(request, recipe, folder):
        raise ArithmeticError("no")

    stage = Stage("slow", lambda request: Recipe("slow", {}, {}, {}), failing, format=1)
    asked = Request({**resolve([], None), "runs_dir": str(tmp_path / "runs")})
    for _ in range(2):
        with pytest.raises(ArithmeticError):
            stage.make(asked)
    assert not list((tmp_path / "runs/cartpole/slow").iterdir())


def test_a_disk_without_locks_makes_nobody_wait(tmp_path, monkeypatch):
    def refused(*_):
        raise OSError("no locks available")

    monkeypatch.setattr("gpsim.artifacts.locks.fcntl.flock", refused)
    with held(tmp_path / "a.lock", pytest.fail):
        assert (tmp_path / "a.lock").exists()
    assert not list(tmp_path.iterdir())


def test_what_is_waited_for_is_said_at_once(capsys):
    with Board() as board:
        board.update("collect", 0, 0, "waiting for process 7, which is making it")
    assert capsys.readouterr().err == "  collect: waiting for process 7, which is making it\n"
