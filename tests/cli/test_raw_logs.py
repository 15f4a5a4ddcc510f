"""A log as it lies on a disk, to a diagnosis in two commands: the first says the second."""

import json
import re
import shlex

import numpy as np
import pandas as pd
import pytest
from scipy.io import savemat

from gpsim.errors import UsageError
from gpsim.recordings import read_recording
from gpsim.recordings.export import DriveLog, Topics, write_ros1_bag, write_ros2_bag

REACHED = "the diagnosis has begun"


@pytest.fixture
def stopped(monkeypatch):
    """No diagnosis is made: what reaches it is written down."""
    seen = []

    def stop(recording, simulator, parameters, *_):
        seen.append((recording, simulator, parameters))
        raise UsageError(REACHED)

    monkeypatch.setattr("gpsim.stages.diagnosis_files.diagnose", stop)
    return seen


def proposed(err):
    """The command that a message proposes, as words."""
    found = re.search(r"assign the columns: gpsim (.*)", err)
    assert found, err
    return shlex.split(found[1])


def swing(count=300, dt=0.01):
    t = dt * np.arange(count)
    theta = 0.4 * np.cos(4.0 * t)
    return t, theta, -1.6 * np.sin(4.0 * t), 0.2 * np.sin(7.0 * t)


def logged(path, names=("time", "position", "velocity", "torque"), off=0.0, pace=1.0, **more):
    """The swing as a table; pace: units of its clock in a second."""
    t, theta, rate, torque = swing()
    columns = dict(zip(names, (pace * t, theta + off, rate, torque), strict=True))
    pd.DataFrame(columns | {name: of(t) for name, of in more.items()}).to_csv(path, index=False)
    return t, theta, rate, torque


def drive(seconds=12.0):
    t = np.arange(0.0, seconds, 0.02)
    poses = np.stack([0.5 * t, 0.1 * np.sin(t), 0.2 * np.cos(t)], axis=1)
    sent = np.arange(0.0, seconds, 0.1)
    return DriveLog(sent, np.stack([0.5 + 0.0 * sent, 0.1 * np.sin(sent)], axis=1), t, poses)


def test_a_table_is_understood_by_its_names_and_asked_about_once(gpsim, stopped, tmp_path):
    _, theta, rate, _ = logged(tmp_path / "log.csv")
    code, _, err = gpsim("diagnose", "log.csv")
    assert code == 2
    *table, line = err.splitlines()
    assert len(table) < 10
    assert len(line) < 120
    assert "gpsim import --inspect log.csv --write-mapping mapping.yaml" in err
    assert "looks like pendulum" in err
    words = proposed(err)
    assert words[:4] == ["diagnose", "log.csv", "--simulator", "pendulum"]
    code, _, err = gpsim(*words, "--cores", "1")
    assert err.splitlines()[-1] == f"error: {REACHED}"
    assert "theta=position theta_dot=velocity" in err
    assert "mass 1 kg" in err
    assert "recording: runs/cartpole/import/v0001" in err
    recording, simulator, _ = stopped[0]
    assert simulator.name == "pendulum"
    np.testing.assert_allclose(recording.episodes[0].states, np.stack([theta, rate], axis=1))
    assert read_recording(tmp_path / "runs/cartpole/import/v0001").system == "pendulum"


def test_the_simulator_alone_is_enough_where_the_names_are_sure(gpsim, stopped, tmp_path):
    t, theta, rate, torque = swing()
    table = pd.DataFrame(
        {"time [ms]": 1e3 * t, "angle [deg]": np.degrees(theta), "omega": rate, "tau": torque}
    )
    table.to_csv(tmp_path / "log.csv", index=False)
    code, _, err = gpsim(
        "diagnose", "log.csv", "--simulator", "pendulum", "parameters.mass=0.6", "--cores", "1"
    )
    assert (code, err.splitlines()[-1]) == (2, f"error: {REACHED}")
    recording, _, parameters = stopped[0]
    np.testing.assert_allclose(recording.episodes[0].states[:, 0], theta, atol=1e-12)
    np.testing.assert_allclose(recording.episodes[0].t, t, atol=1e-12)
    assert parameters["mass"] == 0.6
    assert "length 0.5 m" in err
    assert "mass 1" not in err


def test_a_log_is_imported_once(gpsim, stopped, tmp_path):
    t, theta, _, torque = swing()
    pd.DataFrame({"time": t, "angle": theta, "u": torque}).to_csv(tmp_path / "log.csv", index=False)
    words = ["diagnose", "log.csv", "--simulator", "pendulum", "--cores", "1"]
    gpsim(*words)
    _, _, err = gpsim(*words)
    assert "theta_dot is differentiated from theta" in err
    assert [path.name for path in (tmp_path / "runs/cartpole/import").glob("v*")] == ["v0001"]
    gpsim(*words, "torque=-2*u")
    assert len(list((tmp_path / "runs/cartpole/import").glob("v*"))) == 2
    np.testing.assert_allclose(stopped[-1][0].episodes[0].actions, -2.0 * stopped[0][0].episodes[0].actions)


