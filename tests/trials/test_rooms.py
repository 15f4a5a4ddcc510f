"""The rooms of the trials: each is entered by its `__init__`, and none knows those that come after it."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

TRIALS = Path(__file__).parents[2] / "gpsim" / "trials"
ORDER = [
    "worlds",
    "catalogue",
    "outside",
    "truth",
    "drawing",
    "robots",
    "blinding",
    "rivals",
    "scoring",
    "statistics",
]
OUTER = [
    *TRIALS.parent.glob("stages/*.py"),
    *TRIALS.parent.glob("reports/*.py"),
    *TRIALS.parents[1].glob("benchmarks/*.py"),
]


def rooms_that(path):
    """(room, the rest of the module's name) of every import from the trials."""
    found = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("gpsim.trials"):
            inner = node.module.split(".")[2:] or [alias.name for alias in node.names]
            found += [(inner[0], inner[1:])] if node.module != "gpsim.trials" else [(n, []) for n in inner]
    return found


def test_every_room_is_in_order_and_small():
    assert sorted(p.name for p in TRIALS.iterdir() if (p / "__init__.py").is_file()) == sorted(ORDER)
    assert [p.name for p in TRIALS.glob("*.py")] == ["__init__.py"]
    for room in ORDER:
        assert len(list((TRIALS / room).glob("*.py"))) <= 20


@pytest.mark.parametrize("room", ORDER)
def test_a_room_enters_earlier_rooms_by_their_init(room):
    for path in (TRIALS / room).glob("*.py"):
        for other, inner in rooms_that(path):
            assert ORDER.index(other) <= ORDER.index(room), f"{path.name} imports {other}"
            assert other == room or not inner, f"{path.name} imports {other}.{inner[0]}"


def test_other_packages_enter_the_trials_by_their_inits():
    assert [p.name for p in OUTER if any(inner for _, inner in rooms_that(p))] == []


def test_no_file_is_named_by_a_year():
    assert not list(TRIALS.rglob("*20[0-9][0-9]*.py"))
    assert not list(Path(__file__).parent.glob("*20[0-9][0-9]*.py"))


def test_optional_programs_are_loaded_when_they_are_needed():
    code = (
        "import sys, pkgutil, importlib, gpsim.trials as t\n"
        "[importlib.import_module(m.name) for m in pkgutil.walk_packages(t.__path__, 'gpsim.trials.')]\n"
        "sys.exit(any(name in sys.modules for name in ('mujoco', 'pysindy')) or 'gpsim.trials.rivals.sindy' not in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
