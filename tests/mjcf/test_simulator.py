"""A MuJoCo model as a simulator: the same numbers as MuJoCo's own functions give one by one."""

import pickle

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mjcf_models import DOUBLE, FLOATING, PENDULUM, SERVO, SLIDER, one_by_one, written

from gpsim.channels import Channels
from gpsim.effects import FAMILIES, BlackBoxStepper, Chain, Gate, Term, closed
from gpsim.mjcf import load_mjcf
from gpsim.simulators import make_simulator, reduced, wrapping

RNG = np.random.default_rng(3)


def split(state):
    return state[0::2], state[1::2]


def random_states(simulator, count, rng=RNG):
    return rng.normal(size=(count, len(simulator.state))), rng.normal(size=(count, len(simulator.action)))


def values_of(count, **values):
    return {name: np.full(count, value) for name, value in values.items()}


def rolled(simulator, state, commands, *terms, h=0.002, t=0.0, **believed):
    """(B, K, S) with terms of the values that they have."""
    count, values = len(state), [values_of(len(state), **term.values) for term in terms]
    parameters = simulator.defaults() | believed
    return simulator.rolled(terms, parameters, values, state, commands, np.full(count, h), np.full(count, t))


@pytest.fixture
def double(tmp_path):
    return load_mjcf(written(tmp_path, DOUBLE))


def test_names_and_units(double, tmp_path):
    assert list(double.state.units.items()) == [
        ("shoulder", "rad"), ("shoulder_dot", "rad/s"), ("elbow", "rad"), ("elbow_dot", "rad/s")
    ]  # fmt: skip
    assert double.action.units == {"m1": "N m", "m2": "N m"}
    assert [c.name for c in double.coordinates] == ["shoulder", "elbow"]
    assert double.state.wraps.tolist() == [True, False, True, False]
    assert {"gravity", "upper.mass", "lower.com_x", "lower.inertia"} <= set(double.parameters)
    unnamed = SLIDER.replace('name="force" ', "").replace('name="cart"', "")
    plain = load_mjcf(written(tmp_path, unnamed, "plain.xml"))
    assert plain.action.names == ("actuator0",)
    motor = '<actuator><motor joint="q"/></actuator>'
    nobody = load_mjcf(written(tmp_path, unnamed.replace('name="q" ', "").replace(motor, ""), "nobody.xml"))
    assert nobody.state.names == ("joint0", "joint0_dot")
    assert not len(nobody.action)
    assert list(plain.parameters) == ["gravity", "body1.mass"]
    servo = load_mjcf(written(tmp_path, SERVO, "servo.xml"))
    assert servo.action.units == {"servo": "rad"}
    assert not servo.state.wraps.any()
    assert {"servo.kp", "servo.kv"} <= set(servo.parameters)


def test_rates_are_those_of_mj_forward_and_forces_those_of_mj_inverse(double):
    state, action = random_states(double, 7)
    forces = RNG.normal(size=(7, 2))
    rates = double.rates(state, action, double.defaults(), forces)
    model, data = double.body.base, mujoco.MjData(double.body.base)
    for i in range(7):
        data.qpos[:], data.qvel[:] = split(state[i])
        data.ctrl[:], data.qfrc_applied[:] = action[i], forces[i]
        mujoco.mj_forward(model, data)
        np.testing.assert_array_equal(rates[i], data.qacc)
        data.qacc[:] = rates[i]
        mujoco.mj_inverse(model, data)
        np.testing.assert_allclose(data.qfrc_inverse, data.qfrc_actuator + forces[i], atol=1e-9)


def test_mobility_is_what_a_unit_force_changes(double):
    state, action = random_states(double, 5)
    for coordinate in range(2):
        unit = np.zeros((5, 2))
        unit[:, coordinate] = 1.0
        change = double.rates(state, action, double.defaults(), unit)
        change -= double.rates(state, action, double.defaults())
        np.testing.assert_allclose(double.mobility(state, double.defaults(), coordinate), change, atol=1e-9)


def test_rollouts_are_those_of_mj_step_one_by_one(double):
    state, _ = random_states(double, 4)
    commands = RNG.normal(size=(4, 60, 2))
    out, again = (rolled(double, state, commands) for _ in range(2))
    np.testing.assert_array_equal(out, again)  # nothing of the first is left: no warm start, no time
    for i in range(4):
        np.testing.assert_array_equal(out[i], one_by_one(double.body.base, state[i], commands[i], split))


def test_a_large_batch_is_that_of_its_parts(double):
    state, _ = random_states(double, 700)
    commands = RNG.normal(size=(700, 3, 2))
    whole, part = rolled(double, state, commands), rolled(double, state[600:], commands[600:])
    np.testing.assert_array_equal(whole[600:], part)


