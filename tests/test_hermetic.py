"""Tests see nothing of what their user did before: no artifacts, no home, no settings."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from gpsim.cli.configuration import resolve
from hermetic import CHECKOUT, RUNS, TrespassError

from gpsim.artifacts import Recipe, Store
from gpsim.stages.stage import Request

INNER = """
import os, subprocess, sys
from pathlib import Path

def test_a_stranger_here():
    assert not Path("runs").exists()
    assert not (Path.home() / "sentinel").exists()
    assert not Path("~/sentinel").expanduser().exists()
    assert not [n for n in os.environ if n in ("COLUMNS", "MPLBACKEND", "GPSIM_OTHER", "HYDRA_FULL_ERROR")]
    assert os.environ["GPSIM_RECORDINGS"] == WHERE
    said = "import os, pathlib, sys; print(os.listdir(), pathlib.Path.home(), sys.pycache_prefix)"
    child = subprocess.run([sys.executable, "-c", said], capture_output=True, text=True, check=True)
    assert child.stdout == f"[] {Path.home()} {ROOT / '.pytest_cache' / 'bytecode'}\\n"
    assert os.listdir(ROOT / ".pytest_cache" / "bytecode")  # this very file
    Path("runs").mkdir()
    Path("runs/mine").touch()
    (Path.home() / "mine").touch()

def test_a_trespasser():
    (ROOT / "runs" / "sentinel").write_text("changed")
"""


def test_a_users_runs_home_and_environment_are_out_of_sight(tmp_path):
    """These very fixtures, in a checkout and a home that hold something."""
    tests, runs, home = (tmp_path / name for name in ("it/tests", "it/runs", "home"))
    for folder in (tests, runs, home):
        folder.mkdir(parents=True)
    for name in ("conftest.py", "hermetic.py", "blank.py"):
        shutil.copy(CHECKOUT / "tests" / name, tests)
    head = f"WHERE = {str(tmp_path / 'it' / 'recorded')!r}\nimport pathlib\nROOT = pathlib.Path({str(tmp_path / 'it')!r})"
    (tests / "test_inner.py").write_text(head + INNER)
    for folder in (runs, home):
        (folder / "sentinel").write_text("the user's")
    users = {
        "HOME": str(home),
        "COLUMNS": "7",
        "MPLBACKEND": "nonsense",
        "GPSIM_OTHER": "1",
        "HYDRA_FULL_ERROR": "1",
        "PYTHONDONTWRITEBYTECODE": "1",
    }
    inherited = {k: v for k, v in os.environ.items() if not k.startswith("PYTEST_")}
    ended = subprocess.run(
        [
            sys.executable,
            "-m",
            "pytest",
            "-q",
            "-p",
            "no:cacheprovider",
            "--basetemp",
            str(tmp_path / "base"),
            "tests",
        ],
        cwd=tmp_path / "it",
        env={**inherited, **users, "GPSIM_RECORDINGS": "recorded"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert "1 failed, 1 passed" in ended.stdout, ended.stdout + ended.stderr
    assert "TrespassError: a test must not touch the user's runs/" in ended.stdout
    for folder in (runs, home):
        assert [p.name for p in folder.iterdir()] == ["sentinel"]
        assert (folder / "sentinel").read_text() == "the user's"


def test_a_relative_runs_dir_is_one_of_this_test(tmp_path):
    store = Request(resolve([], None)).store
    made = store.publish(Recipe("collect", {}, {}, {}), lambda folder: None)
    assert made.path.resolve().is_relative_to(tmp_path)
    assert Store(tmp_path / "runs", "cartpole").find(Recipe("collect", {}, {}, {})) is not None


@pytest.mark.parametrize(
    "act",
    [lambda: (RUNS / "README.md").read_bytes(), lambda: list(RUNS.iterdir()), lambda: (RUNS / "new").mkdir()],
)
def test_the_checkouts_runs_cannot_be_touched_from_a_test(act):
    with pytest.raises(TrespassError):
        act()


def test_nothing_is_left_in_a_tests_folder_by_the_one_before():
    assert list(Path.cwd().iterdir()) == []
    assert not Path.cwd().is_relative_to(CHECKOUT)
