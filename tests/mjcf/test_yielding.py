"""Elastic drives and bristles at a model's joints: by scipy however stiff, and found with their sizes in MuJoCo's own."""

import mujoco
import numpy as np
import pytest
from mjcf_models import LINK, MASS, SERVO, SLIDER, logged, written
from scipy.integrate import solve_ivp

from gpsim.diagnosis import diagnose
from gpsim.effects import FAMILIES, Chain, Term, closed
from gpsim.mjcf import load_mjcf
from gpsim.stages.diagnose import Task, open_recording

HELD, DT, NOISE = 0.05, 0.01, 2e-4
SOFT = {"stiffness": 40.0, "damping": 0.6, "inertia": 0.8}
STIFF = {"stiffness": 4000.0, "damping": 3.0, "inertia": 0.5}
BRISTLES = {"force": 2.0, "static_force": 3.0, "stribeck_velocity": 0.1, "stiffness": 300.0}
SPRING = {"stiffness": 6.0, "damping": 0.02, "inertia": 0.02}  # 4.3 Hz of an elbow


def _turned(k):
    def slope(_, s, u):
        pull = k["stiffness"] * (s[2] - s[0]) + k["damping"] * (s[3] - s[1])
        return [s[1], pull / MASS, s[3], (u - pull) / k["inertia"]]

    return slope, np.zeros(4)


def _rubbed(k):
    def slope(_, s, u):
        more = max(k["static_force"] - k["force"], 0.0) * np.exp(-((s[1] / k["stribeck_velocity"]) ** 2))
        rate = s[1] - k["stiffness"] * abs(s[1]) / (k["force"] + more) * s[2]
        return [s[1], (u - k["stiffness"] * s[2] - np.sqrt(k["stiffness"] * MASS) * rate) / MASS, rate]

    return slope, np.zeros(3)


@pytest.mark.parametrize(
    ("family", "on", "k", "truth"),
    [
        ("flexible_coupling", "force", SOFT, _turned),
        ("flexible_coupling", "force", STIFF, _turned),
        ("lugre_friction", "q", BRISTLES, _rubbed),
        ("lugre_friction", "q", BRISTLES | {"stiffness": 1e5}, _rubbed),
    ],
)
def test_it_moves_as_scipy_says(tmp_path, family, on, k, truth):
    simulator, pushes = load_mjcf(written(tmp_path, SLIDER)), 6.0 * np.sin(0.25 * np.arange(40))
    (slope, state), wanted = truth(k), []
    for u in pushes:
        state = solve_ivp(slope, (0.0, HELD), state, "LSODA", args=(u,), rtol=1e-9, atol=1e-11).y[:, -1]
        wanted.append(state[:2])
    term, off = Term(family, on, k), []
    chain = Chain(simulator, simulator.defaults(), (term,), "fine", HELD)
    for n in (5, 20, 20):
        bends, step, state = chain.unbent(2), np.full(2, HELD / n), np.zeros((2, 2))
        values = [{name: np.full(2, value) for name, value in k.items()}]
        found = []
        for u in pushes:  # a transition at a time: what is hidden is handed on
            held = np.full((2, n, 1), u)
            state = chain.rolled(closed(simulator), state, held, values, step, np.zeros(2), None, bends)[
                :, -1
            ]
            found.append(state[1])
        off.append((np.abs(np.array(found) - wanted) / np.abs(wanted).max(axis=0)).max())
    assert off[0] < 5e-3
    assert off[1] < 5e-4
    assert off[2] == off[1]


@pytest.mark.parametrize(
    ("terms", "heavier"),
    [
        (
            [
                Term("flexible_coupling", "force", SOFT | {"stiffness": 1e9}),
                Term("coulomb_friction", "q", {"force": 4.0}),
            ],
            SOFT["inertia"],
        ),
        ([Term("lugre_friction", "q", {"force": 4.0, "stiffness": 1e9})], 0.0),
    ],
)
def test_no_stiffness_makes_a_step_unstable(tmp_path, terms, heavier):
    """As stiff as can be they are a rotor on the load, and dry friction."""
    simulator = load_mjcf(written(tmp_path, SLIDER))
    values = [{name: np.ones(1) * value for name, value in t.values.items()} for t in terms]
    held = np.full((1, 100, 1), 10.0)
    found = simulator.rolled(terms, {}, values, np.zeros((1, 2)), held, np.array([0.02]), np.zeros(1))[0]
    assert found[-1, 1] == pytest.approx((10.0 - 4.0) / (MASS + heavier) * 2.0, rel=2e-2)


def test_motors_are_asked_and_servos_are_not(tmp_path):
    coupling = FAMILIES["flexible_coupling"]
    assert coupling.places(load_mjcf(written(tmp_path, SLIDER))) == ("force",)
    assert coupling.places(load_mjcf(written(tmp_path, SERVO, "servo.xml"))) == ()


