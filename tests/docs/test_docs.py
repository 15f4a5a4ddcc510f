"""What docs/ say of files and names is what the code does."""

import re
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import ClassVar

import numpy as np
import yaml

import gpsim.effects
from gpsim.channels import FloatArray
from gpsim.effects import effect as effect_module
from gpsim.effects.place import Place
from gpsim.effects.registry import FAMILIES, register
from gpsim.recordings.files import _Metadata
from gpsim.recordings.mapping import parse_mapping
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
    catalogue = (ROOT / "docs" / "reference" / "effects.md").read_text().partition("\n## ")[0]
    told = {words(row[0])[0]: words(row[3]) for row in rows(catalogue)[1:]}
    assert list(told) == list(FAMILIES)
    place = Place("q", "N", loaded=True)
    for family, effect in FAMILIES.items():
        names = [p.name for variant in effect.variants for p in effect.parameters(place, variant)]
        assert told[family] == list(dict.fromkeys(names)), family


def blocks(text):
    """The indented examples."""
    return re.findall(r"(?:^    .*\n)+", text, flags=re.MULTILINE)


def test_the_recording_in_the_docs_has_every_key():
    example = yaml.safe_load(blocks(FILES)[0])
    assert set(example) == {field.name for field in fields(_Metadata)}


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


def test_the_effects_in_the_docs_are_some():
    text = (ROOT / "docs" / "how-to" / "effect.md").read_text(encoding="utf-8")
    own, family = re.findall(r"^```python\n(.*?)^```$", text, flags=re.MULTILINE | re.DOTALL)
    names = dict(vars(effect_module)) | {"ClassVar": ClassVar, "FloatArray": FloatArray, "Mapping": Mapping}
    exec(own, names)
    assert [check for check in gpsim.effects.check(names["Cable"]) if check.wrong] == []
    exec(family, names)
    spring = names["HardeningSpring"]()
    assert "hardening_spring" in register([*FAMILIES.values(), spring])
    (stiffness,) = spring.parameters(Place("q", "N", span=2.0, reach=0.5))
    assert (stiffness.name, stiffness.unit, stiffness.starts) == ("stiffness", "N/m^3", (16.0,))
    force = spring.force(np.array([0.5]), np.zeros(1), {"stiffness": np.array([16.0])})
    np.testing.assert_allclose(force, [-2.0])


def test_every_group_of_choices_is_told():
    text = (ROOT / "docs" / "reference" / "configuration.md").read_text(encoding="utf-8")
    told = re.findall(r"^### (\w+)=([\w/]+)$", text, flags=re.MULTILINE)
    there = {(path.relative_to(ROOT / "conf").parts[0], path) for path in (ROOT / "conf").glob("*/**/*.yaml")}
    groups = {group for group, _ in there} - {"diagnose"}  # whose settings have a page of their own
    assert {group for group, _ in told} == groups
    assert len(told) == len([group for group, _ in there if group in groups])