def test_parameters_of_each_simulation_are_its_own(double):
    """As a model that was changed before it was compiled."""
    state, _ = random_states(double, 2)
    commands, ratio = np.zeros((2, 40, 2)), np.array([1.0, 1.3])
    out = rolled(double, state, commands, Term("parameter_offset", "lower.mass", {"ratio": ratio}))
    model = mujoco.MjModel.from_xml_string(DOUBLE)
    for i in range(2):
        model.body_mass[2] = 0.6 * ratio[i]
        mujoco.mj_setConst(model, mujoco.MjData(model))
        np.testing.assert_allclose(out[i], one_by_one(model, state[i], commands[i], split), atol=1e-11)


@pytest.mark.parametrize(
    ("family", "on", "values"),
    [
        ("viscous_friction", "theta", {"damping": 0.4}),
        ("quadratic_drag", "theta", {"drag": 0.3}),
        ("spring", "theta", {"stiffness": 2.0, "rest_position": 0.4}),
        ("constant_force", "theta", {"force": 0.7}),
        ("coulomb_friction", "theta", {"force": 0.9}),
        ("stribeck_friction", "theta", {"force": 0.5, "static_force": 0.9, "stribeck_velocity": 0.5}),
        ("local_friction_patch", "theta", {"force": 0.9}),
    ],
)
def test_a_native_law_is_that_of_the_closed_form(family, on, values, tmp_path):
    """The same pendulum in MuJoCo and as equations; dry friction passes through rest, which is a step of either."""
    ours, theirs = make_simulator("pendulum"), load_mjcf(written(tmp_path, PENDULUM))
    parameters = {"gravity": 9.81, "mass": 1.3, "length": 0.8}
    gate = Gate({"theta": (0.2, 0.9)}) if family == "local_friction_patch" else Gate()
    term, h, n = Term(family, on, values, gate), 0.001, 1500
    commands = np.sin(np.arange(n) * 0.004)[:, None] * 3.0
    state, given = np.array([[0.3, 0.5], [-1.0, 2.0]]), [values_of(2, **values)]
    chain = Chain(ours, parameters, (term,), "fine", h)
    at, path = state, []
    for k in range(n):
        at = chain.advance(at, commands[[k, k]], given, np.full(2, h), np.full(2, k * h))
        path.append(at)
    held = np.repeat(commands[None], 2, 0)
    made, nothing = rolled(theirs, state, held, term, h=h), rolled(theirs, state, held, h=h)
    dry = family in ("coulomb_friction", "stribeck_friction", "local_friction_patch")
    np.testing.assert_allclose(made, np.stack(path, axis=1), atol=6e-3 if dry else 2e-6)
    assert np.abs(made - nothing).max() > 0.05


def test_dry_friction_holds_and_does_not_creep(tmp_path):
    theirs = load_mjcf(written(tmp_path, PENDULUM))
    load = 1.3 * 9.81 * 0.8 * np.sin(0.3)
    term, state = Term("coulomb_friction", "theta", {"force": load / 0.8}), np.array([[0.3, 0.0]])
    out = rolled(theirs, state, np.zeros((1, 1000, 1)), term, h=0.001)
    assert abs(out[0, -1, 0] - 0.3) < 1e-5


LOAD = '<geom type="sphere" size="1e-4" pos="0.1 0.02 -0.3" mass="0.35" contype="0" conaffinity="0"/>'
ELBOW = '<joint name="elbow" axis="0 1 0" damping="0.02"/>'
TILTED = f'integrator="implicitfast" gravity="{9.81 * np.sin(0.2)} 0 {-9.81 * np.cos(0.2)}"'


@pytest.mark.parametrize(
    ("term", "was", "now"),
    [
        (Term("payload", "lower", {"mass": 0.35, "x": 0.1, "y": 0.02, "z": -0.3}), ELBOW, ELBOW + LOAD),
        (Term("armature", "elbow", {"inertia": 0.05}), 'damping="0.02"', 'damping="0.02" armature="0.05"'),
        (Term("gravity_tilt", "gravity", {"roll": 0.0, "pitch": 0.2}), 'integrator="implicitfast"', TILTED),
        (Term("gravity_compensation", "gravity", {"share": 0.9}), "<body ", '<body gravcomp="0.9" '),
    ],
)
def test_model_effects_are_those_of_a_model_written_so(double, term, was, now):
    state, commands = np.array([[0.4, 0.3, -0.7, 1.1]]), RNG.normal(size=(1, 50, 2))
    out, model = (
        rolled(double, state, commands, term),
        mujoco.MjModel.from_xml_string(DOUBLE.replace(was, now)),
    )
    np.testing.assert_allclose(out[0], one_by_one(model, state[0], commands[0], split), atol=2e-8)
    assert np.abs(out - rolled(double, state, commands)).max() > 1e-4


