"""Robots of the proof: drawn by seed, moved as closed forms and MuJoCo say, published with the model that is believed."""

from dataclasses import replace

import numpy as np
import pytest

from gpsim.effects import Term
from gpsim.errors import UsageError
from gpsim.mjcf import load_mjcf
from gpsim.trials.robots import models
from gpsim.trials.robots.draws import (
    ALIKE,
    STRENGTHS,
    draw_robot,
    places_of,
    planned,
    stratum_of,
)
from gpsim.trials.robots.driving import run, sound
from gpsim.trials.robots.models import ROBOTS, Drives, Robot, files_of, layout_of, spec_of
from gpsim.trials.robots.moving import QUARTER, Plant, recorded
from gpsim.trials.worlds import FROM, TrueEffect

mujoco = pytest.importorskip("mujoco")
pytest.importorskip("dm_control")

BLOCK = """<mujoco><option timestep="0.004" gravity="0 0 0"/><worldbody><body name="block">
<joint name="x" type="slide" axis="1 0 0"/><geom size="0.1" mass="2"/></body></worldbody>
<actuator><motor name="push" joint="x" ctrlrange="-5 5"/></actuator></mujoco>"""
ROD = """<mujoco><option timestep="0.004"/><worldbody><body name="rod"><joint name="q" axis="0 1 0"/>
<inertial pos="0 0 -0.5" mass="1.5" diaginertia="0.02 0.02 0.001"/></body></worldbody>
<actuator><position name="servo" joint="q" kp="40" kv="3" ctrlrange="-2 2"/></actuator></mujoco>"""


@pytest.fixture
def small(monkeypatch):
    """Two robots of one joint, whose motion is known in closed form."""

    def robot(name, xml, way):
        text, drives = lambda: {"robot.xml": xml}, Drives((5.0,))
        return Robot(
            name, "robot.xml", text, (way,), (0.02,), {way: (0.0,)}, (0.1,), (0.5,), (), (), (), drives
        )

    made = {"block": robot("block", BLOCK, "swing"), "rod": robot("rod", ROD, "servo")}
    monkeypatch.setattr(models, "ROBOTS", {**ROBOTS, **made})


def moved(robot, effects, state, action, seconds):
    """States (N + 1, S) every fine step, and their times [s]."""
    plant = Plant(robot, effects)
    plant.begin(np.zeros((1, 2)))
    steps, row = round(seconds / plant.h), np.array([state], dtype=float)
    rows = [row[0]]
    for _ in range(steps):
        row = plant.after(row, np.array([action], dtype=float))
        rows.append(row[0])
    return np.array(rows), plant.h * np.arange(steps + 1)


def test_a_block_on_a_damped_spring_swings_as_its_equation_says(small):
    stiffness, damping, mass, rest = 30.0, 1.2, 2.0, 0.1
    effects = [
        TrueEffect("spring", "x", {"stiffness": stiffness, "rest_position": rest}),
        TrueEffect("viscous_friction", "x", {"damping": damping}),
    ]
    states, t = moved("block", effects, (0.4, 0.0), (0.0,), 1.5)
    decay = damping / (2 * mass)
    turn = np.sqrt(stiffness / mass - decay**2)
    wave = 0.3 * np.exp(-decay * t) * (np.cos(turn * t) + decay / turn * np.sin(turn * t))
    np.testing.assert_allclose(states[:, 0], rest + wave, atol=1e-7)


def test_dry_friction_stops_a_block_where_its_work_is_done_and_holds_it(small):
    friction, mass, speed = 3.0, 2.0, 0.9
    effects = [TrueEffect("coulomb_friction", "x", {"force": friction})]
    states, _ = moved("block", effects, (0.0, speed), (0.0,), 1.2)
    assert states[-1, 0] == pytest.approx(mass * speed**2 / (2 * friction), abs=2e-4)
    held, _ = moved("block", effects, (0.0, 0.0), (2.9,), 1.0)
    assert abs(held[-1, 0]) < 1e-4  # 2.9 N do not move what 3 N hold
    slides, t = moved("block", effects, (0.0, 0.0), (4.0,), 1.0)
    assert slides[-1, 0] == pytest.approx((4.0 - friction) / mass * t[-1] ** 2 / 2, rel=5e-3)


