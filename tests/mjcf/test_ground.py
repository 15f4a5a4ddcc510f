"""A hopper's ground is not what its model says: a fit through landings finds how rough, or how soft it is."""

import mujoco
import numpy as np
import pytest
from mjcf_models import logged

from gpsim.diagnosis.fitting import Hypothesis, fit
from gpsim.diagnosis.setup import offers_of, prepare
from gpsim.stages.diagnose import Task, open_recording

DT, NOISE, SAMPLES, EPISODES, WINDOWS = 0.01, 1e-3, 1200, 4, 24
FRICTION, SOLREF = "floor.friction", "floor.solref"
SOFT = 'solref=".06 1" friction=".6"'
HOPPER = f"""<mujoco><option timestep="0.002" integrator="implicitfast"/><worldbody>
<geom name="floor" type="plane" size="20 20 1" {SOFT}/>
<body name="trunk" pos="0 0 .4"><joint name="x" type="slide" axis="1 0 0" damping="2"/>
<joint name="z" type="slide" axis="0 0 1" damping="1"/>
<geom type="box" size=".1 .1 .05" mass="2" contype="0" conaffinity="0"/>
<body name="shin"><joint name="leg" type="slide" axis="0 0 -1" damping="2"/>
<geom name="foot" size=".03" pos="0 0 -.37" mass=".3" {SOFT}/></body></body></worldbody>
<actuator><motor name="pull" joint="x"/><position name="thrust" joint="leg" kp="800" kv="20"/></actuator></mujoco>"""
"""It hops on a rail along which a motor drags it forth and back: its foot slips now and then."""


def commands(rng, count):
    """(count, 2): a pull of some tones, and a leg that pushes off about twice in three."""
    t = DT * np.arange(count)
    tones = rng.uniform(0.3, 2.0, (4, 1)), rng.uniform(0.0, 6.3, (4, 1)), rng.normal(size=(4, 1))
    pull = (tones[2] * np.sin(2 * np.pi * tones[0] * t + tones[1])).sum(axis=0)
    thrust = 0.05 * np.sign(np.sin(2 * np.pi * rng.uniform(1.2, 2.2) * t + rng.uniform(0.0, 6.3)))
    stays = (rng.random(count // 50 + 1) > 0.3).repeat(50)[:count]
    return np.stack([9.2 * pull / pull.std(), thrust * stays], axis=1)


def recorded(folder, change):
    """What is recorded on a ground that `change` made of the model's; a quarter of its step is the truth's."""
    rng, model = np.random.default_rng(7), mujoco.MjModel.from_xml_string(HOPPER)
    model.opt.timestep /= 4
    change(model)
    data, steps, rows = mujoco.MjData(model), round(DT / model.opt.timestep), []
    for episode in range(EPISODES):
        mujoco.mj_resetData(model, data)
        data.qpos[1] = 0.02
        for k, command in enumerate(commands(rng, SAMPLES // EPISODES)):
            read = data.qpos + NOISE * rng.normal(size=3)
            rows.append((episode, DT * k, *read, *command))
            data.ctrl[:] = command
            mujoco.mj_step(model, data, nstep=steps)
    state, noise = (dict.fromkeys(("x", "z", "leg"), value) for value in ("m", NOISE))
    return logged(folder, HOPPER, rows, DT, state, {"pull": "N", "thrust": "m"}, noise=noise)


def smooth(model):
    model.geom_friction[:, 0] = 0.4


def yielding(model):
    model.geom_solref[:, 0] = 0.09


OFF = pytest.mark.xfail(
    reason=".71 for .67, 3.6 standard deviations off: starts of windows stay where they are"
)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "on", "ratio"), [pytest.param(smooth, FRICTION, 2 / 3, marks=OFF), (yielding, SOLREF, 1.5)]
)
def test_a_fit_through_landings_finds_what_the_ground_is_like(change, on, ratio, tmp_path):
    recording, simulator = open_recording(Task(recorded(tmp_path, change), None))
    question = prepare(recording, simulator, simulator.defaults())
    problem = question.searched.on(question.searched.windows.take(np.arange(WINDOWS)))
    start, off = problem.windows.measured[:, 0], {}
    for candidate in (c for c in offers_of(question) if c.place.on in (FRICTION, SOLREF)):
        found = fit(problem, Hypothesis((candidate.term([1.1]),), (candidate.declared,)), start, rounds=12)
        off[candidate.place.on] = np.log(found.residuals[..., problem.observed].std(axis=(0, 1))).sum()
        if candidate.place.on == on:
            assert found.hypothesis.theta[0] == pytest.approx(ratio, rel=0.05)
    assert min(off, key=off.get) == on
