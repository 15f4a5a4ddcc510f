"""Pages that are made from the code and from records are current, and say what they are made from."""

import importlib
import json
from pathlib import Path

import pytest
import typer
from gpsim.cli.main import app

from gpsim.reports.prove_page import record_sheets
from gpsim.trials.summary import GOALS

ROOT = Path(__file__).resolve().parents[2]
RECORDS = sorted((ROOT / "benchmarks" / "proofs").glob("*.json"))


@pytest.fixture
def made(monkeypatch):
    """docs/generate.py, which stands beside what it imports."""
    monkeypatch.syspath_prepend(str(ROOT / "docs"))
    return importlib.import_module("generate")


def test_every_made_page_is_current(made):
    for name, page in made.PAGES.items():
        assert (ROOT / name).read_text(encoding="utf-8") == page(), f"{name}: run python docs/generate.py"


def commands(command, name):
    """Every command that is shown, by its whole name."""
    yield name, command
    for below, inner in getattr(command, "commands", {}).items():
        if not inner.hidden:
            yield from commands(inner, f"{name} {below}")


def test_every_command_and_every_option_is_told():
    text = (ROOT / "docs" / "reference" / "cli.md").read_text(encoding="utf-8")
    for name, command in commands(typer.main.get_command(app), "gpsim"):
        part = text.split(f"# {name}\n", 1)[1].split("\n#", 1)[0] if name != "gpsim" else text
        for parameter in command.params:
            if (
                parameter.param_type_name == "option"
                and not parameter.hidden
                and not {"--quiet", "--trust"} & set(parameter.opts)
            ):
                assert all(f"`{option}" in part for option in parameter.opts if option != "--help"), (
                    name,
                    parameter.opts,
                )


@pytest.mark.parametrize("path", RECORDS, ids=lambda path: path.stem)
def test_a_record_of_a_proof_has_goals_tables_and_misses(path):
    record = json.loads(path.read_text(encoding="utf-8"))
    assert record["seed"] == int(path.stem)
    assert set(record["goals"]) <= set(GOALS)
    titles = [sheet.title for sheet in record_sheets(record)]
    assert titles[-1] == "Every miss"
    for sheet in record_sheets(record):
        assert all(len(cells) == len(sheet.columns) for cells in sheet.rows), sheet.title
    for goal in record["goals"].values():
        if "/" in goal.get("count", ""):
            right, of = map(int, goal["count"].split("/"))
            assert goal["got"] == pytest.approx(right / of, abs=1e-6)


def test_a_new_proof_is_a_file_more(made, monkeypatch, tmp_path):
    """prove.json itself, copied beside the others, is a column and a section."""
    from generators import proofs

    block = {"n": 4, "right": 3, "share": 0.75, "interval": [0.3, 0.95], "failed": 0}
    new = {
        "seed": 9099,
        "n": 4,
        "single": block,
        "goals": {
            "single.share": {"wanted": ">= 0.97", "got": 0.75, "reached": False},
            "pair.share": {"wanted": ">= 0.92", "got": None, "reached": None},
        },
        "rivals": {},
        "all": {"single": block, "n": 4},
        "identifiable": {"n": 4},
        "long": {"n": 0},
        "strata": {},
        "families": {"spring": block},
        "kinds": {},
        "every_miss": [
            {
                "trial": "0001",
                "stratum": "single",
                "world": "slider",
                "truth": "spring on q",
                "said": "none",
                "error": "",
                "equivalents": "",
            }
        ],
        "about": ["One job on one core."],
        "diagnosed_under": ["abc1234"],
    }
    (tmp_path / "9099.json").write_text(json.dumps(new))
    for path in RECORDS:
        (tmp_path / path.name).write_bytes(path.read_bytes())
    monkeypatch.setattr(proofs, "RECORDS", tmp_path)
    text = proofs.proofs_page()
    assert "| one effect: right | >= 0.97 | 75.0 % (3/4) ! |  | " in text
    assert "## Seed 9099\n\n    gpsim prove --seed 9099 --out DIR\n\nOne job on one core." in text
    assert "| 0001 | single: slider | spring on q | none |  |" in text
    assert "abc1234" not in text
