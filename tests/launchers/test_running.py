"""The order in which tasks run, what a failure stops, and which launcher the settings name."""

import importlib.util
from functools import partial
from pathlib import Path

import pytest
from gpsim.cli.main import app, main
from typer.testing import CliRunner

from gpsim.errors import UsageError
from gpsim.launchers import Local, Outcome, Slurm, Task, launcher_from, run_tasks, settle
from gpsim.launchers.parcels import Parcel, packed, unpacked
from gpsim.launchers.running import _run


class Here:
    """An executor of one place, in this process: the last that was started ends first."""

    def __init__(self, room=2, failing=()):
        self.room, self.failing, self.started, self.running = room, failing, [], []

    def free(self):
        return self.room - len(self.running)

    def start(self, task):
        self.started.append(task.label)
        self.running.append(task)

    def ended(self, update):
        task = self.running.pop()
        if task.label in self.failing:
            return [Outcome(task.label, error=UsageError(f"{task.label} is bad"))]
        return [Outcome(task.label, task.label.upper())]

    def expect(self, unfinished):
        self.expected = unfinished


def tasks(*needs):
    return [Task(label, print, tuple(after)) for label, after in needs]


def silent(*_):
    pass


def test_a_task_begins_when_what_it_waits_for_is_done_and_in_the_order_of_the_plan():
    executor = Here()
    plan = tasks(("d", "bc"), ("a", ""), ("b", "a"), ("c", "a"), ("e", ""))
    ended = [o.label for o in _run(executor, plan, silent, False)]
    assert executor.started == ["a", "e", "b", "c", "d"]
    assert ended[-1] == "d"
    assert executor.expected == 1


def test_the_first_failure_stops_the_rest():
    executor = Here(room=1, failing=("b",))
    with pytest.raises(UsageError, match="b is bad"):
        list(_run(executor, tasks(("a", ""), ("b", ""), ("c", "")), silent, False))
    assert executor.started == ["a", "b"]


def test_who_keeps_going_loses_only_what_waits_for_a_failure():
    executor = Here(room=1, failing=("a",))
    found = {
        o.label: o for o in _run(executor, tasks(("a", ""), ("b", "a"), ("c", "b"), ("d", "")), silent, True)
    }
    assert executor.started == ["a", "d"]
    assert [label for label, o in found.items() if o.error is None] == ["d"]
    assert str(found["c"].error) == "not made, as b failed"


def test_processes_of_this_machine_do_the_same():
    found = {
        o.label: o
        for o in run_tasks(
            Local(1), [Task("x", partial(abs_of, -2)), Task("y", broken)], silent, keep_going=True
        )
    }
    assert found["x"].result == 2
    assert "division" in str(found["y"].error)


def abs_of(number, progress):
    return abs(number)


def broken(progress):
    return 1 // 0


SLURM = {
    "name": "slurm", "queue": None, "account": None, "walltime": "01:00:00", "memory": "1GB", "cores": 1, "setup": [],
    "directives": [], "skip": [], "minimum": 0, "maximum": 2, "interface": None, "python": None, "logs": "logs",
}  # fmt: skip


def test_settings_name_the_launcher(monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: name)
    assert launcher_from({"name": "local"}, 3, silent) == Local(3)
    assert launcher_from({"name": "dask"}, 3, silent).workers == 3
    found = launcher_from(SLURM | {"setup": ["module load x"]}, 3, silent)
    assert isinstance(found, Slurm)
    assert found.setup == ("module load x",)
    for wrong, said in (
        ({"name": "pbs"}, "launcher.name: 'pbs' is not one of local, dask, slurm"),
        (SLURM | {"maximum": 0}, "launcher: expected 0 <= minimum <= maximum"),
        (SLURM | {"cores": "two"}, "launcher.cores: expected a whole number"),
    ):
        with pytest.raises(UsageError, match=said):
            launcher_from(wrong, 1, silent)


@pytest.mark.parametrize(
    "words", [["prove", "--out", "p", "launcher=dask"], ["run", "full-loop", "launcher=slurm"]]
)
def test_without_the_extra_one_line_says_how_to_install_it(monkeypatch, capsys, words):
    found = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util,
        "find_spec",
        lambda n, *a: None if n in ("distributed", "dask_jobqueue") else found(n, *a),
    )
    monkeypatch.setattr("sys.argv", ["gpsim", *words])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 2
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 1
    assert "install with: pip install 'gpsim[cluster]'" in said[0]
    assert not list(Path().iterdir())


@pytest.mark.parametrize("words", [["fit-gp", "launcher=slurm"], ["diagnose", "launcher.workers=3"]])
def test_where_one_job_runs_here_a_launcher_is_refused(words):
    result = CliRunner().invoke(app, words)
    assert isinstance(result.exception, UsageError)


def test_a_parcel_holds_files_by_their_relative_path_and_is_checked(tmp_path):
    Path("in/deep").mkdir(parents=True)
    Path("in/deep/a.txt").write_text("a")
    Path("in/.lock").write_text("x")
    parcel = packed([Path("in"), Path("absent")])
    assert unpacked(parcel, tmp_path / "out") == ["in/deep/a.txt"]
    assert packed([Path("in")]) == parcel  # the same files, the same bytes
    assert packed([Path("in")], without=["in/deep/a.txt"]).content != parcel.content
    with pytest.raises(UsageError, match="damaged on its way"):
        unpacked(Parcel(parcel.content[:-1] + b"!", parcel.sha256), tmp_path / "other")
    for outside in (tmp_path, Path("../x")):
        with pytest.raises(UsageError, match="launcher.shared=false"):
            packed([outside])


def test_what_came_back_is_put_in_its_place_whole(tmp_path):
    for name, text in (("public/0001/a", "1"), ("scores/0001.json", "2")):
        path = tmp_path / "back/proof" / name
        path.parent.mkdir(parents=True)
        path.write_text(text)
    old = Path("proof/public/0001")
    old.mkdir(parents=True)
    (old / "left").write_text("of a half")
    settle(tmp_path / "back", Path("proof"))
    assert sorted(p.as_posix() for p in Path("proof").rglob("*") if p.is_file()) == [
        "proof/public/0001/a",
        "proof/scores/0001.json",
    ]
