"""`gpsim plan`, `gpsim collect --plan` and `gpsim watch` as they are called."""

import json
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml
from cli_calls import ANSWER
from gpsim.cli.main import main
from made_posteriors import driven

import gpsim
from gpsim.artifacts import Recipe, Store
from gpsim.policies import Policy
from gpsim.stages.policy_files import write_policy

ASKED = {"only": ["viscous_friction", "spring"]}
SMALL = (
    "plan.piece=3",
    "plan.candidates=8",
    "plan.rounds=0",
    "plan.checked=20",
    "plan.box={q: [-3, 3], q_dot: [-3, 3]}",
)


def frame(minutes, **changes):
    (episode,) = driven(minutes, **changes).episodes
    force = np.append(episode.actions[:, 0], episode.actions[-1, 0])
    return pd.DataFrame(
        {"t": episode.t, "q": episode.states[:, 0], "q_dot": episode.states[:, 1], "force": force}
    )


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    """A diagnosis of a minute, and beside it one whose verdict is none."""
    folder = tmp_path_factory.mktemp("planned")
    units = {"q": "m", "q_dot": "m/s", "force": "N"}
    recording = gpsim.recording_from_frame(frame(1.0), units, "slider")
    gpsim.diagnose(recording, families=ASKED).save(folder / "found")
    return folder / "found"


def called(monkeypatch, capfd, *words):
    monkeypatch.setattr(sys, "argv", ["gpsim", *map(str, words)])
    capfd.readouterr()
    with pytest.raises(SystemExit) as ended:
        main()
    return ended.value.code or 0, *capfd.readouterr()


