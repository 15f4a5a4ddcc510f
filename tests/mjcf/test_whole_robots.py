"""Robots whose every joint rubs: speeds from positions, slopes that learn, and an account of rows asked all at once."""

from dataclasses import replace
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest
import yaml
from mjcf_models import DOUBLE, written

from gpsim.diagnosis.fitting import Hypothesis, Problem, child_of, fit, is_row, scores
from gpsim.diagnosis.fitting.descent import Descent
from gpsim.diagnosis.run import Run
from gpsim.diagnosis.selection import usual_machine, whole_robot
from gpsim.diagnosis.selection.refit import _pardoned
from gpsim.diagnosis.setup import by_inverse_dynamics, is_structure, offers_of, prepare
from gpsim.diagnosis.setup.guesses import speed_of
from gpsim.effects import effect_of
from gpsim.stages.diagnose import Task, open_recording

NOISE, DT, SAMPLES = 5e-4, 0.02, 300
DRY, VISCOUS, ROTOR = (0.3, 0.15), (0.2, 0.1), (0.03, 0.01)


LOAD, AT = 0.3, (0.04, 0.0, -0.35)  # kg, m in the lower link's frame


def _logged(folder, *, load=0.0, late=0, lost=(), held=0.0):
    """A double pendulum with friction and rotors at both joints, positions only; the question and the true speeds.

    load: kg at AT of the lower link; late: samples by which commands come late; lost: rows of every episode; held: the
    share of gravity that a controller makes up for.
    """
    spec = mujoco.MjSpec.from_string(DOUBLE)
    if load:
        spec.body("lower").add_geom(pos=AT, size=[1e-4, 0, 0], mass=load, contype=0, conaffinity=0)
    for body in spec.bodies[1:]:
        body.gravcomp = held
    rng, model = np.random.default_rng(3), spec.compile()
    model.opt.timestep /= 4
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    for i in range(2):
        model.dof_frictionloss[i] = DRY[i]
        model.dof_solref[i] = (-1.0, -2.0 / model.opt.timestep)
        model.dof_solimp[i] = (0.9999, 0.9999, 0.001, 0.5, 2.0)
        model.dof_damping[i] += VISCOUS[i]
        model.dof_armature[i] += ROTOR[i]
    data, rows, speeds = mujoco.MjData(model), ["episode,t,shoulder,elbow,m1,m2"], []
    mujoco.mj_setConst(model, data)
    for e in range(3):
        mujoco.mj_resetData(model, data)
        data.qpos[:] = 0.3 * rng.normal(size=2)
        tones, phases = rng.uniform(0.2, 1.5, (2, 5)), rng.uniform(0, 6.3, (2, 5))
        waves = [np.sin(2 * np.pi * tones * DT * k + phases).sum(axis=1) for k in range(SAMPLES)]
        commands = np.array([3.0, 1.0]) * waves
        for k in range(SAMPLES):
            data.ctrl[:] = commands[max(k - late, 0)]
            q = data.qpos + NOISE * rng.normal(size=2)
            if k not in lost:
                rows.append(f"{e},{DT * k:.3f}," + ",".join(f"{v:.7f}" for v in (*q, *commands[k])))
            speeds.append(np.array(data.qvel))
            mujoco.mj_step(model, data, round(DT / model.opt.timestep))
    (folder / "recording.csv").write_text("\n".join(rows) + "\n")
    meta = {"system": "mjcf", "model": "robot.xml", "dt": DT, "state": {"shoulder": "rad", "elbow": "rad"}}
    meta |= {"action": {"m1": "N m", "m2": "N m"}, "noise": {"shoulder": NOISE, "elbow": NOISE}}
    (folder / "recording.yaml").write_text(yaml.safe_dump(meta))
    written(folder, DOUBLE)
    recording, simulator = open_recording(Task(folder, None))
    return prepare(recording, simulator, simulator.defaults(), Run()), np.array(speeds).reshape(3, SAMPLES, 2)


@pytest.fixture(scope="module")
def rubbing(tmp_path_factory):
    """Friction and rotors alone."""
    return _logged(tmp_path_factory.mktemp("rubbing"))


def test_a_speed_is_taken_over_as_many_samples_as_noise_asks_for():
    t = DT * np.arange(400)
    path, true = np.sin(3 * t), 3 * np.cos(3 * t)
    clean = speed_of(path, t, 1e-9)
    noisy = path + 2e-3 * np.random.default_rng(0).normal(size=len(t))
    told, guessed = speed_of(noisy, t, 2e-3), speed_of(noisy, t)
    naive = np.gradient(noisy, t)
    assert np.abs(clean - true)[1:-1].max() < 0.01
    for found in (told, guessed):
        assert np.sqrt(np.mean((found - true) ** 2)) < 0.4 * np.sqrt(np.mean((naive - true) ** 2))


