"""From a drive of the stand-in through bags and the importer; policies trained, exported, deployed and scored."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import onnxruntime
import pytest
from gpsim.cli.configuration import resolve
from gpsim.cli.main import main

from gpsim.artifacts import Recipe, Store
from gpsim.environments import BatchedEnv, Sweep, drive_plan
from gpsim.errors import UsageError
from gpsim.policies import Policy
from gpsim.policies.export import ros_node, to_onnx
from gpsim.policies.training.ppo import train_ppo
from gpsim.policies.training.sac import train_sac
from gpsim.policies.training.settings import PpoSettings, SacSettings
from gpsim.recordings.export import DriveLog, Topics, write_ros1_bag, write_ros2_bag
from gpsim.simulators import SimulatorPlant, make_simulator
from gpsim.stages.building import make_task, target_plant
from gpsim.stages.export import export_policy
from gpsim.stages.import_log import read_logs
from gpsim.stages.policy_files import write_policy
from gpsim.tasks import Balance, GoalReaching, Start

CONFIG = resolve(["experiment=limo"], None)
CAR, TASK = target_plant(CONFIG), make_task(CONFIG)
PLANT = SimulatorPlant(make_simulator("unicycle"), {}, "euler", 0.1)
SMALL = SacSettings(total_steps=480, n_envs=8, gradient_steps=2, learning_starts=80, checkpoint_every=240,
                    checkpoint_episodes=8, hidden=(16, 16), action_repeat=5)  # fmt: skip
PLAN = Sweep(3, 4, 12).commands(np.array([0.0, -0.3]), np.array([0.2, 0.3]))


def train(seed=0):
    env = BatchedEnv(PLANT, GoalReaching(max_steps=60), SMALL.n_envs, seed, SMALL.action_repeat)
    return train_sac(env, SMALL, seed, lambda *_: None)


def proportional(observations):
    """A policy that anyone would write: full speed, turning towards the goal."""
    bearing = np.arctan2(observations[:, 1], observations[:, 0])
    return np.column_stack([np.full(len(bearing), 0.2), np.clip(bearing, -0.3, 0.3)])


@pytest.mark.parametrize("kind", ["ros1", "ros2"])
def test_a_drive_comes_back_through_its_bag(tmp_path, kind):
    """Every command of the plan, once a step, and poses within the camera's noise of the truth."""
    log, put_back = drive_plan(CAR, PLAN, 0.4, np.random.default_rng(0))
    assert put_back > 0
    bag = tmp_path / ("drive.bag" if kind == "ros1" else "drive")
    (write_ros1_bag if kind == "ros1" else write_ros2_bag)(bag, log, Topics())
    recording, report, _ = read_logs([bag], "limo_optitrack", ["held_out.share=0", "episodes.min_duration=0"])
    transitions = recording.transitions()
    np.testing.assert_array_equal(transitions.actions, PLAN)
    assert len(recording.episodes) == put_back + 1
    assert np.allclose(transitions.dt, 0.1)
    assert not any("gap" in text for text in report.warnings)
    # Where the car stands, the pose is the camera's alone.
    still = transitions.states[:20]
    np.testing.assert_allclose(still[:, :2], 0.0, atol=5 * 5e-4)


def test_the_target_entropy_falls_near_the_end_only():
    falling = replace(SMALL, total_steps=1000, target_entropy=-1.0, final_entropy=-4.0, final_part=0.4)
    assert [falling.entropy_at(done) for done in (0, 600, 800, 1000, 1100)] == pytest.approx(
        [-1, -1, -2.5, -4, -4]
    )
    assert replace(falling, final_entropy=None).entropy_at(1000) == -1.0
    with pytest.raises(ValueError, match="final_part"):
        replace(SMALL, final_part=0.0)


