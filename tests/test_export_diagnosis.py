"""A diagnosis as MCAP, read back with the format's own library and held against recording and simulators."""

import json
import subprocess
import sys
from collections import defaultdict
from dataclasses import replace

import numpy as np
import pytest
from gpsim.cli.main import app
from made_artifacts import made_diagnosis_artifact
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory
from typer.testing import CliRunner

from gpsim.artifacts import Store, read_artifact
from gpsim.channels import Channels, wrap_angle
from gpsim.corrected import EffectsPlant
from gpsim.effects import Gate, Term
from gpsim.errors import UsageError
from gpsim.recordings import Episode, Recording, write_recording
from gpsim.simulators import make_simulator
from gpsim.stages import export as stage
from gpsim.stages.export import export_diagnosis

DT, DAMPING, LENGTH = 0.02, 0.3, 0.5
HORIZON = 0.2
STEPS = round(HORIZON / DT)


def swung(damping_since=0.0):
    """A damped pendulum in explicit Euler steps of its own making: mass 1, so damping b takes b v / l^2 off."""
    rng, episodes = np.random.default_rng(3), []
    for number in range(2):
        torque = np.repeat(rng.normal(size=12), 5)[:, None]
        states, t = [np.array([0.4, 0.0])], 5.0 * number + DT * np.arange(len(torque) + 1)
        for k, push in enumerate(torque[:, 0]):
            theta, speed = states[-1]
            pull = push - 9.81 * LENGTH * np.sin(theta) - DAMPING * speed * (t[k] >= damping_since)
            states.append(np.array([theta + DT * speed, speed + DT * pull / LENGTH**2]))
        episodes.append(Episode(str(number), t, np.array(states), torque))
    simulator = make_simulator("pendulum")
    return Recording(
        "pendulum", simulator.state, simulator.action, tuple(episodes), DT,
        simulator.defaults(), "euler", "measured", "session",
    )  # fmt: skip


def corrected_by(recording, *terms):
    simulator = make_simulator(recording.system)
    return EffectsPlant(
        simulator, simulator.defaults(recording.parameters), terms, recording.integrator, 1, recording.dt
    )


DAMPED = Term("viscous_friction", "theta", {"damping": DAMPING})


@pytest.fixture
def made(tmp_path):
    """recording, terms -> the recording's folder and the folder of its diagnosis."""

    def make(recording, *terms, plant=None, **options):
        folder = tmp_path / "recording"
        folder.mkdir()
        write_recording(recording, folder)
        out = tmp_path / "diagnosis"
        plant = plant or corrected_by(recording, *terms)
        made_diagnosis_artifact(Store(tmp_path, "x"), plant, folder, out=out, **options)
        return folder, out

    return make


def read(path):
    """topic -> (log times, messages), in the file's order; JSON as mappings, protobuf as its own messages."""
    found = defaultdict(lambda: ([], []))
    with path.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        for schema, channel, message in reader.iter_messages(log_time_order=False):
            if channel.message_encoding == "json":
                content = json.loads(message.data)
            else:
                content = DecoderFactory().decoder_for(channel.message_encoding, schema)(message.data)
            found[channel.topic][0].append(message.log_time)
            found[channel.topic][1].append(content)
    return found


def table(found, topic, names):
    return np.array([[message[name] for name in names] for message in found[topic][1]])


def test_real_base_and_corrected_are_on_one_clock_and_what_they_should_be(made, tmp_path):
    recording = swung()
    _, folder = made(recording, DAMPED)
    path, notes = export_diagnosis(folder, horizon=HORIZON)
    assert path == tmp_path / "diagnosis.mcap"
    found, names = read(path), recording.state.names
    stamps = np.round(np.concatenate([e.t for e in recording.episodes]) * 1e9).astype(int)
    assert found["/real/state"][0] == stamps.tolist()
    measured = np.concatenate([e.states for e in recording.episodes])
    assert np.array_equal(table(found, "/real/state", names), measured)
    commands = np.concatenate([e.actions for e in recording.episodes])
    assert np.array_equal(table(found, "/real/command", recording.action.names), commands)
    every = [time for times, _ in found.values() for time in times]
    assert set(every) == set(stamps.tolist())
    with path.open("rb") as stream:
        order = [m.log_time for _, _, m in make_reader(stream).iter_messages(log_time_order=False)]
    assert order == sorted(order)
    at = {stamp: k for k, stamp in enumerate(stamps.tolist())}
    rows = [at[time] for time in found["/corrected/state"][0]]
    assert np.allclose(table(found, "/corrected/state", names), measured[rows], atol=1e-9)
    assert np.allclose(table(found, "/corrected/residual", names), 0.0, atol=1e-9)
    assert "2 episode(s), 122 samples" in notes[0]


