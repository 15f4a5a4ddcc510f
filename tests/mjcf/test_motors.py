"""What motors give, by MuJoCo itself; friction under load against scipy, on a model and on a servo joint."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from gpsim.effects import FAMILIES, RISE, Chain, Term
from gpsim.mjcf import load_mjcf
from gpsim.simulators import make_simulator

ACTUATORS = {
    "motor": '<motor joint="j" gear="3"/>',
    "position servo": '<position joint="j" kp="40" kv="2" forcerange="-4 4"/>',
    "velocity servo": '<velocity joint="j" kv="5" gear="2"/>',
    "two": '<motor joint="j" gear="3"/><position joint="j" kp="12"/>',
}
MODEL = """<mujoco><option gravity="0 0 0" timestep="0.0005"><flag contact="disable"/></option><worldbody><body>
<joint name="j" axis="0 0 1" armature="0.5" {range}/><geom type="capsule" size="0.02" fromto="0 0 0 0.3 0 0" mass="1"/></body></worldbody>
<actuator>{actuators}</actuator></mujoco>"""
INERTIA = 0.5  # kg m^2 of the servo joint
SECONDS, DT, SHARE, DRY = 0.8, 0.02, 0.3, 0.05


def _model(folder, actuators, limits=""):
    path = folder / "arm.xml"
    path.write_text(MODEL.format(range=limits, actuators=actuators))
    return load_mjcf(str(path))


@pytest.mark.parametrize("kind", ACTUATORS)
@pytest.mark.parametrize("limits", ["", 'actuatorfrclimited="true" actuatorfrcrange="-2 2"'])
def test_motors_give_what_mujoco_says(tmp_path, kind, limits):
    simulator = _model(tmp_path, ACTUATORS[kind], limits)
    model, rng = simulator.body.base, np.random.default_rng(0)
    data = mujoco.MjData(model)
    state = rng.uniform(-1.5, 1.5, (40, 2))
    action = rng.uniform(-1.0, 1.0, (40, model.nu))
    said, wanted = simulator.given(state, action, simulator.defaults())["j"], []
    for (q, v), u in zip(state, action, strict=True):
        data.qpos[0], data.qvel[0], data.ctrl[:] = q, v, u
        mujoco.mj_forward(model, data)
        wanted.append(float(data.qfrc_actuator[0]))
    np.testing.assert_allclose(said, wanted, rtol=1e-9, atol=1e-12)


def _target(t):
    return 0.6 * np.sin(4.0 * DT * np.floor(t / DT + 1e-9))


def _by_scipy(inertia, servo, share):
    state = np.array([0.4, 0.0])
    for k in range(round(SECONDS / DT)):
        u = _target(k * DT)

        def slope(t, s, u=u):
            given = servo(u, *s)
            return [s[1], (given - (DRY + share * abs(given)) * np.tanh(s[1] / 1e-4)) / inertia]

        state = solve_ivp(slope, (0.0, DT), state, "LSODA", rtol=1e-9, atol=1e-11).y[:, -1]
    return state


def _terms():
    return (
        Term("coulomb_friction", "j", {"force": DRY}),
        Term("load_friction", "j", {"share": SHARE}, variant=RISE),
    )


def test_friction_under_load_moves_a_model_as_scipy_does(tmp_path):
    simulator = _model(tmp_path, ACTUATORS["position servo"])
    inertia = float(simulator.inertia(np.zeros((1, 2)), simulator.defaults())[0, 0, 0])
    steps = round(DT / simulator.own_step)
    held = np.repeat(_target(DT * np.arange(round(SECONDS / DT))), steps)[None, :, None]
    values = [{k: np.array([v]) for k, v in t.values.items()} for t in _terms()]
    begin, step = np.array([[0.4, 0.0]]), np.array([simulator.own_step])
    found = simulator.rolled(_terms(), {}, values, begin, held, step, np.zeros(1))[0, -1]

    def servo(u, q, v):
        return np.clip(40.0 * (u - q) - 2.0 * v, -4.0, 4.0)

    wanted = _by_scipy(inertia, servo, SHARE)
    np.testing.assert_allclose(found, wanted, atol=5e-3)
    assert np.abs(wanted - _by_scipy(inertia, servo, 0.0)).max() > 0.05  # and the load matters


def test_friction_under_load_moves_a_servo_joint_as_scipy_does():
    simulator = make_simulator("servo_joint")
    parameters = simulator.defaults() | {
        "inertia": INERTIA,
        "stiffness": 40.0,
        "damping": 2.0,
        "torque_limit": 4.0,
    }
    terms = (
        Term("coulomb_friction", "theta", {"force": DRY}),
        Term("load_friction", "theta", {"share": SHARE}),
    )
    chain = Chain(simulator, parameters, terms, "fine", DT)
    values = [{k: np.array([v]) for k, v in t.values.items()} for t in terms]
    state, step = np.array([[0.4, 0.0]]), np.array([5e-4])
    for k in range(round(SECONDS / 5e-4)):
        state = chain.advance(state, np.array([[_target(k * 5e-4)]]), values, step, np.zeros(1))

    def servo(u, q, v):
        return np.clip(40.0 * (u - q) - 2.0 * v, -4.0, 4.0)

    np.testing.assert_allclose(state[0], _by_scipy(INERTIA, servo, SHARE), atol=2e-3)


def test_a_servo_joint_is_asked_for_it_and_a_model_only_with_all_its_joints(tmp_path):
    law = FAMILIES["load_friction"]
    assert law.places(make_simulator("servo_joint")) == ("theta",)
    simulator = _model(tmp_path, ACTUATORS["motor"])
    assert law.places(simulator) == ()
    assert simulator.served == ("j",)