def test_same_seed_same_bytes_and_the_best_checkpoint_is_kept():
    first, curve, checkpoints = train()
    again, _, _ = train()
    other, _, _ = train(seed=1)
    assert all(first.weights[k].tobytes() == again.weights[k].tobytes() for k in first.weights)
    assert any(first.weights[k].tobytes() != other.weights[k].tobytes() for k in first.weights)
    assert checkpoints.steps.tolist() == curve.steps.tolist() == [240, 480]
    arrays, metadata = first.to_arrays()
    back = Policy.from_arrays(arrays, metadata)
    seen = np.random.default_rng(0).normal(size=(20, 2)).astype(np.float32)
    assert back.act(seen).tobytes() == first.act(seen).tobytes()
    assert (back.act(seen) >= first.bounds[0]).all()
    assert (back.act(seen) <= first.bounds[1]).all()
    drawn = first.act(np.tile(seen[:1], (4000, 1)), np.random.default_rng(0))
    mean, log_std = np.split(first.logits(seen[:1]), 2, axis=1)
    unsquashed = np.arctanh(
        np.clip(2.0 * (drawn - first.bounds[0]) / np.ptp(first.bounds, axis=0) - 1.0, -0.999999, 0.999999)
    )
    np.testing.assert_allclose(np.median(unsquashed, axis=0), mean[0], atol=0.12 * np.exp(log_std[0]).max())


def test_exported_policies_act_alike(tmp_path):
    """ONNX against NumPy, for continuous and for discrete actions."""
    continuous, _, _ = train()
    cart = SimulatorPlant(make_simulator("cartpole"), make_simulator("cartpole").defaults(), "euler", 0.02)
    settings = PpoSettings(total_steps=64, n_steps=32, n_envs=2, batch_size=32, n_epochs=1)
    discrete, *_ = train_ppo(BatchedEnv(cart, Balance(), 2, 0), settings, 0, lambda *_: None)
    rng = np.random.default_rng(0)
    for policy in (continuous, discrete):
        session = onnxruntime.InferenceSession(to_onnx(policy), providers=["CPUExecutionProvider"])
        seen = rng.normal(size=(200, len(policy.scale))).astype(np.float32)
        actions = session.run(["action"], {"observation": seen})[0]
        np.testing.assert_allclose(actions, policy.act(seen), rtol=1e-5, atol=1e-6)
        assert to_onnx(policy) == to_onnx(policy)
    compile(ros_node(continuous, 10.0, 0.05, (0.5, -0.5), 500, 4.0), "drive_to_goal.py", "exec")
    with pytest.raises(UsageError, match="only policies that drive a vehicle"):
        ros_node(discrete, 50.0, 0.05, (0.5, -0.5), 500, 4.0)


def test_an_exported_node_drives_to_the_goal_of_its_policys_task(tmp_path):
    policy, _, _ = train()
    task = {
        "name": "goal",
        "goal_radius": 0.1,
        "evaluation_goal": [1.25, 0.75],
        "max_steps": 80,
        "floor": 6.0,
    }
    recipe = Recipe("train-source", {"task": task, "simulator": {"dt": 0.1}}, {}, {})
    made = Store(tmp_path / "own", "limo").publish(recipe, lambda folder: write_policy(folder, policy))
    export_policy(made.path, tmp_path / "deploy")
    first, second = (tmp_path / "deploy" / f"drive_to_goal{ros}.py" for ros in ("", "_ros2"))
    node = first.read_text()
    for words in (
        '"~goal_x", 1.25), rospy.get_param("~goal_y", 0.75)', '"~max_steps", 80)', '"~goal_radius", 0.1)',
        "_goal_x:=1.25 _goal_y:=0.75", 'rospy.get_param("~limit", 3)',
    ):  # fmt: skip
        assert words in node
    assert "-p goal_x:=1.25 -p goal_y:=0.75" in second.read_text()
    assert second.stat().st_mode & 0o111
    for path in (first, second):
        compile(path.read_text(), path.name, "exec")


def run(monkeypatch, capsys, *words):
    """The command line in this process; returns exit code, output and errors."""
    monkeypatch.setattr("sys.argv", ["gpsim", *words])
    try:
        main()
        code = 0
    except SystemExit as ended:
        code = ended.code or 0
    shown = capsys.readouterr()
    return code, shown.out, shown.err


