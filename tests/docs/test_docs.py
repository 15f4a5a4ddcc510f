"""What docs/ say of files and names is what the code does."""

import re
from pathlib import Path

import yaml

from gpsim.effects.effect import Place
from gpsim.effects.registry import FAMILIES
from gpsim.recordings.files import _KNOWN
from gpsim.recordings.mapping_files import parse_mapping
from gpsim.simulators import make_simulator

ROOT = Path(__file__).resolve().parents[2]
FILES = (ROOT / "docs" / "reference" / "files.md").read_text(encoding="utf-8")


def rows(text):
    """The cells of every row of every table."""
    lines = [line for line in text.splitlines() if line.startswith("| ")]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]


def words(cell):
    """What stands between backticks."""
    return re.findall(r"`([^`]+)`", cell)


def test_the_catalogue_is_told_with_every_familys_parameters():
    told = {
        words(row[0])[0]: words(row[3])
        for row in rows((ROOT / "docs" / "reference" / "effects.md").read_text())[1:]
    }
    assert list(told) == list(FAMILIES)
    place = Place("q", "N", loaded=True)
    for family, effect in FAMILIES.items():
        names = [p.name for variant in effect.variants for p in effect.parameters(place, variant)]
        assert told[family] == names, family


def blocks(text):
    """The indented examples."""
    return re.findall(r"(?:^    .*\n)+", text, flags=re.MULTILINE)


def test_the_recording_in_the_docs_has_every_key():
    example = yaml.safe_load(blocks(FILES)[0])
    assert set(example) == _KNOWN


def test_the_systems_in_the_docs_have_these_channels():
    told = [
        row
        for row in rows(FILES)
        if row[0].startswith("`")
        and row[0].strip("`") in ("cartpole", "pendulum", "slider", "unicycle", "ackermann")
    ]
    assert len(told) == 5
    for name, state, action, parameters in told:
        simulator = make_simulator(name.strip("`"))
        for said, names in (
            (state, simulator.state.names),
            (action, simulator.action.names),
            (parameters, tuple(simulator.parameters)),
        ):
            assert tuple(re.sub(r" \[[^]]*\]", "", said).split(", ")) == (names or ("",)), name


def test_the_mapping_in_the_docs_is_taken():
    text = (ROOT / "docs" / "how-to" / "import.md").read_text(encoding="utf-8")
    example = next(block for block in blocks(text) if "quaternion" in block)
    mapping = parse_mapping(yaml.safe_load(example), "docs/how-to/import.md")
    assert mapping.system == "unicycle"