def test_a_matlab_file_whose_command_nobody_can_guess(gpsim, stopped, tmp_path):
    t, q, _, volts = swing()
    savemat(tmp_path / "rig.mat", {"t": t, "qm": q, "qg": q + 0.001, "vir": volts})
    code, _, err = gpsim("diagnose", "rig.mat")
    assert code == 2
    assert re.search("force +N +[?] one of qg, vir; none if there was no command", err)
    assert re.search("q +m +qm by its name alone[?]", err)
    words = [word.replace("force=COLUMN", "force=35.15*vir") for word in proposed(err)]
    code, _, err = gpsim(*words, "--cores", "1")
    assert err.splitlines()[-1] == f"error: {REACHED}"
    recording = stopped[0][0]
    assert (recording.system, recording.velocities) == ("slider", "differentiated")
    first = np.searchsorted(t, recording.provenance["sources"]["0"]["start_s"] - 1e-9)
    assert recording.episodes[0].actions[0, 0] == pytest.approx(35.15 * volts[first])


@pytest.mark.parametrize("kind", ["ros1", "ros2"])
def test_a_bag_with_a_pose_and_a_twist_needs_nothing_more(kind, gpsim, stopped, tmp_path):
    path = tmp_path / ("my.bag" if kind == "ros1" else "my_bag")
    write = write_ros1_bag if kind == "ros1" else write_ros2_bag
    write(path, drive(), Topics("/robot/cmd_vel", "/mocap/robot"))
    _, _, err = gpsim("diagnose", path.name, "--cores", "1")
    assert err.splitlines()[-1] == f"error: {REACHED}"
    assert f"warning: {path.name}: read as unicycle: pose=/mocap/robot v_cmd=/robot/cmd_vel:linear.x" in err
    recording = stopped[0][0]
    assert recording.dt == pytest.approx(0.02)
    assert recording.action.names == ("v_cmd", "w_cmd")


def test_of_several_poses_one_is_asked_for(gpsim, stopped, tmp_path):
    t = np.arange(0.0, 12.0, 0.02)
    folder = tmp_path / "run1"
    folder.mkdir()
    for name, off in (("mocap", 0.0), ("odom", 0.3)):
        pose = {
            "s": 1700 + t.astype(int),
            "ns": np.round((t % 1) * 1e9),
            "x": 0.5 * t + off,
            "y": 0.1 * np.sin(t),
        }
        pose |= {"yaw": 0.2 * np.cos(t)}
        pd.DataFrame(pose).to_csv(folder / f"{name}.csv", index=False)
    sent = {
        "s": 1700 + t.astype(int),
        "ns": np.round((t % 1) * 1e9),
        "speed": 0.5 + 0 * t,
        "delta": 0.1 * np.sin(t),
    }
    pd.DataFrame(sent).to_csv(folder / "commands.csv", index=False)
    code, _, err = gpsim("diagnose", "run1")
    assert code == 2
    assert re.search("pose +mocap, or odom[?]", err)
    words = [word.replace("pose=mocap", "pose=odom") for word in proposed(err)]
    assert words[3:] == ["ackermann", "pose=odom", "v_cmd=commands:speed", "steering=commands:delta"]
    code, _, err = gpsim(*words, "--cores", "1")
    assert err.splitlines()[-1] == f"error: {REACHED}"
    assert stopped[0][0].episodes[0].states[0, 0] == pytest.approx(0.3, abs=0.02)


def test_a_system_of_ones_own_and_a_log_without_a_clock(gpsim, stopped, tmp_path):
    (tmp_path / "tank.py").write_text(
        "class Tank:\n"
        "    state, action, start = {'level': 'V', 'upper': 'V'}, {'pump': 'V'}, {'upper': 5.0}\n"
        "    parameters = {'k': ('1/s', 0.1, 0.0, 1.0)}\n"
        "    def rates(self, state, action, p):\n"
        "        return {'level': p['k'] * (state['upper'] - state['level']), 'upper': action['pump'] - state['upper']}\n"
    )
    k = np.arange(120)
    table = pd.DataFrame({"uEst": np.sin(k / 9), "yEst": np.cos(k / 9), "Ts": np.where(k == 0, 4.0, np.nan)})
    table.to_csv(tmp_path / "tank.csv", index=False)
    code, _, err = gpsim("diagnose", "tank.csv")
    assert code == 2
    assert "--simulator NAME dt=4 CHANNEL=COLUMN ...\n" in err
    assert "columns: uEst, yEst, Ts\n" in err
    assert re.search("cartpole +x, x_dot, theta, theta_dot, force\n", err)
    words = [
        "diagnose",
        "tank.csv",
        "--simulator",
        "tank.py:Tank",
        "dt=4",
        "level=yEst",
        "pump=uEst",
        "--cores",
        "1",
    ]
    code, _, err = gpsim(*words)
    assert err.splitlines()[-1] == f"error: {REACHED}", err
    assert stopped[0][0].dt == pytest.approx(4.0)
    assert stopped[0][0].state.names == ("level",)