def test_the_base_is_the_simulator_itself_anew_from_a_measured_state_after_every_horizon(made):
    recording = swung()
    _, folder = made(recording, DAMPED)
    path, _ = export_diagnosis(folder, horizon=HORIZON)
    found, names, simulator = read(path), recording.state.names, make_simulator("pendulum")
    said = dict(zip(found["/base/state"][0], table(found, "/base/state", names), strict=True))
    left = dict(zip(found["/base/residual"][0], table(found, "/base/residual", names), strict=True))
    ages = {time: m["age"] for time, m in zip(*found["/rollout"], strict=True)}
    assert said.keys() == ages.keys()
    assert len(said) > 110
    for episode in recording.episodes:
        state = None
        for k, time in enumerate(np.round(episode.t * 1e9).astype(int).tolist()):
            if time not in said:
                continue
            if ages[time] == 0.0:
                state = episode.states[k : k + 1]
            else:
                state = simulator.step(
                    state, episode.actions[k - 1 : k], simulator.defaults(), np.array([DT]), "euler"
                )
            assert np.allclose(said[time], state[0], atol=1e-9)
            assert np.allclose(left[time], episode.states[k] - state[0], atol=1e-9)
    assert max(ages.values()) == pytest.approx(HORIZON)
    assert max(np.abs(list(left.values())).max(axis=0)) > 0.01
    sizes = found["/mismatch"][1]
    assert max(size["base"] for size in sizes) > 0.01 > 1e-6 > max(size["corrected"] for size in sizes)


def test_the_body_is_a_frame_where_the_state_puts_it(made):
    recording = swung()
    _, folder = made(recording, DAMPED)
    found = read(export_diagnosis(folder, horizon=HORIZON)[0])
    for model in ("real", "base", "corrected"):
        frames = [m for m in found["/tf"][1] if m.child_frame_id == model]
        theta = table(found, f"/{model}/state", ["theta"])[:, 0]
        assert {m.parent_frame_id for m in frames} == {"world"}
        bob = np.array([[m.translation.x, m.translation.y, m.translation.z] for m in frames])
        assert np.allclose(bob, LENGTH * np.stack([np.sin(theta), 0 * theta, -np.cos(theta)], axis=1))
        turn = np.array([[m.rotation.x, m.rotation.y, m.rotation.z, m.rotation.w] for m in frames])
        assert np.allclose(bob + LENGTH * upwards(turn), 0.0, atol=1e-12)  # the rod ends at the pivot
        stamps = [m.timestamp.ToNanoseconds() for m in frames]
        assert stamps == found[f"/{model}/state"][0]
    update = found["/scene"][1][0]
    assert {e.frame_id for e in update.entities} == {"real", "base", "corrected"}
    assert all(e.frame_locked and e.spheres and e.cylinders for e in update.entities)


def upwards(quaternion):
    """(N, 3): where unit quaternions (x, y, z, w) turn the z axis to."""
    x, y, z, w = quaternion.T
    return np.stack([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)], axis=1)


def driven(system):
    """A few seconds of random commands, as the base simulator itself drives."""
    simulator, rng, episodes = make_simulator(system), np.random.default_rng(1), []
    for number in range(2):
        actions = np.repeat(rng.uniform(0.2, 1.0, size=(8, len(simulator.action))), 5, axis=0)
        states = [np.full((1, len(simulator.state)), 0.1 if system == "cartpole" else 3.0)]
        for action in actions:
            states.append(
                simulator.step(states[-1], action[None], simulator.defaults(), np.array([0.1]), "rk4")
            )
        states = np.concatenate(states)
        states[:, simulator.state.wraps] = wrap_angle(states[:, simulator.state.wraps])
        t = 0.1 * np.arange(len(states))
        episodes.append(Episode(str(number), t, states, actions))
    return Recording(
        system, simulator.state, simulator.action, tuple(episodes), 0.1, simulator.defaults(), "rk4", None, "episode"
    )  # fmt: skip


