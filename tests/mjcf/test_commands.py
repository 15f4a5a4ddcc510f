"""`gpsim simulators`: what it prints for people and as JSON, and what it refuses with exit code 2."""

import json
import sys

import pytest
from cli_calls import ANSWER
from gpsim.cli.main import main
from mjcf_models import DOUBLE, PENDULUM, written

from gpsim.simulators import SIMULATORS


def run(monkeypatch, *words):
    monkeypatch.setattr(sys, "argv", ["gpsim", *words])
    with pytest.raises(SystemExit) as ended:
        main()
    return ended.value.code


def test_simulators_are_listed_shown_and_checked(tmp_path, monkeypatch, capsys):
    name = written(tmp_path, PENDULUM)
    assert run(monkeypatch, "simulators", "list") == 0
    assert "cartpole" in capsys.readouterr().out
    assert run(monkeypatch, "simulators", "show", "pendulum") == 0
    assert "theta [N m]" in capsys.readouterr().out
    assert run(monkeypatch, "simulators", "check", name) == 0
    said = capsys.readouterr().out
    assert "own step     0.001 s" in said
    assert "rod.mass = 1.3 kg" in said
    assert run(monkeypatch, "simulators", "check", "pendulum") == 2
    assert "`check` is for MuJoCo models" in capsys.readouterr().err
    assert run(monkeypatch, "simulators", "show", str(tmp_path / "absent.xml")) == 2
    assert "no file" in capsys.readouterr().err


@pytest.mark.parametrize("words", [("list",), ("show", "pendulum"), ("check",)])
def test_each_of_them_answers_in_json(words, tmp_path, monkeypatch, capsys):
    words = (*words, written(tmp_path, DOUBLE)) if words == ("check",) else words
    assert run(monkeypatch, "simulators", *words, "--json") == 0
    content = json.loads(capsys.readouterr().out)
    ANSWER.validate(content)
    if words == ("list",):
        assert content["registered"] == list(SIMULATORS)
    elif words[0] == "check":
        assert content["checked"]["step"] == 0.002
        assert content["declared"]["parameters"]["lower.mass"] == [0.6, "kg"]
    else:
        assert content["declared"]["coordinates"] == {"theta": "N m"}


def test_an_environment_tells_its_control_step(monkeypatch, capsys):
    assert run(monkeypatch, "simulators", "check", "gym:InvertedDoublePendulum-v5") == 0
    assert "control step 0.05 s, 5 steps each" in capsys.readouterr().out