def test_planned_tables_are_left_out(gpsim, stopped, tmp_path):
    for name, off in (("a/data_measured", 0.0), ("a/data_desired", 1.0), ("b/data_measured", 0.0)):
        (tmp_path / "logs" / name).parent.mkdir(parents=True, exist_ok=True)
        logged(tmp_path / "logs" / f"{name}.csv", off=off)
    gpsim("diagnose", "logs", "--simulator", "pendulum", "--cores", "1")
    assert len(stopped[0][0].episodes) == 2
    assert max(abs(e.states[:, 0]).max() for e in stopped[0][0].episodes) < 0.5


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["theta=positoin"], "theta=positoin: no column or topic 'positoin' (did you mean 'position'?)"),
        (["phi=position"], "phi=position: no channel of pendulum; there are: theta, theta_dot, torque"),
        (["theta=degg*position"], "'degg' is not a factor; give a number, or one of mm, cm"),
        (["target=friction"], "target=friction: no channel of pendulum"),
        (["simulator=pendulum"], "simulator=pendulum: beside a RECORDING give --simulator NAME"),
        (["gp.n_train=3"], "gp.n_train=3: not used with a RECORDING"),
    ],
)
def test_a_wrong_word_is_one_line(words, said, gpsim, tmp_path):
    logged(tmp_path / "log.csv")
    code, _, err = gpsim("diagnose", "log.csv", "--simulator", "pendulum", *words)
    assert code == 2
    assert said in err
    assert err.count("\n") == 1


def test_a_time_that_may_be_milliseconds_is_asked_for(gpsim, stopped, tmp_path):
    logged(tmp_path / "log.csv", ("time", "theta", "theta_dot", "torque"), pace=1e3)
    code, _, err = gpsim("diagnose", "log.csv", "--simulator", "pendulum")
    assert code == 2
    assert re.search(r"t +s +time, or ms\*time[?]", err)
    gpsim("diagnose", "log.csv", "--simulator", "pendulum", "t=ms*time", "--cores", "1")
    assert stopped[0][0].dt == pytest.approx(0.01)


def test_import_guesses_as_diagnose_does(gpsim, tmp_path):
    t, *_ = logged(tmp_path / "log.csv", ("time", "position", "velocity", "tau"))
    code, _, err = gpsim("import", "log.csv")
    assert code == 2
    words = proposed(err)
    assert words[-2:] == ["--out", "DIR"]
    code, out, err = gpsim(*words[:-1], "rec", "--json")
    assert code == 0, err
    content = json.loads(out)
    assert content["figures"]["transitions"] == len(t) - 1
    assert any("read as pendulum" in line for line in content["warnings"])
    assert read_recording(tmp_path / "rec").action.names == ("torque",)
    again, _, _ = gpsim("import", "log.csv", "--simulator", "pendulum", "--out", "rec2")
    assert again == 0


def test_a_mapping_that_comes_with_gpsim_is_offered_and_taken(gpsim, stopped, tmp_path):
    logged(tmp_path / "data_measured.csv")
    _, _, err = gpsim("diagnose", "data_measured.csv")
    assert "for the public data set simple_pendulum: use --mapping simple_pendulum" in err
    gpsim("diagnose", "data_measured.csv", "--mapping", "simple_pendulum", "--cores", "1")
    assert stopped[0][2]["mass"] == 0.6
    _, _, err = gpsim("diagnose", "--mapping", "simple_pendulum")
    assert "--mapping goes with a raw log" in err


def test_what_may_say_when_the_motors_were_on_is_told(gpsim, stopped, tmp_path):
    """A command is obeyed only then: the rest of the log would look like a fault of the simulator."""
    names = ("time", "theta", "theta_dot", "torque")
    logged(tmp_path / "log.csv", names, enabled=lambda t: 1.0 * (t > 1.0))
    words = ["diagnose", "log.csv", "--simulator", "pendulum", "--cores", "1"]
    _, _, err = gpsim(*words)
    added = re.search(r"enabled may show when the motors were on; if so, add (.*)", err)[1].split()
    _, _, err = gpsim(*words, *added)
    assert "may show when" not in err
    whole, cut = (len(recording.episodes[0]) for recording, _, _ in stopped)
    assert (whole, cut) == (299, 198)
