"""`gpsim simulators`: what it prints for people and as JSON, and what it refuses with exit code 2."""

import json

import pytest
from cli_calls import ANSWER, called
from mjcf_models import DOUBLE, PENDULUM, written

from gpsim.simulators import SIMULATORS


@pytest.fixture
def gpsim(monkeypatch, capfd):
    return lambda *words: called(monkeypatch, capfd, *words)


def test_simulators_are_listed_shown_and_checked(tmp_path, gpsim):
    name, absent = written(tmp_path, PENDULUM), str(tmp_path / "absent.xml")
    for words, code, said in (
        (("list",), 0, ["cartpole"]),
        (("show", "pendulum"), 0, ["theta [N m]"]),
        (("check", name), 0, ["own step     0.001 s", "rod.mass = 1.3 kg"]),
        (("check", "pendulum"), 2, ["`check` is for MuJoCo models"]),
        (("show", absent), 2, ["no file"]),
        (("check", "gym:InvertedDoublePendulum-v5"), 0, ["control step 0.05 s, 5 steps each"]),
    ):
        ended, out, err = gpsim("simulators", *words)
        assert ended == code
        assert all(text in (err if code else out) for text in said)


@pytest.mark.parametrize("words", [("list",), ("show", "pendulum"), ("check",)])
def test_each_of_them_answers_in_json(words, tmp_path, gpsim):
    words = (*words, written(tmp_path, DOUBLE)) if words == ("check",) else words
    code, out, _ = gpsim("simulators", *words, "--json")
    content = json.loads(out)
    assert code == 0
    ANSWER.validate(content)
    if words == ("list",):
        assert content["registered"] == list(SIMULATORS)
    elif words[0] == "check":
        assert content["checked"]["step"] == 0.002
        assert content["declared"]["parameters"]["lower.mass"] == [0.6, "kg"]
    else:
        assert content["declared"]["coordinates"] == {"theta": "N m"}