def test_speeds_that_nobody_measured_are_near_the_truth_though_the_base_lacks_much(rubbing):
    question, speeds = rubbing
    names = question.everything.simulator.state.names
    columns = [names.index(n) for n in ("shoulder_dot", "elbow_dot")]
    for episode, true in zip(question.recording.episodes, speeds, strict=True):
        off = episode.states[2:-2, columns] - true[2:-2]
        assert (np.sqrt(np.mean(off**2, axis=0)) < 0.05 * true.std(axis=0)).all()


def _row(offers, family, on, value):
    (candidate,) = [c for c in offers if (c.family, c.place.on, c.variant) == (family, on, "")]
    return candidate, (value,)


def _frictions(question, at):
    offers, account = offers_of(question), Hypothesis()
    for i, on in enumerate(("shoulder", "elbow")):
        account = child_of(account, *_row(offers, "coulomb_friction", on, at * DRY[i]))
        account = child_of(account, *_row(offers, "viscous_friction", on, at * VISCOUS[i]))
        account = child_of(account, *_row(offers, "armature", on, at * ROTOR[i]))
    return account


def test_slopes_that_learn_from_steps_end_nearer_in_as_many(rubbing, monkeypatch):
    problem: Problem = replace(rubbing[0].searched, dry_steps={})
    account, starts = _frictions(rubbing[0], 0.3), rubbing[0].searched.windows.measured[:, 0]
    learnt = fit(problem, account, starts, iterations=5)
    monkeypatch.setattr(Descent, "_learn", lambda *_: None)
    assert learnt.objective < fit(problem, account, starts, iterations=5).objective


def _begun(question):
    """What the best account of the usual machine says, its sizes by family and place."""
    path = usual_machine(question, offers_of(question))
    best = path[int(np.argmax(scores(question.searched, path)))]
    return {(t.family, on): next(iter(t.values.values())) for t in best.hypothesis.terms for on in t.places}


def test_inverse_dynamics_size_all_rows_within_their_bounds_and_without_a_simulation(rubbing):
    question = rubbing[0]
    found = by_inverse_dynamics(question.searched, question.recording, _frictions(question, 0.0))
    theta, low = found.theta, [p.low for p in found.parameters]
    assert theta == pytest.approx(_frictions(question, 1.0).theta, rel=0.35)
    assert (theta >= low).all()


@pytest.mark.slow
def test_inverse_dynamics_find_a_load_and_how_late_commands_come_though_rows_are_lost(tmp_path):
    """Of a log whose samples are not all there; a load at its place, the links' own masses left as they are."""
    question = _logged(tmp_path, load=LOAD, late=1, lost=range(40, SAMPLES, 37))[0]
    offers, rows = offers_of(question), _frictions(question, 0.0)
    others, delays = (
        [c for c in offers if is_structure(c)],
        [c for c in offers if c.family == "actuator_delay"],
    )
    found = by_inverse_dynamics(question.searched, question.recording, rows, others, delays)
    said = {(t.family, on): t.values for t in found.terms for on in t.places}
    load = said["payload", "lower"]
    assert load["mass"] == pytest.approx(LOAD, rel=0.1)
    assert (load["x"], load["z"]) == pytest.approx((AT[0], AT[2]), abs=0.02)
    assert all(said["actuator_delay", m]["delay"] == pytest.approx(DT, rel=0.15) for m in ("m1", "m2"))
    assert {"parameter_offset", "actuator_gain"}.isdisjoint(family for family, _ in said)


@pytest.mark.slow
def test_inverse_dynamics_claim_neither_loads_nor_late_commands_of_what_has_none(rubbing):
    question = rubbing[0]
    offers, rows = offers_of(question), _frictions(question, 0.0)
    others, delays = (
        [c for c in offers if is_structure(c)],
        [c for c in offers if c.family == "actuator_delay"],
    )
    found = by_inverse_dynamics(question.searched, question.recording, rows, others, delays)
    assert found.claims == rows.claims


