"""Of a simulator that owns its steps: how finely dry friction is stepped, and how long a window is."""

from functools import cache

import mujoco
import numpy as np
import pytest
from mjcf_models import GRAVITY, LENGTH, MASS, PENDULUM, SLIDER, written
from scipy.linalg import expm

from gpsim.diagnosis.fitting import Hypothesis, fit, growth, numerical_error
from gpsim.diagnosis.setup.offers import offers_of
from gpsim.diagnosis.setup.prepare import prepare
from gpsim.effects import Term
from gpsim.mjcf import load_mjcf
from gpsim.recordings import Episode, Recording
from gpsim.stages.diagnose import Task, open_recording

DT, FORCE = 0.02, 0.4
COARSE = SLIDER.replace('timestep="0.001"', f'timestep="{DT}"')


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A question, made once, of the function that makes it and of what that is told."""
    return cache(lambda how, *told: how(tmp_path_factory.mktemp("made"), *told))


def slid(x, v, push):
    """Where a body under a push and dry friction is after DT: in closed form, with the moment at which it stops."""
    left = DT
    while left > 0.0:
        if v == 0.0 and abs(push) <= FORCE:
            return x, 0.0
        against = np.sign(v) if v else np.sign(push)
        a = (push - FORCE * against) / MASS
        stops = -v / a if v * a < 0.0 else np.inf
        step = min(left, stops)
        x, v, left = x + v * step + a * step**2 / 2, v + a * step, left - step
        v = 0.0 if step == stops else v
    return x, v


def rubbed(folder, noise):
    """The question of a recording of such a body, to a model that steps as coarsely as the recording."""
    simulator, rng = load_mjcf(written(folder, COARSE)), np.random.default_rng(1)
    episodes = []
    for name in "abcdef":
        pushes = np.repeat(rng.uniform(-1.2, 1.2, 30), 4)
        states = [(0.0, float(rng.normal()))]
        for push in pushes:
            states.append(slid(*states[-1], push))
        read = np.array(states) + noise * rng.normal(size=(len(states), 2))
        episodes.append(Episode(name, DT * np.arange(len(states)), read, pushes[:, None]))
    recording = Recording(
        "mjcf", simulator.state, simulator.action, tuple(episodes), DT, velocities="measured",
        noise=dict.fromkeys(simulator.state.names, noise),
    )  # fmt: skip
    return prepare(recording, simulator, simulator.defaults())


def friction(question):
    rubs = next(c for c in offers_of(question) if c.family == "coulomb_friction")
    return Hypothesis((Term(rubs.family, rubs.place.on, {"force": FORCE}),), (rubs.declared,))


def test_dry_friction_is_stepped_until_its_stops_are_less_than_the_noise(made):
    problem = made(rubbed, 1e-4).searched
    assert problem.dry_steps == {"q": 6}
    true, starts = friction(made(rubbed, 1e-4)), problem.windows.measured[None, :, 0]
    fine = problem.residuals(true, true.theta[None], starts)
    rough = problem.slopes.residuals(true, true.theta[None], starts)
    read = np.sqrt(2.0) * 1e-4  # a sample's noise, and that of the start
    assert np.sqrt(np.mean(fine**2)) < 1.2 * read
    assert np.sqrt(np.mean(rough**2)) > 2.5 * read


def test_what_noise_hides_is_not_stepped_finely(made):
    assert made(rubbed, 0.1).searched.dry_steps == {}


def test_nothing_else_is_stepped_finely(made):
    problem = made(rubbed, 1e-4).searched
    smooth = Hypothesis().chain(problem.simulator, problem.parameters, problem.dt)
    assert problem.steps(smooth) == problem.substeps
    rubs = friction(made(rubbed, 1e-4)).chain(problem.simulator, problem.parameters, problem.dt)
    assert problem.steps(rubs) == 6 * problem.substeps
    assert problem.slopes.steps(rubs) == problem.slopes.substeps


def swung(folder, rest, dt=0.05):
    """The question of a pendulum near a rest: 0 hangs, pi stands; what it does is the model's."""
    simulator, rng = load_mjcf(written(folder, PENDULUM)), np.random.default_rng(2)
    t, rate = dt * np.arange(20), np.sqrt(GRAVITY / LENGTH)
    episodes = []
    for name in "abcdefgh":
        a, b = 1e-3 * rng.normal(size=2)
        if rest:
            aside = np.stack([a * np.cosh(rate * t) + b * np.sinh(rate * t), np.zeros_like(t)], axis=1)
            aside[:, 1] = rate * (a * np.sinh(rate * t) + b * np.cosh(rate * t))
        else:
            aside = np.stack([a * np.cos(rate * t), -rate * a * np.sin(rate * t)], axis=1)
        aside[:, 0] += rest
        episodes.append(Episode(name, t, aside, np.zeros((19, 1))))
    recording = Recording(
        "mjcf", simulator.state, simulator.action, tuple(episodes), dt, velocities="measured"
    )
    return prepare(recording, simulator, simulator.defaults())


def test_windows_of_what_falls_are_short(made):
    falls, hangs = made(swung, np.pi), made(swung, 0.0)
    assert hangs.everything.windows.length == 19
    assert 5 <= falls.everything.windows.length < 19


def test_growth_is_that_of_a_falling_pole(made):
    problem = made(swung, np.pi).everything
    grown = growth(problem, Hypothesis())
    assert grown[0] == pytest.approx(1.0)
    rate = np.sqrt(GRAVITY / LENGTH)
    later = grown[-1] / grown[-3]
    assert later == pytest.approx(np.exp(2 * 0.05 * rate), rel=0.05)
    assert grown[-1] < 10.0 * np.exp(0.05 * rate)