ROBOT = """<mujoco><option timestep="0.01" integrator="RK4"/><worldbody>
<geom type="plane" size="9 9 1" contype="0" conaffinity="0"/>
<body name="rod" pos="0 0 1"><joint name="theta" axis="0 1 0"/>
<geom type="capsule" fromto="0 0 0 0 0 -.5" size=".02" mass="1"/></body></worldbody>
<actuator><motor name="torque" joint="theta"/></actuator></mujoco>"""


@pytest.fixture
def robot(made, tmp_path):
    """The folder of the diagnosis of a rod that hangs 1 m above the ground."""
    pytest.importorskip("mujoco")
    from gpsim.mjcf import open_simulator

    (tmp_path / "robot.xml").write_text(ROBOT)
    simulator, swing = open_simulator(str(tmp_path / "robot.xml")), swung()
    names = Channels.of({"theta": "rad", "theta_dot": "rad/s"}, wraps=["theta"])
    recording = replace(swing, system="mjcf", state=names, action=simulator.action, parameters={})
    recording = replace(recording, integrator="rk4", model=str(tmp_path / "robot.xml"))
    plant = EffectsPlant(simulator, simulator.defaults(), (), "rk4", 2, DT)
    return made(recording, plant=plant)[1]


def test_a_robots_bodies_are_frames_in_the_world_and_its_ground_is_left_out(robot):
    found = read(export_diagnosis(robot, horizon=HORIZON)[0])
    for model in ("real", "base", "corrected"):
        frames = [m for m in found["/tf"][1] if m.child_frame_id == f"{model}/rod"]
        theta = table(found, f"/{model}/state", ["theta"])[:, 0]
        turn = np.array([[m.rotation.x, m.rotation.y, m.rotation.z, m.rotation.w] for m in frames])
        assert np.allclose(upwards(turn), np.stack([np.sin(theta), 0 * theta, np.cos(theta)], axis=1))
        assert {(m.translation.x, m.translation.y, m.translation.z) for m in frames} == {(0, 0, 1)}
    entities = found["/scene"][1][0].entities
    assert {e.frame_id for e in entities} == {"real/rod", "base/rod", "corrected/rod"}
    [rod] = entities[0].cylinders
    assert (rod.size.z, rod.pose.position.z) == pytest.approx((0.5, -0.25))
    ends = sorted(ball.pose.position.z for ball in entities[0].spheres)
    assert ends == pytest.approx([-0.5, 0.0])


def viewed(path):
    """path -> (t [s], the values of its first column), of what a Rerun file holds over time."""
    pytest.importorskip("rerun")
    from rerun.chunk import RrdReader

    found = defaultdict(dict)
    for chunk in RrdReader(str(path)).stream():
        batch = chunk.to_record_batch().to_pydict()
        if "t" not in batch:
            continue
        for name, values in batch.items():
            if ":" in name:
                found[chunk.entity_path, name].update(
                    zip([t.total_seconds() for t in batch["t"]], values, strict=True)
                )
    return found


def test_rerun_shows_the_same_motion_as_foxglove(robot, tmp_path):
    pytest.importorskip("rerun")
    path, _ = export_diagnosis(robot, horizon=HORIZON, form="rrd")
    assert path == tmp_path / "diagnosis.rrd"
    found, same = viewed(path), read(export_diagnosis(robot, horizon=HORIZON)[0])
    for model in ("real", "base", "corrected"):
        stamps, messages = same[f"/{model}/state"]
        for name in ("theta", "theta_dot"):
            said = found[f"/state/{name}/{model}", "Scalars:scalars"]
            assert [round(t * 1e9) for t in said] == stamps
            assert [v for [v] in said.values()] == [message[name] for message in messages]
        frames = [m for m in same["/tf"][1] if m.child_frame_id == f"{model}/rod"]
        turns = found[f"/{model}/body/rod", "Transform3D:quaternion"]
        turn = [[m.rotation.x, m.rotation.y, m.rotation.z, m.rotation.w] for m in frames]
        assert np.allclose([v for [v] in turns.values()], turn, atol=1e-6)  # in single precision
    off = found["/mismatch/base", "Scalars:scalars"]
    assert [v for [v] in off.values()] == [message["base"] for message in same["/mismatch"][1]]


