"""Actuators with an activation of their own, MuJoCo itself as the oracle: steps, what is known before windows, export."""

import mujoco
import numpy as np
import pytest
from mjcf_models import LINK, logged, written
from test_export_model import exported, native, replayed, robot_of

from gpsim.diagnosis import diagnose
from gpsim.diagnosis.data import at
from gpsim.diagnosis.fitting import Hypothesis, simulate
from gpsim.diagnosis.run import Run
from gpsim.effects import Chain, Term, closed
from gpsim.errors import UsageError
from gpsim.mjcf import load_mjcf
from gpsim.recordings import Episode, Recording
from gpsim.stages.diagnose import Task, open_recording

DT, STEPS = 0.02, 10
KINDS = {
    "filter": '<general name="m" joint="j" dyntype="filter" dynprm="0.06"/>',
    "exact filter": '<general name="m" joint="j" dyntype="filterexact" dynprm="0.06" actearly="true"/>',
    "slow servo": '<position name="m" joint="j" kp="9" kv="0.6" timeconst="0.08"/>',
    "integrator": '<intvelocity name="m" joint="j" kp="20" kv="1" actrange="-0.9 0.9"/>',
    "current": '<dcmotor name="m" joint="j" motorconst="0.5 0.5" resistance="0.5" inductance="0.001 0"/>',
}


def _text(actuator):
    return f"""<mujoco><option timestep="0.002" integrator="implicitfast"/><worldbody>
<body><joint name="j" axis="0 1 0" damping="0.1"/>{LINK.format(0.4, 0.6)}</body></worldbody>
<actuator>{actuator}</actuator></mujoco>"""