NOISE = 2e-5


def tracked(folder, dt):
    """The question of a light link that a stiff servo moves along waves, in closed form; and its model's step."""
    inertia, stiff, damped = 0.005, 400.0, 5.0
    xml = f"""<mujoco><option timestep="0.002" integrator="implicitfast" gravity="0 0 0"/><worldbody><body name="link">
    <inertial pos="0 0 0" mass="1" diaginertia="{inertia} {inertia} {inertia}"/><joint name="q" axis="0 0 1"/></body>
    </worldbody><actuator><position name="servo" joint="q" kp="{stiff}" kv="{damped}"/></actuator></mujoco>"""
    simulator, rng = load_mjcf(written(folder, xml)), np.random.default_rng(3)
    once = expm(dt * np.array([[0.0, 1.0], [-stiff / inertia, -damped / inertia]]))
    episodes = []
    for name in "abcdef":
        t = dt * np.arange(round(1.5 / dt))
        waves = rng.normal(size=(4, 2)) / np.arange(1, 5)[:, None]
        command = sum(0.2 * a * np.sin(2.0 * k * t + b) for k, (a, b) in enumerate(waves, 1))
        states = [np.array([command[0], 0.0])]
        for u in command[:-1]:
            there = np.array([u, 0.0])
            states.append(there + once @ (states[-1] - there))
        read = np.array(states) + NOISE * rng.normal(size=(len(t), 2)) * [1.0, 100.0]
        episodes.append(Episode(name, t, read, command[:-1, None]))
    recording = Recording(
        "mjcf", simulator.state, simulator.action, tuple(episodes), dt, velocities="measured",
        noise={"q": NOISE, "q_dot": 100.0 * NOISE},
    )  # fmt: skip
    return prepare(recording, simulator, simulator.defaults())


def test_a_stiff_servo_of_a_light_link_is_stepped_more_exactly_than_the_model_says(made):
    problem = made(tracked, 0.01).searched
    assert not problem.simulator.own_grid  # by a method of higher order
    assert problem.floor[0] < 1.5 * NOISE


def test_commands_of_a_stiff_servo_are_not_averaged(made):
    question = made(tracked, 0.005)
    assert question.thinned == 1
    nothing, problem = Hypothesis(), question.searched
    left = fit(problem, nothing, problem.windows.measured[:, 0]).residuals
    assert np.sqrt(np.mean(left[..., 0] ** 2)) < 1.2 * NOISE


def test_commands_of_a_motor_are_averaged_on_a_fast_clock(tmp_path):
    simulator, t = load_mjcf(written(tmp_path, SLIDER)), 0.005 * np.arange(400)
    x = np.stack([np.sin(2.0 * t), 2.0 * np.cos(2.0 * t)], axis=1)
    push = -4.0 * MASS * np.sin(2.0 * t[:-1, None])
    episodes = tuple(Episode(name, t, x, push) for name in "abcd")
    recording = Recording("mjcf", simulator.state, simulator.action, episodes, 0.005, velocities="measured")
    assert prepare(recording, simulator, simulator.defaults()).thinned == 2


WRIST = """<mujoco><option timestep="0.002"/><worldbody><body>
<joint name="elbow" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.02" mass="1"/>
<body pos="0 0 -0.3"><joint name="wrist" axis="0 1 0"/>
<inertial pos="0.004 0 0" mass="0.02" diaginertia="1e-6 1e-6 1e-6"/></body></body></worldbody>
<actuator><motor name="u" joint="elbow"/><motor name="w" joint="wrist"/></actuator></mujoco>"""
ROTOR, RUBS = 0.02, 0.1


def turned(folder):
    """The question of a log of an arm whose light wrist has a rotor and friction, which the model lacks."""
    model, rng = mujoco.MjModel.from_xml_string(WRIST), np.random.default_rng(4)
    model.dof_armature[1], model.dof_damping[1] = ROTOR, RUBS
    model.opt.integrator, model.opt.timestep = mujoco.mjtIntegrator.mjINT_RK4, 0.001
    data, rows, t = mujoco.MjData(model), ["t,elbow,wrist,elbow_dot,wrist_dot,u,w"], 0.01 * np.arange(2000)
    tones, phases = rng.uniform(0.3, 1.2, (2, 3)), rng.uniform(0.0, 6.3, (2, 3))
    pushes = np.array([1.0, 0.1]) * np.sin(2 * np.pi * tones * t[:, None, None] + phases).sum(axis=2)
    for now, push in zip(t, pushes, strict=True):
        read = np.concatenate([data.qpos, data.qvel]) + 1e-5 * rng.normal(size=4)
        rows.append(",".join(f"{v:.7f}" for v in (now, *read, *push)))
        data.ctrl[:] = push
        mujoco.mj_step(model, data, 10)
    (folder / "log.csv").write_text("\n".join(rows) + "\n")
    recording, simulator = open_recording(Task(folder / "log.csv", written(folder, WRIST)))
    return prepare(recording, simulator, simulator.defaults(recording.parameters))


def test_a_wrist_that_whirls_in_the_base_alone_hides_nothing_behind_a_numerical_error(made):
    problem = made(turned).everything
    wrist = problem.simulator.state.names.index("wrist")
    assert numerical_error(problem)[wrist] > 0.1 * problem.scale[wrist]
    assert problem.floor[wrist] < 1e-3 * problem.scale[wrist]
    assert problem.windows.length == 25
