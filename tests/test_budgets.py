"""How large each room may be: lines and files, as pyproject.toml says. Whoever raises one does nothing else in that commit."""

import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
BUDGETS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["gpsim"]["budgets"]


def of(room: str) -> list[Path]:
    """The Python files of a room; gpsim itself are its loose modules."""
    return list((ROOT / room).glob("*.py" if room == "gpsim" else "**/*.py"))


def test_every_room_has_a_budget():
    rooms = {f"gpsim/{path.parent.name}" for path in ROOT.glob("gpsim/*/__init__.py")}
    assert set(BUDGETS) == rooms | {"gpsim", "cli", "tests"}


@pytest.mark.parametrize("room", BUDGETS)
def test_no_room_is_larger_than_its_budget(room):
    lines, files = BUDGETS[room]
    found = of(room)
    assert len(found) <= files, f"{room}: {len(found)} files, {files} are its budget"
    count = sum(len(path.read_text(encoding="utf-8").splitlines()) for path in found)
    assert count <= lines, f"{room}: {count} lines, {lines} are its budget"