def test_payload_tilt_and_armature_enter_the_equation_of_a_rod(small):
    """I q'' = -g (m l sin(q - pitch) ...) + servo, by a scheme of its own."""
    load, at, rotor, pitch = 0.4, -0.8, 0.05, 0.1
    effects = [
        TrueEffect("payload", "rod", {"mass": load, "x": 0.0, "y": 0.0, "z": at}),
        TrueEffect("armature", "q", {"inertia": rotor}),
        TrueEffect("gravity_tilt", "gravity", {"roll": 0.0, "pitch": pitch}),
        TrueEffect("parameter_offset", "servo.kp", {"ratio": 1.25}),
        TrueEffect("joint_offset", "q", {"offset": 0.05}),
    ]
    states, t = moved("rod", effects, (0.3, 0.0), (0.2,), 0.8)
    inertia = 0.02 + 1.5 * 0.5**2 + load * at**2 + rotor
    lever = 1.5 * 0.5 + load * abs(at)

    def slope(y):
        q, v = y
        # Whoever stands on a base that is pitched forward sees things hang that much back.
        servo = 40 * 1.25 * (0.2 - (q + 0.05)) - 3 * v
        return np.array([v, (servo - 9.81 * lever * np.sin(q + pitch)) / inertia])

    y, dt = np.array([0.3, 0.0]), t[1] / 4
    for _ in range(4 * (len(t) - 1)):
        k1 = slope(y)
        k2 = slope(y + dt / 2 * k1)
        k3 = slope(y + dt / 2 * k2)
        y = y + dt / 6 * (k1 + 2 * k2 + 2 * k3 + slope(y + dt * k3))
    np.testing.assert_allclose(states[-1], y, atol=1e-6)


@pytest.mark.parametrize("robot", sorted(ROBOTS))
def test_the_truth_is_at_a_quarter_of_the_step_and_what_mujoco_integrates(robot):
    """Without effects it is the published model, integrated by MuJoCo's own scheme in steps of a twentieth."""
    plant, model, layout = Plant(robot, ()), spec_of(robot).compile(), layout_of(robot)
    assert plant.h <= model.opt.timestep / QUARTER
    robot_ = ROBOTS[robot]
    state = np.zeros(len(layout.state))
    state[0::2] = robot_.rest[robot_.ways[0]]
    state[0] += 0.05
    action = np.full(len(layout.action), 0.05)
    plant.begin(np.zeros((1, 2)))
    row = state[None]
    for _ in range(round(0.1 / plant.h)):
        row = plant.after(row, action[None])
    model.opt.timestep /= 20
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    data = mujoco.MjData(model)
    data.qpos[:], data.ctrl[:] = state[0::2], action
    mujoco.mj_step(model, data, round(0.1 / model.opt.timestep))
    scale = max(np.abs(data.qpos - state[0::2]).max(), 1e-3)
    np.testing.assert_allclose(row[0, 0::2], data.qpos, atol=1e-4 * scale)


BODILY = [
    (family, robot, on)
    for robot in ("arm", "dm_acrobot")
    for family in sorted(STRENGTHS)
    if not family.startswith(("actuator", "sensor", "joint"))
    for on in places_of(family, ROBOTS[robot])[-1:]
]
VALUES = {
    "viscous_friction": {"damping": 0.2}, "quadratic_drag": {"drag": 0.3}, "constant_force": {"force": -0.4},
    "spring": {"stiffness": 1.5, "rest_position": 0.3}, "armature": {"inertia": 0.03},
    "coulomb_friction": {"force": 0.1},
    "stribeck_friction": {"force": 0.05, "static_force": 0.1, "stribeck_velocity": 0.5},
    "payload": {"mass": 0.3, "x": 0.04, "y": 0.02, "z": 0.03}, "gravity_tilt": {"roll": 0.08, "pitch": -0.05},
    "parameter_offset": {"ratio": 1.3},
}  # fmt: skip


