"""run iterate: rounds that build on each other, stop by their rule, and go on where they were cut off."""

import json
from unittest.mock import Mock

import numpy as np
import pytest
from asking import asked
from budgets import TINY

from gpsim.artifacts import read_artifact
from gpsim.errors import UsageError
from gpsim.launchers import Local
from gpsim.recordings import read_recording
from gpsim.stages import iterate

SMALL = (*TINY, "collect.episodes=3", "gp.restarts=0", "gp.max_iterations=20", "gp.n_train=40", "rounds=2")


def request(tmp_path, *words):
    return asked(*SMALL, f"runs_dir={tmp_path / 'runs'}", *words)


def run(wanted):
    told = Mock()
    artifact = iterate.run(wanted, Local(0), told)
    return artifact, [(job, existed) for job, _, existed in (call.args for call in told.made.mock_calls)]


@pytest.fixture
def gaining(monkeypatch):
    """Trials in which every round gains as much as `gains` says."""

    def of(*gains):
        earned = iter(np.cumsum(gains))
        spread = np.linspace(-1.0, 1.0, 12)
        seen: dict[str, np.ndarray] = {}

        def trial(request, policy):
            if policy.digest not in seen:
                seen[policy.digest] = next(earned) + spread * (1 + len(seen))
            return seen[policy.digest]

        monkeypatch.setattr(iterate, "trial", trial)

    return of


def test_rounds_build_on_each_other_and_are_found_again(tmp_path, gaining):
    gaining(10.0, 5.0, 5.0)
    made, said = run(request(tmp_path))
    found = json.loads((made.path / iterate.SUMMARY).read_text())
    assert found["stopped"] == "all 2 rounds are done"
    assert [r["adopted"] for r in found["rounds"]] == [True, True, True]
    assert found["best"] == 2
    assert read_artifact(tmp_path / found["policy"]).stage == "train-gp-policy"
    assert [what for what, existed in said if not existed] == [
        "policy 0", "drive 0", "residuals 0", "fit 0", "policy 1", "drive 1", "residuals 1", "fit 1", "policy 2", "iterate",
    ]  # fmt: skip
    drives = sorted((tmp_path / "runs/cartpole/drive").glob("v*"))
    first, second = (read_recording(path) for path in drives)
    assert [episode.name for episode in second.episodes] == ["1.0", "1.1", "1.2", "0.0", "0.1", "0.2"]
    np.testing.assert_array_equal(second.episodes[3].states, first.episodes[0].states)
    rounds = found["rounds"]
    assert [r["transitions"] for r in rounds[:2]] == [first.transition_count, second.transition_count]
    assert rounds[0]["new"] is None
    assert 0.0 < rounds[1]["new"] < 0.9  # the processes of round 0 know much of what round 1 meets
    gaining(10.0, 5.0, 5.0)
    again, said = run(request(tmp_path))
    assert all(existed for _, existed in said)
    assert again.path == made.path
    assert iterate.lines(again)[-2] == "stopped: all 2 rounds are done"


def test_a_round_that_gains_nothing_is_the_last_and_is_not_adopted(tmp_path, gaining):
    gaining(10.0, -5.0)
    made, said = run(request(tmp_path))
    found = json.loads((made.path / iterate.SUMMARY).read_text())
    assert found["stopped"].startswith("round 1 gained -5, which does not exceed its standard error")
    assert [r["adopted"] for r in found["rounds"]] == [True, False]
    assert found["best"] == 0
    assert "train-source" in found["policy"]
    assert ("drive 1", False) not in said
    assert "not adopted" in iterate.lines(made)[1]


def test_a_sweep_comes_before_the_first_drive_and_stays_below_all(tmp_path, gaining):
    """Processes of the commands that arrived learn from commands that stand, which no policy's drives hold."""
    gaining(10.0, 5.0, -5.0)
    words = ("rounds=2", "collect.episodes=2", f"runs_dir={tmp_path / 'runs'}")
    small = ("experiment=limo", "budget=smoke", "policy.total_steps=800", "evaluate.episodes=12")
    _, said = run(asked(*small, *words))
    made = [what for what, existed in said if not existed]
    assert made[:4] == ["policy 0", "sweep", "drive 0", "residuals 0"]
    drives = [read_recording(path) for path in sorted((tmp_path / "runs/limo/drive").glob("v*"))]
    swept = read_recording(next((tmp_path / "runs/limo/collect").glob("v*")))
    for turn, drive in enumerate(drives):
        newest, *_ = drive.episodes
        assert newest.name == f"{turn}.0"
        np.testing.assert_array_equal(drive.episodes[-1].states, swept.episodes[-1].states)
    assert len(drives[1].episodes) == 2 * 2 + len(swept.episodes)


@pytest.mark.parametrize(
    ("word", "said"),
    [
        ("rounds=0", "rounds: expected a whole number of at least 1"),
        ("target=recording", "run iterate: target=recording cannot be driven"),
        ("recording=somewhere", "run iterate: every round makes its own recording"),
        ("robustness=posterior", "run iterate: with robustness=posterior, use correction=effects"),
    ],
)
def test_what_cannot_be_iterated_is_one_line(tmp_path, word, said):
    with pytest.raises(UsageError) as refused:
        run(request(tmp_path, word))
    assert str(refused.value).startswith(said)
    assert not (tmp_path / "runs").exists()