@pytest.mark.slow
def test_inverse_dynamics_find_that_a_controller_makes_up_for_gravity(tmp_path):
    """By MuJoCo's own gravity compensation; no mass, gain or load stands for it."""
    question = _logged(tmp_path, held=0.95)[0]
    offers, rows = offers_of(question), _frictions(question, 0.0)
    others = [c for c in offers if is_structure(c)]
    found = by_inverse_dynamics(question.searched, question.recording, rows, others, ())
    said = {(t.family, t.on): t.values for t in found.terms}
    assert said.pop(("gravity_compensation", "gravity")) == {"share": pytest.approx(0.95, abs=0.03)}
    assert said.keys() == rows.claims
    child = child_of(Hypothesis(), *_row(offers, "gravity_compensation", "gravity", 0.95))
    starts = question.searched.windows.measured[None, :, 0]
    bare, told = (
        np.square(question.searched.residuals(h, h.theta[None], starts)).mean() for h in (Hypothesis(), child)
    )
    assert told < bare


def test_what_is_no_row_of_a_joint_is_not_sized_by_inverse_dynamics(rubbing):
    question = rubbing[0]
    heavy = _row(offers_of(question), "parameter_offset", "lower.mass", 1.1)
    assert by_inverse_dynamics(question.searched, question.recording, child_of(Hypothesis(), *heavy)) is None


@pytest.mark.slow  # beside a mass, and beside late commands, it is shown below
def test_the_start_finds_friction_and_rotor_of_both_joints_with_their_sizes(rubbing):
    said = _begun(rubbing[0])
    for i, on in enumerate(("shoulder", "elbow")):
        assert said["coulomb_friction", on] == pytest.approx(DRY[i], rel=0.15)
        assert said["viscous_friction", on] == pytest.approx(VISCOUS[i], rel=0.15)
        assert said["armature", on] == pytest.approx(ROTOR[i], rel=0.15)


@pytest.mark.slow
def test_the_start_finds_a_mass_beside_friction_of_both_joints(rubbing):
    question = rubbing[0]
    wrong = dict(question.searched.parameters)
    wrong["lower.mass"] *= 1.4
    said = _begun(replace(question, searched=replace(question.searched, parameters=wrong)))
    assert said["parameter_offset", "lower.mass"] == pytest.approx(1 / 1.4, rel=0.03)
    for i, on in enumerate(("shoulder", "elbow")):
        assert said["coulomb_friction", on] == pytest.approx(DRY[i], rel=0.15)


def test_rows_of_joints_are_one_machine_and_a_mass_beside_two_of_them_is_not(rubbing):
    question, account = rubbing[0], _frictions(rubbing[0], 1.0)
    three = account
    for index in (5, 4, 3):
        three = three.without(index)
    heavy, _ = _row(offers_of(question), "parameter_offset", "lower.mass", 1.1)
    mixed = child_of(three.without(2), heavy, (1.1,))
    assert whole_robot(question.everything, account)
    assert whole_robot(question.everything, three)
    assert not whole_robot(question.everything, mixed)
    assert [is_row(effect_of(f)) for f in ("viscous_friction", "armature", "parameter_offset")] == [
        True,
        True,
        False,
    ]


def test_held_out_windows_veto_a_whole_robot_only_where_they_say_as_much_as_a_part_of_what_it_gains(rubbing):
    problem, account = rubbing[0].everything, _frictions(rubbing[0], 1.0)
    null = SimpleNamespace(hypothesis=Hypothesis(), objective=1000.0)
    robot = SimpleNamespace(hypothesis=account, objective=-1000.0)
    single = SimpleNamespace(
        hypothesis=account.without(5).without(4).without(3).without(2).without(1), objective=-1000.0
    )
    assert _pardoned(problem, robot, null) == pytest.approx(100.0)
    assert _pardoned(problem, single, null) == 0.0


@pytest.mark.slow
def test_the_start_finds_commands_that_are_all_late_beside_friction_of_both_joints(rubbing):
    question = rubbing[0]
    # What was logged was given a sample before it acted.
    episodes = tuple(
        replace(e, t=e.t[:-1], states=e.states[:-1], actions=e.actions[1:])
        for e in question.recording.episodes
    )
    recording = replace(question.recording, episodes=episodes, velocities="differentiated")
    simulator = question.whole
    said = _begun(prepare(recording, simulator, simulator.defaults(), Run()))
    for i, (on, command) in enumerate((("shoulder", "m1"), ("elbow", "m2"))):
        assert said["actuator_delay", command] == pytest.approx(DT, rel=0.2)
        assert said["coulomb_friction", on] == pytest.approx(DRY[i], rel=0.15)