@pytest.mark.parametrize(("family", "robot", "on"), BODILY)
def test_every_law_of_a_body_is_the_catalogues_though_written_twice(family, robot, on, tmp_path):
    """Truth and corrected simulator move alike: to a hundredth of what the effect does in a tenth of a second."""
    for name, text in files_of(robot).items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    simulator = load_mjcf(str(tmp_path / ROBOTS[robot].file)).exact()
    layout, values = layout_of(robot), VALUES[family]
    state = np.zeros(len(layout.state))
    state[0::2] = ROBOTS[robot].rest[ROBOTS[robot].ways[0]]
    state[1::2] = 0.9
    action = np.full(len(layout.action), 0.3)
    plain = Plant(robot, ())
    h, bare = plain.h / 8, None
    ends = []
    for effects in ((), (TrueEffect(family, on, values),)):
        plant = Plant(robot, effects, h)
        plant.begin(np.zeros((1, 2)))
        row = state[None]
        for _ in range(round(0.1 / h)):
            row = plant.after(row, action[None])
        ends.append(row[0])
    bare, truth = ends
    steps = round(0.1 / h)
    columns = [simulator.state.index(n) for n in layout.names]
    term = Term(family, on, values)
    start = np.zeros((1, len(columns)))
    start[0, columns] = state
    held = np.repeat(action[None, None], steps, axis=1)
    told = {k: np.array([v]) for k, v in values.items()}
    made = simulator.rolled([term], simulator.defaults(), [told], start, held, np.array([h]), np.zeros(1))
    np.testing.assert_allclose(made[0, -1, columns], truth, atol=0.01 * np.abs(truth - bare).max())
    assert np.abs(truth - bare).max() > 1e-4


def test_every_family_comes_once_a_cycle_and_no_two_of_a_world_are_alike():
    singles = [r for r in range(1, 200) if stratum_of(r)[0] == "single"][: len(STRENGTHS)]
    drawn = [planned(11, FROM["robots"] + r) for r in singles]
    assert {effects[0][0] for _, effects, _ in drawn} == set(STRENGTHS)
    for r in (r for r in range(1, 160) if stratum_of(r)[0] == "pair"):
        one, other = (family for family, _ in planned(11, FROM["robots"] + r)[1])
        assert not any({one, other} <= group for group in ALIKE)


@pytest.mark.parametrize("number", [1, 7, 12])
def test_a_run_keeps_in_bounds_and_its_log_is_the_models(number):
    world = replace(draw_robot(7, FROM["robots"] + number), episodes=2, steps=80)
    truth = run(world, world.effects)
    kept = sound(world, truth)
    assert (kept > 40).all()
    log = recorded(world, truth.measured, truth, kept)
    assert log.model == ROBOTS[world.system].file
    assert log.system == "mjcf"
    assert set(log.action.names) == set(layout_of(world.system).action)
    seen = log.state.names
    assert set(layout_of(world.system).joints) <= set(seen)
    assert (f"{seen[0]}_dot" in seen) == (world.velocities is not None)
    clean = recorded(world, truth.clean, truth, kept)
    off = log.episodes[0].states - clean.episodes[0].states
    assert off[:, 0].std() == pytest.approx(world.noise[seen[0]], rel=0.5)


def test_a_package_that_is_missing_is_one_line(monkeypatch):
    monkeypatch.setattr(models.importlib.util, "find_spec", lambda name: None)
    models.files_of.cache_clear()
    with pytest.raises(UsageError, match=r"no package dm_control.*gpsim\[prove\]"):
        files_of("dm_acrobot")


def test_of_a_urdf_the_meshes_are_left_out_and_the_inertias_stay():
    pytest.importorskip("cmeel")
    (text,) = files_of("ur5").values()
    assert "<mesh" not in text
    model = spec_of("ur5").compile()
    assert model.nu == model.nv == 6
    assert float(model.body_mass.sum()) > 15
