"""experiment=mujoco: the loop's stages run on a MuJoCo model, whose truth is a changed one."""

import json
from pathlib import Path

import pytest
from cli_calls import called
from gpsim.cli.configuration import resolve

from gpsim.stages.registry import STAGES
from gpsim.stages.stage import Request

TINY = ("experiment=mujoco", "budget=smoke", "policy.total_steps=96", "policy.learning_starts=40")
TINY += ("policy.checkpoint_every=96", "policy.checkpoint_episodes=2", "task.max_steps=15", "gp.restarts=0")


def made(folder, stage, *words):
    """Where the stage's artifact lies."""
    words = (*TINY, f"runs_dir={folder / 'runs'}", *words)
    return STAGES[stage].make(Request(resolve(words, None), words))[0].path


@pytest.fixture(scope="module")
def begun(tmp_path_factory):
    """A folder in which the first stages have been made."""
    folder = tmp_path_factory.mktemp("mujoco")
    for stage in ("train-source", "collect", "build-residuals", "fit-gp"):
        made(folder, stage)
    return folder


@pytest.fixture
def gpsim(monkeypatch, capfd):
    return lambda *words: called(monkeypatch, capfd, *words)


def content(folder, stage, name):
    return json.loads((folder / "runs" / "mujoco" / stage / "v0001" / name).read_text())


def test_residuals_are_generalised_accelerations(begun):
    summary = content(begun, "build-residuals", "residuals.json")
    assert list(summary["rates"]) == ["slider_acc", "hinge_acc", "hinge2_acc"]
    assert summary["residual_std"]["slider_acc"] > 1.0  # the motor gives less than half
    fitted = content(begun, "fit-gp", "fit.json")
    assert set(fitted["rates"]) == set(summary["rates"])


def test_a_policy_trains_on_the_corrected_accelerations(begun):
    assert (made(begun, "train-gp-policy", "prediction=mean") / "policy.safetensors").is_file()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["simulator.dt=0.02"], "takes control steps of 0.05 s"),
        (["task.name=gym:Hopper-v5"], "does not go with simulator"),
        (["task.name=gym:CartPole-v1"], "not based on MuJoCo"),
        (["target.mass={knee: 2.0}"], "the model has no knee"),
        (["target.finer=0"], "finer must be at least 1"),
    ],
)
def test_what_cannot_be_is_refused_before_anything_is_trained(words, said, gpsim):
    code, _, told = gpsim("train-source", *TINY, "variant=target", *words)
    assert code == 2
    assert said in told
    assert told.count("\n") == 1
    assert not list(Path().rglob("v0001"))


def test_a_policy_of_discrete_actions_is_refused(gpsim):
    code, _, told = gpsim("train-source", "experiment=mujoco", "policy=ppo")
    assert code == 2
    assert "continuous; choose policy=sac" in told


@pytest.mark.slow
def test_the_whole_loop_names_what_the_target_conceals(gpsim):
    code, out, said = gpsim("run", "full-loop", "experiment=mujoco", "budget=smoke")
    assert code == 0, said
    (found,) = Path("runs/mujoco/diagnose").glob("v*/diagnosis.json")
    claimed = {(e["family"], e["on"]) for e in json.loads(found.read_text())["effects"]}
    assert ("actuator_gain", "slide") in claimed
    assert "In its own" in out  # simulator: the heading is of two lines
    assert "Full episodes" not in out  # rewards are the task's own
    code, _, said = gpsim("export", "model", str(found.parent), "--out", "pendulum_corrected.xml")
    assert code == 0, said
    assert json.loads(Path("patch.json").read_text())["effects"]