ARM = f"""<mujoco><option timestep="0.002" integrator="implicitfast"/><worldbody>
<body><joint name="shoulder" axis="0 1 0" damping="0.05"/>{LINK.format(0.5, 1.0)}ROTOR
<body pos="0 0 -.5"><joint name="elbow" axis="0 1 0" damping="0.02"/>{LINK.format(0.4, 0.6)}</body></body></worldbody>
SPRING<actuator><motor name="m1" joint="shoulder"/><motor name="m2" joint="DRIVEN"/></actuator></mujoco>"""
BELIEVED = ARM.replace("ROTOR", "").replace("SPRING", "").replace("DRIVEN", "elbow")
ROTOR = f"""<body pos="0 0 -.5"><joint name="rotor" axis="0 1 0" armature="{SPRING["inertia"]}"/>
<inertial pos="0 0 0" mass="1e-6" diaginertia="1e-9 1e-9 1e-9"/></body>"""
BETWEEN = f"""<tendon><fixed stiffness="{SPRING["stiffness"]}" damping="{SPRING["damping"]}" springlength="0">
<joint joint="rotor" coef="1"/><joint joint="elbow" coef="-1"/></fixed></tendon>"""
ELASTIC = ARM.replace("ROTOR", ROTOR).replace("SPRING", BETWEEN).replace("DRIVEN", "rotor")


def _found(folder, text, push=None):
    """What is said of three episodes of an arm, encoders alone; push(model, data): before every step of the truth."""
    rng, model = np.random.default_rng(7), mujoco.MjModel.from_xml_string(text)
    model.opt.timestep, model.opt.integrator = DT / 40, mujoco.mjtIntegrator.mjINT_RK4
    data, rows = mujoco.MjData(model), []
    for e in range(3):
        mujoco.mj_resetData(model, data)
        at = 0.3 * rng.normal(size=2)
        for joint, q in zip(("shoulder", "elbow"), at, strict=True):
            data.joint(joint).qpos[0] = q
        if model.njnt == 3:
            data.joint("rotor").qpos[0] = at[1]
        t = DT * np.arange(500)
        tones = (
            rng.uniform(0.15, 2.5, (2, 5, 1)), rng.uniform(0.0, 6.3, (2, 5, 1)), rng.normal(size=(2, 5, 1)),
        )  # fmt: skip
        made = (tones[2] * np.sin(2 * np.pi * tones[0] * t + tones[1])).sum(axis=1).T
        for k, command in enumerate(made / made.std(axis=0) * [1.2, 0.4]):
            q = np.array([data.joint(j).qpos[0] for j in ("shoulder", "elbow")]) + NOISE * rng.normal(size=2)
            rows.append((e, DT * k, *q, *command))
            data.ctrl[:] = command
            for _ in range(40):
                if push is not None:
                    push(model, data)
                mujoco.mj_step(model, data)
    state, noise = (dict.fromkeys(("shoulder", "elbow"), value) for value in ("rad", NOISE))
    logged(folder, BELIEVED, rows, DT, state, {"m1": "N m", "m2": "N m"}, noise=noise)
    recording, simulator = open_recording(Task(folder, None))
    said = diagnose(recording, simulator, simulator.defaults(), np.random.default_rng(0)).diagnosis
    return said.verdict, {
        (e.family, e.on): {n: p.value for n, p in e.parameters.items()} for e in said.effects
    }


@pytest.mark.slow
def test_a_motor_behind_a_spring_is_found_with_its_sizes(tmp_path):
    """The truth has a joint more, for the motor."""
    verdict, found = _found(tmp_path, ELASTIC)
    assert verdict == "named"
    assert ("armature", "elbow") not in found
    said = found["flexible_coupling", "m2"]
    assert said["stiffness"] == pytest.approx(SPRING["stiffness"], rel=0.03)
    assert said["inertia"] == pytest.approx(SPRING["inertia"], rel=0.05)
    assert said["damping"] == pytest.approx(SPRING["damping"], rel=0.3)


@pytest.mark.slow
def test_bristles_are_found_with_their_sizes(tmp_path):
    """The truth steps the bend itself, in steps a fortieth of the clock's."""
    k, bend, full = {"force": 0.08, "stiffness": 3.0}, np.zeros(1), np.zeros((2, 2))

    def push(model, data):
        bend[data.time == 0.0] = 0.0
        mujoco.mj_forward(model, data)
        mujoco.mj_fullM(model, data, full)
        rate = data.qvel[1] - k["stiffness"] * abs(data.qvel[1]) * bend / k["force"]
        damping = np.sqrt(k["stiffness"] / np.linalg.inv(full)[1, 1])
        data.qfrc_applied[1] = -(k["stiffness"] * bend + damping * rate)[0]
        bend[:] += model.opt.timestep * rate

    verdict, found = _found(tmp_path, BELIEVED, push)
    assert verdict == "named"
    assert ("coulomb_friction", "elbow") not in found
    assert found["lugre_friction", "elbow"] == pytest.approx(k, rel=0.1)


@pytest.mark.slow
def test_nothing_yields_where_a_rotor_and_dry_friction_are_missing(tmp_path):
    verdict, found = _found(
        tmp_path, BELIEVED.replace('damping="0.02"', 'damping="0.02" armature="0.02" frictionloss="0.05"')
    )
    assert verdict == "named"
    assert {family for family, _ in found} >= {"armature", "coulomb_friction"}
    assert {"flexible_coupling", "lugre_friction"}.isdisjoint(family for family, _ in found)