def test_a_plan_is_written_whole_and_found_again(found, monkeypatch, capfd):
    words = ("plan", found, "--minutes", "0.1", *SMALL)
    code, said, _ = called(monkeypatch, capfd, *words, "--out", "made")
    assert code == 0
    assert "left the box" in said
    table, facts = pd.read_csv("made/plan.csv"), yaml.safe_load(Path("made/plan.yaml").read_text())
    assert list(table) == ["t", "force"]
    assert np.diff(table.t) == pytest.approx(0.02)
    assert facts["schema"] == "gpsim.plan/1"
    assert facts["box"]["q"] == [-3.0, 3.0]
    assert facts["safety"]["left"] == 0
    page = Path("made/report.html").read_text()
    assert "What to play next" in page
    assert called(monkeypatch, capfd, *words)[0] == 0
    assert "already there" in called(monkeypatch, capfd, *words)[1]
    answer = json.loads(called(monkeypatch, capfd, "--json", *words)[1])
    ANSWER.validate(answer)
    assert answer["plan"]["pieces"] == facts["pieces"]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("plan.commands={force: [1, 2]}",), "excludes the command at rest"),
        (("plan.box={q: [1, 2]}",), "does not contain the first state"),
        (("plan.margin=2",), "margin must be in"),
        (("--minutes", "0"), "expected more than 0"),
        (("gp.n_train=3",), "not used here"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(found, monkeypatch, capfd, words, said):
    code, _, error = called(monkeypatch, capfd, "plan", found, *words, "--out", "made")
    assert code == 2
    assert said in error
    assert error.strip().count("\n") == 0
    assert not Path("made").exists()


def test_there_is_nothing_to_plan_for_a_verdict_of_none(found, monkeypatch, capfd):
    monkeypatch.setattr("gpsim.stages.plan.read_diagnosis", lambda folder: type("D", (), {"verdict": "none"}))
    code, _, error = called(monkeypatch, capfd, "plan", found, "--out", "made")
    assert code == 2
    assert "verdict is none" in error


def test_a_watch_ends_with_4_where_friction_has_grown_and_goes_on_where_it_was(
    found, tmp_path, monkeypatch, capfd
):
    folder = tmp_path / "logs"
    folder.mkdir()
    words = ("watch", folder, "--diagnosis", found, "--once", "watch.stretch=20")
    assert called(monkeypatch, capfd, *words)[0] == 0  # nothing is there yet
    frame(1.0, seed=3).to_csv(folder / "a.csv", index=False)
    code, said, _ = called(monkeypatch, capfd, *words)
    assert (code, said.count("a.csv: holds")) == (0, 1)
    assert called(monkeypatch, capfd, *words)[1] == ""  # nothing is looked at twice
    frame(1.5, seed=4, damping=lambda t: 1.1).to_csv(folder / "b.csv", index=False)
    code, said, _ = called(monkeypatch, capfd, "--json", *words)
    answer = json.loads(said)
    ANSWER.validate(answer)
    assert code == answer["exit_code"] == 4
    assert answer["error"]["kind"] == "no_longer_holds"
    (one,) = answer["recordings"]
    assert one["alarms"][0]["what"] == "viscous_friction on q: damping"
    code, said, _ = called(monkeypatch, capfd, *words)
    assert code == 4
    assert "the account no longer holds" in said
    lines = (tmp_path / "logs.watch.jsonl").read_text().splitlines()
    assert [json.loads(line)["recording"] for line in lines] == ["a.csv", "b.csv"]


STATE = {"x": "m", "x_dot": "m/s", "theta": "rad", "theta_dot": "rad/s"}
CARTPOLE = {
    "simulator": {"name": "cartpole", "dt": 0.02, "integrator": "euler", "parameters": {}},
    "task": {"name": "balance"},
}
PLAN = {
    "schema": "gpsim.plan/1",
    "simulator": "cartpole",
    "dt": 0.02,
    "state": STATE,
    "action": {"force": "N"},
}


def made_plan(tmp_path, facts, table, policy=None):
    """A finished plan of the cart-pole, and the policy that lies beside it."""

    def write(folder):
        pd.DataFrame(table).to_csv(folder / "plan.csv", index=False)
        (folder / "plan.yaml").write_text(yaml.safe_dump(PLAN | facts))
        if policy is not None:
            write_policy(folder, policy)

    Store(tmp_path, "").publish(Recipe("plan", {}, {}, {}), write, out=tmp_path / "plan")
    return tmp_path / "plan"


def test_a_stand_in_plays_a_plan_in_its_episodes(tmp_path, monkeypatch, capfd):
    commands = np.array([5.0, -5.0, 3.0, 0.0])
    rest = {"x": 0.1, "x_dot": 0.0, "theta": 0.0, "theta_dot": 0.0}
    table = {"episode": [0, 0, 1, 1], "t": [0, 0.02, 0, 0.02], "force": commands}
    plan = made_plan(tmp_path, {"rest": rest}, table)
    words = ("collect", "experiment=cartpole", "--plan", plan, "--out", "played")
    code, said, error = called(monkeypatch, capfd, "--json", *words)
    assert code == 0, error
    ANSWER.validate(json.loads(said))
    played = gpsim.read_recording("played").episodes
    assert [len(e) for e in played] == [2, 2]
    assert np.concatenate([e.actions[:, 0] for e in played]) == pytest.approx(commands)
    assert [e.states[0].tolist() for e in played] == [list(rest.values())] * 2
    code, _, error = called(monkeypatch, capfd, *words, "simulator.dt=0.01", "target.dt=0.01")
    assert code == 2
    assert "one command every 0.02 s" in error


def upright_policy(tmp_path):
    """A finished policy that pushes to the right with the more certainty the further the pole leans there."""
    gains = np.array([[1.0, 2.0, 30.0, 6.0]], dtype=np.float32)
    layer = {
        "layer.0.weight": np.vstack([-0.1 * gains, 0.1 * gains]),
        "layer.0.bias": np.zeros(2, np.float32),
    }
    policy = Policy(layer, np.ones(4, np.float32))
    recipe = Recipe("train-source", CARTPOLE, {}, {})
    Store(tmp_path, "").publish(recipe, lambda folder: write_policy(folder, policy), out=tmp_path / "policy")
    return tmp_path / "policy", policy


def test_a_stand_in_plays_a_plan_around_the_policy_that_lies_beside_it(tmp_path, monkeypatch, capfd):
    dithers = 1.5 * np.sign(np.sin(0.2 * np.arange(300)))
    facts = {
        "rest": dict.fromkeys(STATE, 0.0), "commands": {"force": [-4.0, 4.0]}, "rates": {"force": None},
        "rest_commands": {"force": 0.0}, "policy": {"sha256": "0" * 64, **CARTPOLE},
    }  # fmt: skip
    table = {"t": 0.02 * np.arange(300), "force_dither": dithers}
    plan = made_plan(tmp_path, facts, table, upright_policy(tmp_path)[1])
    words = ("collect", "experiment=cartpole", "target.friction=0.02", "--plan", plan, "--out", "played")
    code, _, error = called(monkeypatch, capfd, *words)
    assert code == 0, error
    (episode,) = gpsim.read_recording("played").episodes
    assert np.abs(episode.states[:, 2]).max() < 0.2  # 6 s: without the policy the pole has long fallen
    wanted = 10.0 * np.tanh(0.1 * (episode.states[:-1] @ [1.0, 2.0, 30.0, 6.0])) + dithers
    assert episode.actions[:, 0] == pytest.approx(np.clip(wanted, -4.0, 4.0), abs=1e-4)


def test_a_policy_of_another_machine_and_what_is_no_policy_are_refused(found, tmp_path, monkeypatch, capfd):
    for folder, said in (
        (upright_policy(tmp_path)[0], "channels are not those"),
        (found, "expected a policy"),
    ):
        code, _, error = called(monkeypatch, capfd, "plan", found, "--policy", folder, "--out", "made")
        assert code == 2
        assert said in error
        assert error.strip().count("\n") == 0
        assert not Path("made").exists()


def test_a_log_that_is_none_is_refused(found, tmp_path, monkeypatch, capfd):
    (tmp_path / "other.jsonl").write_text('{"recording": 1}\n')
    frame(0.5).to_csv("a.csv", index=False)
    words = ("watch", "a.csv", "--diagnosis", found, "--once", "--log", tmp_path / "other.jsonl")
    code, _, error = called(monkeypatch, capfd, *words)
    assert code == 2
    assert "line 1 is not from gpsim watch" in error