def _commands(count, seed=5):
    return np.repeat(np.random.default_rng(seed).uniform(-1.0, 1.0, count // 5), 5)[:, None]


def _by_mujoco(text, sent):
    """(K + 1, 2) states and (K + 1, na) activations at the ends of control steps, from rest."""
    model = mujoco.MjModel.from_xml_string(text)
    data, out, acts = mujoco.MjData(model), [np.zeros(2)], [np.zeros(model.na)]
    for command in sent:
        data.ctrl[:] = command
        mujoco.mj_step(model, data, nstep=STEPS)
        out.append(np.concatenate([data.qpos, data.qvel]))
        acts.append(np.array(data.act))
    return np.array(out), np.array(acts)


@pytest.mark.parametrize("kind", KINDS)
def test_it_steps_as_mujoco_does_and_hands_the_activation_on(tmp_path, kind):
    simulator, sent = load_mjcf(written(tmp_path, _text(KINDS[kind]))), _commands(40)
    chain = Chain(simulator, simulator.defaults(), (), "fine", DT)
    memory, state, step = chain.unbent(1), np.zeros((1, 2)), np.array([DT / STEPS])
    states, acts = _by_mujoco(_text(KINDS[kind]), sent)
    for command, wanted, act in zip(sent, states[1:], acts[1:], strict=True):
        held = np.full((1, STEPS, 1), command)
        state = chain.rolled(closed(simulator), state, held, (), step, np.zeros(1), None, memory)[:, -1]
        np.testing.assert_allclose(state[0], wanted, atol=1e-9)
        np.testing.assert_allclose(memory["activations"][0], act, atol=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_windows_begin_with_what_the_commands_before_made(tmp_path, kind):
    simulator, sent = load_mjcf(written(tmp_path, _text(KINDS[kind]))), _commands(300)
    states, _ = _by_mujoco(_text(KINDS[kind]), sent)
    episode = Episode("0", DT * np.arange(len(states)), states, sent)
    recording = Recording("mjcf", simulator.state, simulator.action, (episode,), DT, {})
    places, length = [(0, k) for k in (0, 3, 40, 150, 270)], 20
    windows = at(recording, places, length)
    chain = Hypothesis().chain(simulator, simulator.defaults(), DT)
    starts = windows.measured[None, :, 0]
    said = simulate(Run(), chain, windows, starts, Hypothesis().spread, np.empty((1, 0)), STEPS)[0]
    size = states.std(axis=0)
    # A current begins where it would stay: the first milliseconds after a step of the command are lost.
    assert (np.abs(said - windows.measured) / size).max() < (0.06 if kind == "current" else 0.02)


@pytest.mark.parametrize("kind", ["filter", "exact filter", "slow servo"])
def test_longer_steps_of_higher_order_are_as_slow_as_the_model(tmp_path, kind):
    text = _text(KINDS[kind])
    simulator, sent = load_mjcf(written(tmp_path, text)).exact(), _commands(30)
    held, memory = np.repeat(sent, 2, axis=0)[None], {"activations": np.zeros((1, 1))}
    found = simulator.rolled(
        (), {}, (), np.zeros((1, 2)), held, np.array([DT / 2]), np.zeros(1), None, memory
    )
    fine, _ = _by_mujoco(text.replace('timestep="0.002"', 'timestep="0.0002"'), np.repeat(sent, 10, axis=0))
    assert np.abs(found[0, 1::2] - fine[10::10]).max() < 0.02


@pytest.mark.parametrize("kind", KINDS)
def test_the_exported_model_keeps_it(tmp_path, kind):
    terms = [Term("actuator_gain", "m", {"gain": 0.8}), Term("coulomb_friction", "j", {"force": 0.03})]
    if kind != "integrator":
        terms.append(Term("actuator_delay", "m", {"delay": 0.013}))
    plant, made = exported(tmp_path, _text(KINDS[kind]), terms, dt=DT)
    assert {e["family"]: e["where"] for e in made.effects}["actuator_gain"] == "wrapper"
    start, sent, robot = np.array([0.3, 0.0]), _commands(50), robot_of(made)()
    robot.reset(start[:1], start[1:])
    found = []
    for command in sent:
        robot.step(command)
        found.append(np.concatenate(robot.measured()))
    np.testing.assert_allclose(found, replayed(plant, start, sent), atol=1e-6)


def test_without_effects_the_exported_model_alone_is_the_robot(tmp_path):
    plant, made = exported(
        tmp_path, _text(KINDS["filter"]), [Term("armature", "j", {"inertia": 0.01})], dt=DT
    )
    sent = _commands(50)
    np.testing.assert_allclose(
        native(made, np.zeros(2), sent, STEPS), replayed(plant, np.zeros(2), sent), atol=1e-6
    )


@pytest.mark.parametrize(
    "actuator",
    [
        '<muscle name="m" joint="j" lengthrange="0 1"/>',
        '<dcmotor name="m" joint="j" motorconst="0.5 0.5" resistance="1" lugre="1 1 1 1 1"/>',
    ],
)
def test_what_no_command_tells_is_refused_in_one_line(tmp_path, actuator):
    with pytest.raises(UsageError, match="m has an activation that the commands do not determine"):
        load_mjcf(written(tmp_path, _text(actuator)))


@pytest.mark.slow
def test_a_servo_with_a_filter_is_diagnosed(tmp_path):
    """Dry friction and half a weight more are missing, and the filter is no lag that is."""
    text, rng = _text(KINDS["slow servo"]), np.random.default_rng(3)
    model = mujoco.MjModel.from_xml_string(text)
    model.opt.timestep, model.dof_frictionloss[:] = 0.0005, 0.1
    model.dof_solref[:], model.dof_solimp[:] = (-1.0, -4000.0), (0.9999, 0.9999, 0.001, 0.5, 2.0)
    data, rows = mujoco.MjData(model), []
    t = DT * np.arange(2000)
    sent = sum(0.25 * np.sin(w * t + p) for w, p in rng.uniform([0.5, 0.0], [9.0, 6.3], (6, 2)))
    for k, command in enumerate(sent):
        rows.append((0, k * DT, data.qpos[0] + 1e-4 * rng.normal(), command))
        data.ctrl[:] = command
        mujoco.mj_step(model, data, nstep=40)
    logged(tmp_path, text, rows, DT, {"j": "rad"}, {"m": "rad"}, noise={"j": 1e-4})
    recording, simulator = open_recording(Task(tmp_path, None))
    said = diagnose(recording, simulator, simulator.defaults(), np.random.default_rng(0)).diagnosis
    found = {e.family: e.parameters for e in said.effects}
    assert said.verdict == "named"
    assert found["coulomb_friction"]["force"].value == pytest.approx(0.1, rel=0.05)
    assert "actuator_lag" not in found
    assert "actuator_delay" not in found