def test_an_encoders_zero_misleads_its_servo(tmp_path):
    servo = load_mjcf(written(tmp_path, SERVO))
    state, commands = np.zeros((1, 2)), np.full((1, 2000, 1), 0.3)
    term = Term("joint_offset", "hinge", {"offset": 0.1})
    plain, other = (rolled(servo, state, sent)[0, -1, 0] for sent in (commands, commands - 0.1))
    moved = rolled(servo, state, commands, term)[0, -1, 0]
    assert moved == pytest.approx(other, abs=1e-9)
    assert abs(moved - plain) > 0.05


def test_a_gate_in_time_is_the_same_whole_and_substep_by_substep(double):
    """Windows before and after the onset are rolled out at once, the one in which it lies substep by substep."""
    state, _ = random_states(double, 3)
    commands, t = np.zeros((3, 50, 2)), np.array([0.0, 0.5, 1.0])
    gates = (Gate(since=0.55), Gate())
    terms = [Term("viscous_friction", "elbow", {"damping": 0.5}, gate) for gate in gates]
    out, on, free = (rolled(double, state, commands, *some, t=t) for some in (terms[:1], terms[1:], ()))
    np.testing.assert_array_equal(out[0], free[0])
    np.testing.assert_array_equal(out[2], on[2])
    np.testing.assert_array_equal(out[1, :24], free[1, :24])
    assert np.abs(out[1, -1] - free[1, -1]).max() > 1e-3


def test_what_is_added_to_the_rates_accelerates(double):
    state, commands = np.zeros((2, 4)), np.zeros((2, 10, 2))
    weightless = {**double.defaults(), "gravity": 0.0}
    out = double.rolled(
        (), weightless, (), state, commands, np.full(2, 0.002), np.zeros(2), np.tile([0.0, 0.5], (2, 1))
    )
    assert out[0, -1, 3] == pytest.approx(0.01, rel=0.05)  # less what damping takes


def test_looking_back_leads_to_where_it_came_from(double):
    state, commands = np.array([[0.4, 0.3, -0.7, 1.1]]), np.full((1, 40, 2), 0.2)
    ahead = rolled(double.exact(), state, commands)[:, -1]
    back = rolled(double.exact(), ahead, commands, h=-0.002, t=0.08)[:, -1]
    np.testing.assert_allclose(back, state, atol=1e-3)


