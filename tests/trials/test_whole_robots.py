"""Whole robots: dealt and drawn by seed, moved as another code says, what each effect asks of a joint, what is logged."""

import json
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from gpsim.recordings import read_recording
from gpsim.trials import concealing as robot_worlds
from gpsim.trials.blinding import recording_digests, write_trial
from gpsim.trials.judged import bodies_off
from gpsim.trials.robots import whole
from gpsim.trials.robots.driving import run_whole, sound
from gpsim.trials.robots.models import WHOLE, layout_of, robot_of
from gpsim.trials.robots.moving import Plant, Stepped, step_of
from gpsim.trials.robots.whole import (
    ROWS,
    body_torques,
    dealt,
    draw_whole,
    joint_torques,
    motion_of,
    of_body,
    shares_of,
)
from gpsim.trials.worlds import FROM, TrueEffect

pytest.importorskip("mujoco")
SMOOTH = [
    TrueEffect("viscous_friction", "shoulder", {"damping": 0.2}),
    TrueEffect("armature", "elbow", {"inertia": 0.02}),
    TrueEffect("constant_force", "elbow", {"force": 0.15}),
    TrueEffect("parameter_offset", "lower.mass", {"ratio": 1.3}),
    TrueEffect("payload", "lower", {"mass": 0.2, "x": 0.02, "y": 0.01, "z": -0.2}),
]
DRY = TrueEffect("coulomb_friction", "shoulder", {"force": 0.3})
STATE, ACTION = np.array([[0.3, 0.4, -0.2, -0.5]]), np.array([[0.4, -0.3]])


@pytest.fixture
def planar(monkeypatch):
    """Whole robots are the planar arm alone, their recordings short."""
    monkeypatch.setattr(whole, "TRANSITIONS", (420, 440))
    monkeypatch.setattr(whole, "SECONDS", (1.8, 2.0))
    monkeypatch.setattr(robot_worlds, "FEWEST", 100)

    def deal(name="planar", encoder=False):
        monkeypatch.setattr(whole, "dealt", lambda seed, rank: (name, encoder))

    deal()
    return deal


def test_each_robot_comes_once_a_cycle_half_by_servos_half_read_by_encoders():
    for cycle in range(3):
        found = [dealt(5, 12 * cycle + i) for i in range(12)]
        assert sorted(name.removesuffix("_servos") for name, _ in found) == sorted(WHOLE)
        assert sum(encoder for _, encoder in found) == 6
        assert sum(robot_of(name).ways == ("servo",) for name, _ in found) == 6
    orders = Counter(tuple(dealt(5, 12 * c + i)[0] for i in range(12)) for c in range(3))
    assert len(orders) == 3


def test_a_whole_robot_has_three_rows_a_joint_in_the_drives_sizes_and_one_or_two_bodies(planar):
    drives = robot_of("planar").drives
    for number in range(FROM["whole"] + 1, FROM["whole"] + 20):
        world = draw_whole(3, number)
        assert world == draw_whole(3, number)
        rows = {(e.family, e.on): e.values for e in world.effects if e.family in ROWS}
        assert len(rows) == 6
        for joint, torque in zip(("shoulder", "elbow"), drives.torque, strict=True):
            assert 0.0099 <= rows["coulomb_friction", joint]["force"] / torque <= 0.0601
            assert (
                drives.spin[0] * 0.99 <= torque / rows["armature", joint]["inertia"] <= drives.spin[1] * 1.01
            )
        assert 1 <= sum(of_body(e.family, e.on) for e in world.effects) <= 2
        late = {e.values["delay"] for e in world.effects if e.family == "actuator_delay"}
        assert len(late) <= 1
    assert draw_whole(3, FROM["whole"] + 1) != draw_whole(4, FROM["whole"] + 1)


def stepped(effects, seconds, h):
    plant = Stepped("planar", effects, h)
    plant.begin(STATE)
    return plant.sample(ACTION, ACTION, round(seconds / h))[0]


