"""The order in which tasks run, what a failure stops, and which launcher the settings name."""

import importlib.util
from functools import partial
from pathlib import Path

import pytest
from gpsim.cli.main import app, main
from typer.testing import CliRunner

from gpsim.errors import UsageError
from gpsim.launchers import Local, Slurm, Task, launcher_from, run_tasks


def noted(label, progress):
    """Write down who runs."""
    with Path("ran").open("a") as file:
        file.write(label)
    if label == "!":
        raise UsageError("! is bad")
    return label.upper()


def silent(*_):
    pass


def ran(*needs, processes=1, keep_going=False):
    tasks = [Task(label, partial(noted, label), tuple(after)) for label, after in needs]
    return {o.label: o for o in run_tasks(Local(processes), tasks, silent, keep_going=keep_going)}


def test_a_task_begins_when_what_it_waits_for_is_done_and_in_the_order_of_the_plan():
    found = ran(("d", "bc"), ("a", ""), ("b", "a"), ("c", "a"), ("e", ""))
    assert Path("ran").read_text() == "abcde"
    assert [o.result for o in found.values()] == list("ABCDE")
    assert set(ran(("b", "a"), ("a", ""), ("c", ""), processes=2)) == set("abc")


def test_the_first_failure_stops_the_rest():
    with pytest.raises(UsageError, match="! is bad"):
        ran(("a", ""), ("!", ""), ("c", ""))
    assert Path("ran").read_text() == "a!"


def test_who_keeps_going_loses_only_what_waits_for_a_failure():
    found = ran(("!", ""), ("b", "!"), ("c", "b"), ("d", ""), keep_going=True)
    assert Path("ran").read_text() == "!d"
    assert [label for label, o in found.items() if o.error is None] == ["d"]
    assert str(found["c"].error) == "not made, as b failed"


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
