"""The whole proof through the command line; minutes, so among the slow tests."""

import json

import pytest
from gpsim.cli.main import app
from typer.testing import CliRunner


@pytest.mark.slow
def test_a_small_proof_from_beginning_to_end_and_resumed(tmp_path):
    words = ["prove", "--seed", "9", "--out", str(tmp_path / "proof"), "--jobs", "2"]
    first = CliRunner().invoke(app, [*words, "--trials", "3"])
    assert first.exit_code == 0, first.output
    before = {p: p.read_bytes() for p in (tmp_path / "proof").glob("*/000[1-3]/*.json")}
    second = CliRunner().invoke(app, [*words, "--trials", "4"])
    assert second.exit_code == 0, second.output
    assert all(path.read_bytes() == content for path, content in before.items())
    content = json.loads((tmp_path / "proof" / "prove.json").read_text())
    assert content["seed"] == 9
    assert content["all"]["n"] == 4
    assert content["failed"] == []