def trip(task, act, start, rng):
    """What a robot's software logs of a policy at the wheel: its commands, and the poses that were seen."""
    state, memory, commands = start.states, CAR.begin(1, rng), []
    pose_t, poses = [np.zeros(1)], [CAR.measure(state, {}, rng)]
    for step in range(task.max_steps):
        commands.append(task.command(act(task.observe(poses[-1][-1:], start.context)))[0])
        true = CAR.glimpses(state, commands[-1][None], memory)[0]
        pose_t.append(CAR.dt * (step + np.arange(1, len(true) + 1) / len(true)))
        poses.append(CAR.measure(true, {}, rng))
        state = true[-1:]
        if task.terminated(state, start.context)[0]:
            break
    commands.append(np.zeros(2))
    return DriveLog(
        CAR.dt * np.arange(len(commands)), np.array(commands), np.concatenate(pose_t), np.concatenate(poses)
    )


def test_recorded_deployments_are_scored(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    goal = np.array([TASK.evaluation_goal], dtype=np.float64)
    bags = []
    for number, (x, yaw) in enumerate(((-0.4, 0.0), (0.1, 0.1), (0.47, 2.4))):
        start = Start(np.array([[x, -0.5 if x < 0.4 else -0.45, yaw]]), goal)
        act = proportional if number < 2 else (lambda seen: np.zeros((len(seen), 2)))
        log = trip(GoalReaching(max_steps=60 if number else 90), act, start, np.random.default_rng(number))
        bags.append(f"trip{number}.bag")
        write_ros1_bag(Path(bags[-1]), log, Topics())
    words = ["evaluate", "experiment=limo", f"deployed=[{','.join(bags)}]"]
    code, out, err = run(monkeypatch, capsys, *words)
    assert code == 0, err
    folder = tmp_path / "runs/limo/evaluate/v0001"
    found = json.loads((folder / "evaluation.json").read_text())["deployed"]
    assert found["trips"] == 3
    assert found["reached"] == 2
    assert "not reached (log ended), 0.0" in out
    assert (folder / "deployments.csv").read_text().startswith("episode,reached,ended,steps,path,nearest\n")
    assert "2 of 3 deployments reached the goal" in out
    assert (folder / "figures/deployed.png").read_bytes().startswith(b"\x89PNG")
    assert "already there" in run(monkeypatch, capsys, *words)[1]
    code, _, err = run(monkeypatch, capsys, *words, "deployed_goal=[1]")
    assert code == 2
    assert err == "error: deployed_goal: expected [x, y] in metres, got [1]\n"
    code, _, err = run(monkeypatch, capsys, *words, "deployed_goal=3")
    assert code == 2
    assert err == "error: deployed_goal: expected [x, y] in metres, got 3\n"
    code, _, err = run(monkeypatch, capsys, *words, "deployed_goal=[3,0]")
    assert (code, err.count("\n")) == (2, 1)
    assert err.startswith("error: deployed_goal: [3, 0] is outside the floor")
    code, out, _ = run(monkeypatch, capsys, *words, "task.max_steps=3")
    assert code == 0
    assert out.count("not reached (out of time)") == 3


def test_the_plan_is_a_file_that_a_robot_can_play(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    code, out, _ = run(monkeypatch, capsys, "collect", "experiment=limo", "--plan", "plan.csv")
    assert code == 0
    assert out == "collect: plan.csv, 3000 commands, one a control step\n"
    rows = np.loadtxt("plan.csv", delimiter=",", skiprows=1)
    assert Path("plan.csv").read_text().startswith("t,v_cmd,w_cmd\n0.0,0.0,-0.3\n0.1,")
    assert rows.shape == (3000, 3)
    code, _, err = run(monkeypatch, capsys, "collect", "experiment=limo", "--plan", "plan.csv")
    assert code == 2
    assert "exists already" in err
    code, _, err = run(monkeypatch, capsys, "collect", "--plan", "other.csv")
    assert code == 2
    assert err.count("\n") == 1


def test_settings_of_a_monitor_that_nobody_asked_for_are_refused(tmp_path, monkeypatch, capsys):
    words = ["export", "policy", "p", "experiment=limo", "--out", str(tmp_path / "out")]
    monkeypatch.setattr("sys.argv", ["gpsim", *words])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 2
    assert "belong to --monitor" in capsys.readouterr().err