def test_view_saves_a_file_or_says_that_no_viewer_opens(robot, tmp_path, monkeypatch):
    pytest.importorskip("rerun")
    saved = CliRunner().invoke(app, ["view", str(robot), "--out", str(tmp_path / "drive.rrd")])
    assert saved.exit_code == 0, saved.output
    assert viewed(tmp_path / "drive.rrd")
    opened = []

    def viewer(command, **_):
        opened.append(viewed(command[-1]))  # whole when it is opened
        return subprocess.CompletedProcess(command, len(opened) - 1)

    monkeypatch.setattr(subprocess, "run", viewer)
    assert CliRunner().invoke(app, ["view", str(robot)]).exit_code == 0
    refused = CliRunner().invoke(app, ["view", str(robot)])
    assert isinstance(refused.exception, UsageError)
    assert "--out FILE.rrd" in str(refused.exception)
    assert len(opened) == 2
    assert all(opened)


@pytest.mark.parametrize("system", ["cartpole", "unicycle"])
def test_rerun_shows_carts_and_vehicles(made, system):
    pytest.importorskip("rerun")
    recording = driven(system)
    _, folder = made(recording)
    found = viewed(export_diagnosis(folder, horizon=0.4, form="rrd")[0])
    part = "/real/body/pole" if system == "cartpole" else "/real/body"
    assert len(found[part, "Transform3D:quaternion"]) == sum(len(e.t) for e in recording.episodes)
    trails = [key for key in found if key[0] == "/real/path"]
    assert bool(trails) == (system == "unicycle")


def test_a_vehicle_is_a_pose_and_its_path_a_line(made):
    recording = driven("unicycle")
    _, folder = made(recording)
    path, notes = export_diagnosis(folder, horizon=1.0)
    assert any("no effect was found" in line for line in notes)
    found = read(path)
    frames = [m for m in found["/tf"][1] if m.child_frame_id == "real"]
    measured = np.concatenate([e.states for e in recording.episodes])
    assert np.array_equal([[m.translation.x, m.translation.y] for m in frames], measured[:, :2])
    yaw = [2 * np.arctan2(m.rotation.z, m.rotation.w) for m in frames]
    assert np.allclose(wrap_angle(np.array(yaw) - measured[:, 2]), 0.0)
    said = table(found, "/base/state", ["yaw"])
    assert (np.abs(said) <= np.pi).all()
    assert np.allclose(table(found, "/base/residual", ["x", "y", "yaw"]), 0.0, atol=1e-9)
    _, second = found["/scene"][1]
    path = next(e for e in second.entities if e.id == "real/path").lines[0].points
    assert np.array_equal([[p.x, p.y] for p in path], recording.episodes[1].states[:, :2])
    times = found["/real/state"][0]
    assert times == sorted(times)  # clocks that begin anew follow one another
    parts = [(m["name"], m["held_out"]) for m in found["/episode"][1]]
    assert parts == [("0", False), ("1", False), ("1", True)]


def test_the_pole_hangs_in_the_carts_frame(made):
    _, folder = made(driven("cartpole"))
    found = read(export_diagnosis(folder, horizon=0.4)[0])
    poles = [m for m in found["/tf"][1] if m.child_frame_id == "corrected/pole"]
    assert {m.parent_frame_id for m in poles} == {"corrected"}
    theta = table(found, "/corrected/state", ["theta"])[:, 0]
    turn = np.array([[m.rotation.x, m.rotation.y, m.rotation.z, m.rotation.w] for m in poles])
    assert np.allclose(upwards(turn), np.stack([np.sin(theta), 0 * theta, np.cos(theta)], axis=1))


def test_what_began_inside_the_recording_does_not_act_before(made):
    since = 5.5
    recording = swung(damping_since=since)
    _, folder = made(recording, replace(DAMPED, gate=Gate(since=since)))
    found = read(export_diagnosis(folder, horizon=HORIZON)[0])
    assert np.allclose(table(found, "/corrected/residual", ["theta", "theta_dot"]), 0.0, atol=1e-9)


def test_a_state_that_nobody_measured_is_each_models_guess_and_no_residual(made):
    whole = swung()
    seen = tuple(replace(e, states=e.states[:, :1]) for e in whole.episodes)
    _, folder = made(replace(whole, state=Channels.of({"theta": "rad"}), episodes=seen), DAMPED)
    found = read(export_diagnosis(folder, horizon=HORIZON)[0])
    assert {key for message in found["/real/state"][1] for key in message} == {"theta"}
    assert {key for message in found["/corrected/residual"][1] for key in message} == {"theta"}
    speed = np.concatenate([e.states[:, 1] for e in whole.episodes])
    at = dict(zip(found["/real/state"][0], speed, strict=True))
    for time, message in zip(*found["/corrected/state"], strict=True):
        assert message["theta_dot"] == pytest.approx(at[time], abs=0.1)


