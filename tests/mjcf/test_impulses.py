"""What is spared where steps are dear: functions told by pushes, finer grids that could tell nothing."""

from dataclasses import replace
from importlib import import_module

import mujoco
import numpy as np
import pytest
import yaml
from mjcf_models import DOUBLE, written

from gpsim.diagnosis.attribution import judges
from gpsim.diagnosis.fitting import Directions, Hypothesis, Pushes, fit
from gpsim.diagnosis.selection.grid_check import _grid_matters
from gpsim.diagnosis.setup import offers_of, prepare
from gpsim.effects import closed
from gpsim.stages.diagnose import Task, open_recording

DT = 0.01
lack_of_fit = import_module(
    "gpsim.diagnosis.selection.lack_of_fit"
)  # the room offers a function of that name


def question(folder):
    """A double pendulum with drag on the elbow that the model lacks, joints and speeds measured."""
    rng, model = np.random.default_rng(3), mujoco.MjModel.from_xml_string(DOUBLE)
    data, rows = mujoco.MjData(model), ["episode,t,shoulder,shoulder_dot,elbow,elbow_dot,m1,m2"]
    for e in range(4):
        mujoco.mj_resetData(model, data)
        data.qpos[:] = rng.normal(size=2)
        for k in range(80):
            push = 0.8 * np.sin(0.13 * k + np.array([e, 2.0 * e]))
            read = [*np.ravel(np.stack([data.qpos, data.qvel], axis=1)) + 1e-4 * rng.normal(size=4), *push]
            rows.append(f"{e},{DT * k:.3f}," + ",".join(f"{v:.7f}" for v in read))
            data.ctrl[:] = push
            for _ in range(5):
                data.qfrc_applied[1] = -0.02 * abs(data.qvel[1]) * data.qvel[1]
                mujoco.mj_step(model, data)
    (folder / "recording.csv").write_text("\n".join(rows) + "\n")
    state = {"shoulder": "rad", "shoulder_dot": "rad/s", "elbow": "rad", "elbow_dot": "rad/s"}
    meta = {"system": "mjcf", "model": "robot.xml", "dt": DT, "state": state, "velocities": "measured"}
    (folder / "recording.yaml").write_text(yaml.safe_dump({**meta, "action": {"m1": "N m", "m2": "N m"}}))
    written(folder, DOUBLE)
    recording, simulator = open_recording(Task(folder, None))
    return prepare(recording, simulator, simulator.defaults())


def test_a_function_answers_as_the_sum_of_its_pushes(tmp_path):
    problem = question(tmp_path).searched
    at = fit(problem, Hypothesis(scheme="fine"), problem.windows.measured[:, 0], iterations=4)
    directions = Directions(problem, at)
    single = lack_of_fit._single(problem)
    groups = [g for g in single if g.rate == 1][:4]
    groups += (
        lack_of_fit._double(problem, single, [1.0] * len(single))[-2:] + lack_of_fit._remembering(problem)[:1]
    )
    rest = directions.rest.ravel()
    told = lack_of_fit._all_tested(problem, at, directions, groups)
    alone = [lack_of_fit._explained(simulated(problem, at, directions, group), rest) for group in groups]
    for (nats, freedom), (own, freedom_alone) in zip(told, alone, strict=True):
        assert nats == pytest.approx(own, rel=0.05)
        assert freedom == freedom_alone


@pytest.mark.parametrize("values", [{}, {"actuator_delay": 0.013, "sensor_scale": 1.1}])
def test_what_comes_before_a_push_is_simulated_once(values, tmp_path):
    asked = question(tmp_path)
    problem, hypothesis = asked.searched, Hypothesis(scheme="fine")
    for family, value in values.items():
        candidate = next(c for c in offers_of(asked) if c.family == family)
        hypothesis = hypothesis.plus(candidate.term([value]), candidate.declared)
    chain = hypothesis.chain(problem.simulator, problem.parameters, problem.dt)
    when = np.repeat([0, 3, problem.windows.length - 1], len(problem.windows))
    pushes = Pushes(when, 1, len(problem.simulator.rate), 0.7)
    starts, thetas = np.tile(problem.windows.measured[:, 0], (3, 1, 1)), np.tile(hypothesis.theta, (3, 1))
    one, each = (
        problem.simulated(chain, problem.windows, starts, hypothesis.spread, thetas, extra)
        for extra in (pushes, lambda *now: pushes(*now))
    )
    assert np.array_equal(one, each)
    assert not np.array_equal(one[0], one[1])


def simulated(problem, at, directions, group):
    """(F, N): what each function of a group takes off, each of them added to the rate where the simulation is."""
    chain = at.hypothesis.chain(problem.simulator, problem.parameters, problem.dt)
    windows, states, push = (
        problem.windows,
        len(problem.simulator.state),
        lack_of_fit._probe(problem, group.rate),
    )
    past = lack_of_fit.average_of(problem, group.inputs[1] - states, group.memory) if group.memory else None
    out = []
    for place in np.ndindex(*(group.knots.shape[1],) * len(group.inputs)):

        def extra(state, action, k, place=place):
            seen = lack_of_fit.inputs_of(problem, state, action)
            columns = [seen[:, i] for i in group.inputs]
            if past is not None:
                columns[1] = past[:, k]
            added = np.zeros((len(state), len(problem.simulator.rate)))
            added[:, group.rate] = push
            for column, knots, own in zip(columns, group.knots, place, strict=True):
                added[:, group.rate] *= lack_of_fit.hat(column, knots, np.array(own))
            return added

        theta, spread = at.hypothesis.theta[None], at.hypothesis.spread
        said = problem.simulated(chain, windows, at.starts[None], spread, theta, extra)
        residual = problem.simulator.gap(windows.measured[None], said) * problem.root_weights
        out.append(directions.changes(residual).ravel() / push)
    return np.array(out)


def test_slopes_of_the_base_tell_where_rollouts_of_an_account_began(tmp_path):
    asked, lead = question(tmp_path), 8
    problem, plain = asked.searched, Hypothesis(scheme="fine")
    drag = next(c for c in offers_of(asked) if c.identity == ("quadratic_drag", "elbow"))
    account = plain.plus(drag.term([0.02]), drag.declared)
    known = judges._slopes(problem, problem.windows, lead, account)
    served = judges.foretold(problem, problem.windows, lead, account, known)
    own = judges.foretold(problem, problem.windows, lead, account)
    off = problem.windows.measured - own
    assert np.sqrt(np.mean((served - own) ** 2)) < 0.1 * np.sqrt(np.mean(off**2))


def test_a_finer_grid_is_asked_for_where_commands_are_remembered(tmp_path):
    asked = question(tmp_path)
    exact = closed(asked.searched.simulator).exact()
    problem, plain = replace(asked.searched, simulator=exact), Hypothesis(scheme="fine")
    at = fit(problem, plain, problem.windows.measured[:, 0], iterations=1)
    late = next(c for c in offers_of(asked) if c.family == "actuator_delay")
    delayed = replace(at, hypothesis=plain.plus(late.term([0.03]), late.declared))
    assert not _grid_matters(problem, [at])
    assert _grid_matters(problem, [at, delayed])
    assert not _grid_matters(replace(problem, simulator=exact.as_modelled()), [at, delayed])
