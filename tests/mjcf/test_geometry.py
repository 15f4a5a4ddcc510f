"""A model's geometry: slopes against differences, a corrected model against one that is written so, poses in logs."""

import json
import pickle

import mujoco
import numpy as np
import pytest
from mjcf_arms import PLANAR, SIX, Capture, arm, seen
from mjcf_models import written

from gpsim.errors import UsageError
from gpsim.mjcf import Correction, Kinematics, Moved, Place, export_model, in_its_columns, open_simulator
from gpsim.recordings import joined, read_recording, without_poses
from gpsim.residuals import read_table
from gpsim.simulators import make_simulator

FRAMED = """<mujoco><worldbody><body name="a"><joint name="i"/><geom size=".1"/>
<frame pos="1 0 0" euler="0 0 30"><body name="b" pos="0 0 .2"><joint name="j" axis="0 1 0"/><geom size=".1"/>
<site name="tool" pos="0 0 .1"/></body></frame></body></worldbody></mujoco>"""
MOVED = (
    Moved(Place("joint zero", "j2", "", "rad"), 0.02),
    Moved(Place("body place", "l3", "z", "m"), 0.003),
    Moved(Place("body turn", "l2", "x", "rad"), 0.01),
    Moved(Place("site place", "tool", "y", "m"), -0.004),
)


def tool_of(text, q):
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    data.qpos[:] = q
    mujoco.mj_kinematics(model, data)
    return np.array(data.site("tool").xpos)


def truly(**more):
    half = 0.005
    turn = f"{np.cos(half):.17g} {np.sin(half):.17g} 0 0"
    return arm(SIX, z2=-0.02, l3=0.403, mark=-0.004, turn=turn, **more)


def test_slopes_are_those_of_differences(tmp_path):
    simulator = open_simulator(written(tmp_path, arm()))
    kinematics = Kinematics.of(simulator.body, ["tool", "l4"], [True, True])
    rng, step = np.random.default_rng(0), 1e-6
    q, values = rng.normal(size=(20, 6)), 0.05 * rng.normal(size=len(kinematics.places))
    slopes, here = kinematics.slopes(q, values), kinematics.poses(q, values)
    for i, nudge in enumerate(step * np.eye(len(values))):
        ahead, back = kinematics.poses(q, values + nudge), kinematics.poses(q, values - nudge)
        moves = (ahead.points - back.points) / (2 * step)
        turns = np.einsum("nkij,nklj->nkil", (ahead.axes - back.axes) / (2 * step), here.axes)
        about = np.stack([turns[..., 2, 1], turns[..., 0, 2], turns[..., 1, 0]], axis=-1)
        np.testing.assert_allclose(slopes.points[..., i], moves, atol=1e-8, err_msg=str(kinematics.places[i]))
        np.testing.assert_allclose(slopes.axes[..., i], about, atol=1e-8, err_msg=str(kinematics.places[i]))


def test_a_corrected_model_is_the_one_that_is_written_so(tmp_path):
    simulator = pickle.loads(pickle.dumps(open_simulator(written(tmp_path, arm())).in_geometry(MOVED)))
    assert simulator.geometry == MOVED
    model = simulator.body.base
    data = mujoco.MjData(model)
    for q in np.random.default_rng(1).normal(size=(5, 6)):
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        np.testing.assert_allclose(data.site("tool").xpos, tool_of(truly(), q), atol=1e-12)


def test_a_zero_moves_what_gravity_does(tmp_path):
    """The acceleration from rest at an encoder's reading is the true model's there."""
    simulator = open_simulator(written(tmp_path, arm())).in_geometry(MOVED)
    truth = open_simulator(written(tmp_path, truly(), "truth.xml"))
    state = np.zeros((3, 12))
    state[:, :6] = np.random.default_rng(2).normal(size=(3, 6))
    none = np.zeros((3, 0))
    np.testing.assert_allclose(
        simulator.rates(state, none, {}), truth.rates(state, none, {}), rtol=1e-9, atol=1e-9
    )


def test_the_corrected_geometry_is_in_the_written_model(tmp_path):
    simulator = open_simulator(written(tmp_path, arm())).in_geometry(MOVED)
    out = tmp_path / "fixed.xml"
    said = {MOVED[0].place: "the zero of j2 is off by 0.02 rad"}
    made = export_model(Correction(simulator, {}, (), 0.02, 10), {}, {}, out, said)
    assert made.difference < 1e-9
    text = out.read_text()
    assert "<!-- the zero of j2 is off by 0.02 rad -->\n" in text
    for q in np.random.default_rng(3).normal(size=(3, 6)):
        np.testing.assert_allclose(tool_of(text, q), tool_of(truly(), q), atol=1e-9)
    patch = json.loads((tmp_path / "patch.json").read_text())
    assert [g["kind"] for g in patch["geometry"]] == [m.place.kind for m in MOVED]


def test_a_moved_body_in_a_frame_is_refused(tmp_path):
    off = Moved(Place("body place", "b", "x", "m"), 0.01)
    simulator = open_simulator(written(tmp_path, FRAMED)).in_geometry([off])
    with pytest.raises(UsageError, match="stands in a <frame>"):
        export_model(Correction(simulator, {}, (), 0.02, 10), {}, {}, tmp_path / "out.xml")


def test_poses_of_a_bare_table_are_kept_and_nothing_else(tmp_path):
    table = seen(arm(PLANAR), Capture(seconds=1.0, lost=0.2))
    table["nobody.x"], table["nobody.y"], table["nobody.z"] = 1.0, 2.0, 3.0
    table["fore.x"], table["fore.y"] = 1.0, 2.0  # no place without z
    table["note"] = "a"
    table.to_csv(tmp_path / "log.csv", index=False)
    simulator = open_simulator(written(tmp_path, arm(PLANAR)))
    made = in_its_columns(read_table(tmp_path / "log.csv", simulator), simulator)
    assert made.poses.names == ("tool.x", "tool.y", "tool.z")
    assert made.state.names == ("shoulder", "elbow")
    np.testing.assert_allclose(made.episodes[0].poses, table[list(made.poses.names)])
    assert 0 < np.isnan(made.episodes[0].poses[:, 0]).sum() < 40
    both = joined([made, without_poses(made)], ["a", "b"])
    assert not len(both.poses)
    assert both.episodes[0].poses is None


def test_poses_of_a_recording_may_be_declared_as_state_or_not(tmp_path):
    table = seen(arm(PLANAR), Capture(seconds=1.0)).assign(episode="0")
    table.to_csv(tmp_path / "recording.csv", index=False)
    simulator = open_simulator(written(tmp_path, arm(PLANAR)))
    said = "system: mjcf\ndt: 0.02\naction: {}\nstate: {shoulder: rad, elbow: rad"
    made = []
    for more in ("}", ", tool.x: m, tool.y: m, tool.z: m}"):
        (tmp_path / "recording.yaml").write_text(said + more)
        made.append(in_its_columns(read_recording(tmp_path), simulator))
    for recording in made:
        assert recording.poses.names == ("tool.x", "tool.y", "tool.z")
        np.testing.assert_allclose(recording.episodes[0].poses, table[list(recording.poses.names)])


def test_other_simulators_pass_over_such_columns(tmp_path):
    table = seen(arm(PLANAR), Capture(seconds=1.0)).rename(columns={"shoulder": "q"})
    table.assign(q_dot=0.0, force=0.0).to_csv(tmp_path / "log.csv", index=False)
    slider = make_simulator("slider")
    made = in_its_columns(read_table(tmp_path / "log.csv", slider), slider)
    assert made.state.names == ("q", "q_dot")