def test_a_simulation_that_flies_off_is_far_away_and_leaves_no_file(tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    theirs = load_mjcf(written(tmp_path, PENDULUM))
    state = np.array([[0.0, 1e9], [0.1, 0.0]])
    out = rolled(theirs, state, np.zeros((2, 50, 1)), h=0.1)
    assert np.isfinite(out[1]).all()
    assert np.abs(out[1]).max() < 100
    assert np.abs(out[0, -1]).max() >= 1e5
    assert not list(tmp_path.glob("*.TXT"))
    assert "unstable" not in "".join(capfd.readouterr())


def test_it_owns_its_steps_through_all_that_stands_in_for_it(double):
    assert closed(double) is double
    assert isinstance(wrapping(double, Channels.of(double.state.units)), BlackBoxStepper)
    held = reduced(double, {"elbow": 0.3, "elbow_dot": 0.0}, ["elbow"])
    assert isinstance(held, BlackBoxStepper)
    assert held.state.names == ("shoulder", "shoulder_dot")
    out = rolled(held, np.array([[0.5, 0.0]]), np.zeros((1, 200, 2)))
    turned = DOUBLE.replace('pos="0 0 -.5"', 'pos="0 0 -.5" axisangle="0 1 0 17.188733853924695"')
    stiff = mujoco.MjModel.from_xml_string(
        turned.replace(ELBOW, "").replace('<motor name="m2" joint="elbow"/>', "")
    )
    expected = one_by_one(stiff, np.array([0.5, 0.0]), np.zeros((200, 1)), split)
    np.testing.assert_allclose(out[0, -1], expected[-1], atol=1e-6)
    assert closed(make_simulator("cartpole")) is None


def test_a_copy_comes_from_the_same_files(double, tmp_path):
    held = reduced(double, {"elbow": 0.3, "elbow_dot": 0.0}, ["elbow"])
    state, commands = np.array([[0.5, 0.0]]), np.zeros((1, 20, 2))
    for one in (held, held.exact()):
        other = pickle.loads(pickle.dumps(one))
        assert other.state == one.state
        np.testing.assert_array_equal(rolled(other, state, commands), rolled(one, state, commands))
    before = pickle.dumps(double)
    written(tmp_path, DOUBLE.replace('"0.05"', '"0.06"'))
    with pytest.raises(Exception, match="changed during the diagnosis"):
        pickle.loads(before)


@settings(max_examples=30, deadline=None)
@given(st.lists(st.floats(-2, 2), min_size=13 + 2 + 7 * 2 - 1, max_size=28))
def test_plus_and_minus_undo_each_other(tmp_path_factory, numbers):
    floating = load_mjcf(written(tmp_path_factory.getbasetemp(), FLOATING, "floating.xml"))
    numbers = np.array(numbers)
    state = np.zeros((1, len(floating.state)))
    state[0] = numbers[: len(floating.state)]
    quat = [floating.state.index(f"root.q{c}") for c in "wxyz"]
    state[0, quat] += [3.0, 0, 0, 0]
    state[0, quat] /= np.linalg.norm(state[0, quat])
    change = np.zeros((1, 14))
    change[0, :13] = numbers[-13:]
    back = floating.minus(floating.plus(state, change), state)
    angle = np.linalg.norm(change[0, 3:6])
    if angle < np.pi - 1e-3:
        np.testing.assert_allclose(back, change, atol=1e-8)


def turned(axis, angle):
    return np.array([np.cos(angle / 2), *(np.sin(angle / 2) * np.asarray(axis))])


def test_a_gap_between_orientations_is_half_the_turn_between_them(tmp_path):
    floating = load_mjcf(written(tmp_path, FLOATING))
    said = np.tile(floating.rest_state, (3, 1))
    said[:, 3:7] = turned([0.6, 0.0, 0.8], 1.1)
    measured = np.array(said)
    data_turn = turned([0.0, 1.0, 0.0], 0.02)
    w, x, y, z = said[0, 3:7]
    a, b, c, d = data_turn
    product = [w * a - x * b - y * c - z * d, w * b + x * a + y * d - z * c, w * c - x * d + y * a + z * b]
    measured[1, 3:7] = [*product, w * d + x * c - y * b + z * a]
    measured[2, 3:7] = -measured[1, 3:7]
    gap = floating.state_error(measured, said)
    assert gap[0] == pytest.approx(0.0, abs=1e-12)
    for row in gap[1:]:
        assert row[3:7] == pytest.approx([0.0, 0.0, np.sin(0.01), 0.0], abs=1e-12)
    change = np.zeros((1, 2 * 7))
    change[0, 3:6] = [0.01, -0.02, 0.015]
    moved = floating.plus(said[:1], change)
    assert 2.0 * floating.state_error(moved, said[:1])[0, 4:7] == pytest.approx(
        [0.01, -0.02, 0.015], rel=1e-3
    )


def test_of_a_free_joint_what_acts_along_its_axes_is_asked(tmp_path):
    floating = load_mjcf(written(tmp_path, FLOATING))
    places = {
        (f, on) for f, effect in FAMILIES.items() for on in effect.places(floating) if on.startswith("root")
    }
    along = ("surge", "sway", "heave", "roll", "pitch", "yaw")
    asked = {(f, f"root.{a}") for f in ("viscous_friction", "quadratic_drag") for a in along}
    asked |= {("constant_force", f"root.{a}") for a in ("x", "y", "z", "roll", "pitch", "yaw")}
    assert places == asked


@pytest.mark.parametrize("load", [0.0, 0.7])
def test_the_force_that_is_lacking_is_what_inverse_dynamics_say(double, load):
    """Of a model that carries the load."""
    state, action = random_states(double, 5, np.random.default_rng(8))
    acceleration = np.random.default_rng(9).normal(size=(5, 2))
    terms = [Term("payload", "lower", {"mass": load, "x": 0.1, "y": -0.05, "z": -0.3})] if load else []
    lacking = double.lacking_force(state, action, acceleration, double.defaults(), terms)
    spec = mujoco.MjSpec.from_string(DOUBLE)
    if load:
        spec.body("lower").add_geom(
            pos=[0.1, -0.05, -0.3], size=[1e-3, 0, 0], mass=load, contype=0, conaffinity=0
        )
    model = spec.compile()
    data = mujoco.MjData(model)
    for s, a, acc, force in zip(state, action, acceleration, lacking, strict=True):
        data.qpos[:], data.qvel[:] = split(s)
        data.qacc[:] = acc
        mujoco.mj_inverse(model, data)
        assert force == pytest.approx(data.qfrc_inverse - a, rel=1e-5, abs=1e-6 if load else 1e-9)