def test_equal_diagnoses_give_equal_bytes(made, tmp_path):
    _, folder = made(swung(), DAMPED)
    for name in ("a", "b"):
        export_diagnosis(folder, tmp_path / name, horizon=HORIZON)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()
    assert read_artifact(folder, "diagnose")  # nothing in it has changed


def test_a_recording_that_has_moved_is_named_and_another_is_refused(made, tmp_path):
    recording, folder = made(swung(), DAMPED)
    moved = recording.rename(tmp_path / "elsewhere")
    with pytest.raises(UsageError, match="--recording PATH"):
        export_diagnosis(folder)
    export_diagnosis(folder, recording=moved)
    (tmp_path / "other").mkdir()
    write_recording(swung(1.0), tmp_path / "other")
    with pytest.raises(UsageError, match="not the recording of"):
        export_diagnosis(folder, tmp_path / "o.mcap", recording=tmp_path / "other")
    assert not (tmp_path / "o.mcap").exists()


def test_a_diagnosis_that_does_not_say_where_its_recording_lies_asks_for_it(made):
    recording, folder = made(swung(), DAMPED, remember=False)
    with pytest.raises(UsageError, match="name it with --recording PATH"):
        export_diagnosis(folder)
    assert export_diagnosis(folder, recording=recording)


@pytest.mark.usefixtures("own_files")
def test_nobody_knows_the_shape_of_a_users_own_system(made, tmp_path, monkeypatch):
    (tmp_path / "mine.py").write_text(
        "class Mine:\n"
        "    state = {'angle': 'rad', 'speed': 'rad/s'}\n    action = {'torque': 'N m'}\n    parameters = {}\n"
        "    coordinates = {'angle': 'speed'}\n"
        "    def rates(self, state, action, p, forces):\n"
        "        return {'speed': action['torque'] + forces['angle']}\n"
    )
    monkeypatch.chdir(tmp_path)
    recording = swung()
    names = Channels.of({"angle": "rad", "speed": "rad/s"})
    _, folder = made(replace(recording, system="mine.py:Mine", state=names, parameters={}))
    path, notes = export_diagnosis(folder, horizon=HORIZON)
    assert "no body is drawn" in notes[-1]
    found = read(path)
    assert "/tf" not in found
    assert len(found["/base/state"][0]) > 100


def test_it_is_refused_in_one_line(made, tmp_path):
    _, folder = made(swung(), DAMPED)
    (tmp_path / "there").touch()
    for words, text in (
        ([], "name the format: --mcap"),
        (["--mcap", "--out", str(tmp_path / "there")], "exists already"),
        (["--mcap", "--out", str(folder / "a.mcap")], "which is never changed"),
        (["--mcap", "--out", str(tmp_path / "no" / "a.mcap")], "no such folder"),
        (["--mcap", "--horizon", "0"], "more than 0 s"),
    ):
        result = CliRunner().invoke(app, ["export", "diagnosis", str(folder), *words])
        assert isinstance(result.exception, UsageError)
        assert text in str(result.exception)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["diagnosis", "recording", "there"]


@pytest.mark.parametrize("missing", ["mcap", "mcap_protobuf", "foxglove_schemas_protobuf", "rerun"])
def test_without_the_extra_it_says_what_to_install_before_anything_else(missing, tmp_path, monkeypatch):
    monkeypatch.setattr(stage, "find_spec", lambda name: None if name == missing else object())
    form, extra = ("rrd", "rerun") if missing == "rerun" else ("mcap", "foxglove")
    with pytest.raises(UsageError, match=rf"pip install 'gpsim\[{extra}\]'"):
        export_diagnosis(tmp_path / "nothing", form=form)
    assert not list(tmp_path.iterdir())


def test_gpsim_starts_without_the_extra():
    hidden = "import sys; sys.modules.update(dict.fromkeys(['mcap', 'mcap_protobuf', 'foxglove_schemas_protobuf', 'rerun']))"
    subprocess.run([sys.executable, "-c", f"{hidden}; import gpsim.cli.main"], check=True)