@pytest.mark.parametrize(("effects", "near"), [(SMOOTH, 1e-7), ([*SMOOTH, DRY], 2e-4)])
def test_two_codes_of_the_truth_move_alike(effects, near):
    plant, h = Plant("planar", effects), step_of("planar")
    plant.begin(np.zeros((1, 2)))
    row = STATE
    for _ in range(round(0.3 / plant.h)):
        row = plant.after(row, ACTION)
    bare = stepped((), 0.3, h)
    assert np.abs(row[0] - bare).max() > 0.05
    np.testing.assert_allclose(stepped(effects, 0.3, h), row[0], atol=near)


def test_late_commands_act_for_the_rest_of_a_sample():
    h, n = step_of("planar"), 40
    late = [TrueEffect("actuator_delay", a, {"delay": 15 * h}) for a in layout_of("planar").action]
    plant = Stepped("planar", [*SMOOTH, *late], h)
    assert plant.late == 15
    plant.begin(STATE)
    found = plant.sample(np.zeros((1, 2)), ACTION, n)[0]
    other = Stepped("planar", SMOOTH, h)
    other.begin(STATE)
    other.sample(np.zeros((1, 2)), np.zeros((1, 2)), 15)
    np.testing.assert_allclose(found, other.sample(ACTION, ACTION, n - 15)[0], atol=1e-12)


def test_what_the_effects_ask_for_together_is_what_the_motors_gave(planar):
    """The torque worked out from the motion is that of the commands, which the true model was moved by."""
    world = draw_whole(3, FROM["whole"] + 2)
    world = replace(world, effects=tuple(e for e in world.effects if e.family != "actuator_delay"))
    truth = run_whole(world)
    kept = sound(world, truth)
    assert (kept == world.steps + 1).all()
    motion = motion_of(world, truth, kept)
    given = np.sqrt(np.mean(truth.commands**2, axis=(0, 1)))
    np.testing.assert_allclose(joint_torques(world, motion), given, rtol=0.05)
    shares = dict(zip(((e.family, e.on) for e in world.effects), shares_of(world, motion), strict=True))
    dry = next(e for e in world.effects if e.family == "coulomb_friction" and e.on == "elbow")
    assert shares["coulomb_friction", "elbow"] == pytest.approx(dry.values["force"] / given[1], rel=0.06)


def test_bodies_are_judged_by_the_torques_that_they_ask_for(planar):
    world = replace(draw_whole(3, FROM["whole"] + 1), effects=tuple(SMOOTH), episodes=1, steps=100)
    assert bodies_off(world, world.effects) == 0.0
    assert bodies_off(world, ()) == 1.0
    # A payload at the centre of mass of what carries it is more mass of it.
    mass = TrueEffect("parameter_offset", "lower.mass", {"ratio": 1.25})
    load = TrueEffect("payload", "lower", {"mass": 0.2, "x": 0.01, "y": 0.0, "z": -0.11})
    alike = replace(world, effects=(mass,))
    assert bodies_off(alike, [load]) < 1e-6
    motion = motion_of(world, run_whole(world), np.array([101]))
    assert np.abs(body_torques("planar", [mass], motion)).max() > 0.05


def test_what_is_logged_of_an_encoder_is_positions_in_steps_with_rows_lost(planar, tmp_path):
    planar("planar_servos", True)
    (tmp_path / "public").mkdir()
    name = str(FROM["whole"] + 1)
    write_trial(tmp_path, 3, FROM["whole"] + 1)
    public = tmp_path / "public" / name
    recording = read_recording(public)
    answer = json.loads((tmp_path / "private" / name / "answer.json").read_text())
    assert (recording.system, recording.model, recording.velocities) == ("mjcf", "planar.xml", None)
    assert recording.state.names == ("shoulder", "elbow")
    step = answer["world"]["rough"]["quantum"]["shoulder"]
    places = recording.episodes[0].states[:, 0] / step
    np.testing.assert_allclose(places, np.round(places), atol=1e-6)
    assert answer["whole"]["rows"]["dropped"] > 0
    assert any(np.diff(e.t).max() > 1.5 * recording.dt for e in recording.episodes)
    assert {e["family"] for e in answer["effects"]} >= set(ROWS)
    for word in ("coulomb", "armature", "payload"):
        assert word not in (public / "recording.yaml").read_text()
    digests = recording_digests(public)
    again = tmp_path / "again"
    (again / "public").mkdir(parents=True)
    write_trial(again, 3, FROM["whole"] + 1)
    assert recording_digests(again / "public" / name) == digests
