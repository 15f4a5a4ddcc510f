"""What one least squares of inverse dynamics says of a double pendulum: the truth is MuJoCo's own, at a quarter of the step."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from mjcf_models import DOUBLE, logged, written

import gpsim
from gpsim.channels import Channel, Channels
from gpsim.diagnosis.diagnosis import diagnose
from gpsim.diagnosis.ladder.robots import by_inverse_dynamics
from gpsim.diagnosis.setup import offers_of, prepare
from gpsim.mjcf import in_its_columns, load_mjcf
from gpsim.recordings import Episode, Recording

JOINTS, DT, NOISE, FINER = ("shoulder", "elbow"), 0.01, 5e-4, 4
UNDRIVEN = DOUBLE.replace('<motor name="m2" joint="elbow"/>', "")
SERVOS = DOUBLE.replace(
    '<motor name="m1" joint="shoulder"/>', '<position name="m1" joint="shoulder" kp="30" kv="2"/>'
)
SERVOS = SERVOS.replace(
    '<motor name="m2" joint="elbow"/>', '<position name="m2" joint="elbow" kp="12" kv="0.8"/>'
)
RUBBING = SERVOS.replace('damping="0.02"', 'damping="0.02" frictionloss="0.2"')
"""The same with dry friction of its own, which is not what is missing."""
SIZES = {DOUBLE: (1.2, 0.4), UNDRIVEN: (1.2,), SERVOS: (0.8, 0.8), RUBBING: (0.8, 0.8)}
LAST, REST = "</body></body></worldbody>", 0.3
VISCOUS, DRY, ROTOR, PUSH = (0.1, 0.05), (0.12, 0.06), (0.03, 0.012), (0.15, -0.08)
"""What is missing at both joints."""


def commands(rng, count, size):
    """Sums of sines, so that both joints go to and fro."""
    t, many = DT * np.arange(count), len(size)
    tones, phases, heights = (
        rng.uniform(0.15, 2.5, (many, 5, 1)),
        rng.uniform(0, 6.3, (many, 5, 1)),
        rng.normal(size=(many, 5, 1)),
    )
    made = (heights * np.sin(2 * np.pi * tones * t + phases)).sum(axis=1).T
    return made / made.std(axis=0) * size


def truth(text, viscous, dry, rotor, mass, stiffer, spring=0.0):
    model = mujoco.MjModel.from_xml_string(text)
    model.opt.timestep /= FINER
    model.dof_damping[:] += viscous
    model.dof_frictionloss[:] += dry
    model.dof_armature[:] += rotor
    model.dof_solref[:], model.dof_solimp[:] = (
        (-1.0, -2.0 / model.opt.timestep),
        (0.9999, 0.9999, 0.001, 0.5, 2.0),
    )
    model.body_mass[-1] *= mass
    model.jnt_stiffness[-1], model.qpos_spring[-1] = spring, REST
    model.actuator_gainprm[:, 0] *= stiffer
    model.actuator_biasprm[:, 1] *= stiffer
    mujoco.mj_setConst(model, mujoco.MjData(model))
    return model


def episode(name, model, rng, samples, size, push, gain, late):
    """Readings with noise of what a model does whose drives get a command so many seconds late."""
    data, given, rows = mujoco.MjData(model), commands(rng, samples, size), []
    steps = round(DT / model.opt.timestep)
    sent = np.concatenate(
        [np.zeros((round(late / model.opt.timestep), len(size))), np.repeat(given, steps, axis=0)]
    )
    data.qpos[:], data.qfrc_applied[:] = 0.3 * rng.normal(size=model.nq), push
    for k in range(samples):
        rows.append(np.array(data.qpos))
        for i in range(steps):
            data.ctrl[:] = sent[k * steps + i] * gain
            mujoco.mj_step(model, data)
    rows.append(np.array(data.qpos))
    return Episode(
        name, DT * np.arange(samples + 1), rows + NOISE * rng.normal(size=(samples + 1, model.nq)), given
    )


def question_of(
    folder,
    text=DOUBLE,
    viscous=0.0,
    dry=0.0,
    rotor=0.0,
    push=0.0,
    gain=1.0,
    late=0.0,
    mass=1.0,
    stiffer=1.0,
    samples=500,
    load="",
    spring=0.0,
    misread=0.0,
):
    """The question of a model as in `text`, of a robot that differs from it."""
    rng, model = (
        np.random.default_rng(7),
        truth(text.replace(LAST, load + LAST), viscous, dry, rotor, mass, stiffer, spring),
    )
    episodes = [episode(str(e), model, rng, samples, SIZES[text], push, gain, late) for e in range(3)]
    for e in episodes:
        e.states[:, -1] += misread
    simulator = load_mjcf(written(folder, text))
    names = [c.name for c in simulator.coordinates]
    state = Channels(tuple(Channel(name, "rad") for name in names))
    noise = dict.fromkeys(names, NOISE)
    recording = Recording("mjcf", state, simulator.action, tuple(episodes), DT, noise=noise)
    return prepare(in_its_columns(recording, simulator), simulator, simulator.defaults())


def said_of(question):
    return by_inverse_dynamics(question.everything, question.recording, offers_of(question))


@pytest.fixture(scope="module")
def every(tmp_path_factory):
    """All rows, and commands that come 2.4 steps late."""
    missing = {"viscous": VISCOUS, "dry": DRY, "rotor": ROTOR, "push": PUSH}
    return said_of(question_of(tmp_path_factory.mktemp("every"), **missing, late=0.024))


@pytest.fixture(scope="module")
def complete(tmp_path_factory):
    """A model that lacks nothing."""
    return question_of(tmp_path_factory.mktemp("complete"))


def check(sized, family, sizes, share=0.1):
    for on, size in zip(JOINTS, sizes, strict=True):
        assert sized.values[family, on] == pytest.approx((size,), rel=share), on


@pytest.mark.parametrize(
    ("family", "sizes"),
    [("viscous_friction", VISCOUS), ("coulomb_friction", DRY), ("armature", ROTOR), ("constant_force", PUSH)],
)
def test_every_joints_rows_are_sized_at_once(every, family, sizes):
    check(every, family, sizes)
    for on, size in zip(JOINTS, sizes, strict=True):
        (value,), (deviation,) = every.values[family, on], every.deviations[family, on]
        assert abs(value - size) < max(5 * deviation, 0.02 * abs(size))
        assert deviation < 0.15 * abs(size)


def test_how_late_commands_come_is_told_of_all_drives(every):
    assert every.delay == pytest.approx(0.024, abs=DT / 10)
    assert every.values["actuator_delay", "m1"] == every.values["actuator_delay", "m2"] == (every.delay,)
    assert 0.0 < every.deviations["actuator_delay", "m1"][0] < DT / 2
    assert every.share > 0.95


def test_where_nothing_is_missing_all_is_next_to_nothing(complete):
    sized = said_of(complete)
    usual = {"viscous_friction": VISCOUS, "coulomb_friction": DRY, "armature": ROTOR, "constant_force": PUSH}
    for family, sizes in usual.items():
        for on, size in zip(JOINTS, sizes, strict=True):
            assert abs(sized.values[family, on][0]) < 0.1 * abs(size)
    assert {family for family, _ in sized.values} == set(usual)
    assert sized.delay == 0.0
    assert sized.share < 0.1


def test_a_motors_gain_is_told_beside_rows(tmp_path):
    gains = (1.0, 0.7)
    sized = said_of(question_of(tmp_path, viscous=VISCOUS, dry=(0.06, 0.03), rotor=ROTOR, gain=gains))
    assert [sized.values["actuator_gain", on][0] for on in ("m1", "m2")] == pytest.approx(gains, rel=0.03)
    check(sized, "viscous_friction", VISCOUS)
    check(sized, "armature", ROTOR)


def test_a_body_that_is_heavier_is_told(tmp_path):
    sized = said_of(question_of(tmp_path, viscous=VISCOUS, mass=1.3))
    assert sized.values["parameter_offset", "lower.mass"] == pytest.approx((1.3,), rel=0.05)
    check(sized, "viscous_friction", VISCOUS)


def test_a_body_that_servos_move_is_told_by_their_forces(tmp_path):
    """Stiff servos hide it: their motion hardly changes."""
    rows = {"viscous": VISCOUS, "dry": (0.3, 0.15), "rotor": ROTOR}
    sized = said_of(question_of(tmp_path, SERVOS, **rows, mass=1.12, late=0.01))
    assert sized.values["parameter_offset", "lower.mass"] == pytest.approx((1.12,), rel=0.02)
    assert {family for family, _ in sized.values} >= {"parameter_offset", "coulomb_friction"}
    assert "payload" not in {family for family, _ in sized.values}
    check(sized, "coulomb_friction", (0.3, 0.15), 0.2)


def test_a_load_near_its_joint_is_told_by_its_first_moments(tmp_path):
    load = '<body pos="0.1 0 -0.05"><inertial pos="0 0 0" mass="0.3" diaginertia="1e-7 1e-7 1e-7"/></body>'
    sized = said_of(question_of(tmp_path, viscous=VISCOUS, load=load))
    mass, x, _, z = sized.values["payload", "lower"]
    assert (mass * x, mass * z) == pytest.approx((0.03, -0.015), rel=0.05)
    assert mass == pytest.approx(0.3, rel=0.1)


def test_a_load_that_servos_carry_is_told_with_its_place(tmp_path):
    load = '<body pos="0.1 0 -0.3"><inertial pos="0 0 0" mass="0.3" diaginertia="1e-7 1e-7 1e-7"/></body>'
    sized = said_of(question_of(tmp_path, SERVOS, viscous=VISCOUS, dry=(0.3, 0.15), load=load))
    assert sized.values["payload", "lower"] == pytest.approx((0.3, 0.1, 0.0, -0.3), rel=0.05, abs=0.02)
    check(sized, "coulomb_friction", (0.3, 0.15), 0.2)


def test_a_joint_without_a_drive_is_as_good(tmp_path):
    sized = said_of(question_of(tmp_path, UNDRIVEN, viscous=VISCOUS, dry=(0.06, 0.03), rotor=ROTOR))
    check(sized, "viscous_friction", VISCOUS)
    check(sized, "coulomb_friction", (0.06, 0.03))
    check(sized, "armature", ROTOR)


def test_servos_are_less_stiff_and_late(tmp_path):
    """Dry friction of the model's own is no part of what is missing."""
    sized = said_of(question_of(tmp_path, RUBBING, viscous=VISCOUS, dry=(0.3, 0.15), late=0.02, stiffer=0.6))
    stiff = [sized.values["parameter_offset", f"{on}.kp"][0] for on in ("m1", "m2")]
    assert stiff == pytest.approx((0.6, 0.6), rel=0.1)
    assert sized.delay == pytest.approx(0.02, abs=DT / 2)
    check(sized, "coulomb_friction", (0.3, 0.15), 0.2)


def test_a_joint_that_stands_is_held_at_least_by_what_pulls_it(tmp_path, monkeypatch):
    monkeypatch.setitem(SIZES, DOUBLE, (2.5, 0.2))
    sized = said_of(question_of(tmp_path, dry=(0.05, 3.0)))
    assert sized.values["coulomb_friction", "shoulder"] == pytest.approx((0.05,), rel=0.2)
    assert 0.8 < sized.values["coulomb_friction", "elbow"][0] < 3.5
    assert ("viscous_friction", "elbow") not in sized.values  # nobody knows


def test_what_something_pushes_now_and_then_is_left_out(complete, monkeypatch):
    """As if a stop pushed one joint beyond a position: the other rows say the same."""

    def beyond(self, states):
        out = np.zeros((len(states), len(self.coordinates)), dtype=np.bool_)
        out[:, 1] = states[:, self.state.index("elbow")] > 0.0
        return out

    def lacking(self, states, *others):
        return true(self, states, *others) + 5.0 * beyond(self, states)

    kind = type(complete.everything.simulator)
    true = kind.lacking_force
    monkeypatch.setattr(kind, "lacking_force", lacking)
    spoilt = said_of(complete)
    monkeypatch.setattr(kind, "hindered", beyond)
    spared = said_of(complete)
    assert abs(spoilt.values["constant_force", "elbow"][0]) > 1.0
    assert abs(spared.values["constant_force", "elbow"][0]) < 0.3


def test_nothing_is_said_of_too_few_samples(complete):
    episodes = tuple(
        replace(e, t=e.t[:50], states=e.states[:50], actions=e.actions[:49])
        for e in complete.recording.episodes
    )
    recording = replace(complete.recording, episodes=episodes)
    assert by_inverse_dynamics(complete.everything, recording, offers_of(complete)) is None


@pytest.mark.parametrize(
    ("missing", "named", "size"),
    [
        ({"spring": 0.8}, {("spring", "elbow")}, {"stiffness": 0.8, "rest_position": REST}),
        pytest.param(
            {"misread": 0.06},
            {("joint_offset", "elbow"), ("sensor_bias", "elbow")},
            {"offset": 0.06},
            marks=pytest.mark.slow,
        ),
    ],
    ids=["spring", "misread"],
)
def test_one_thing_that_is_unusual_is_told_alone_and_by_its_name(tmp_path, missing, named, size):
    """All rows of both joints could make up for it between them: 20 numbers in the place of one."""
    question = question_of(tmp_path, **missing)
    simulator = question.everything.simulator
    found = diagnose(question.recording, simulator, simulator.defaults(), np.random.default_rng(0)).diagnosis
    (effect,) = found.effects
    assert found.verdict == "named"
    assert (effect.family, effect.place) in named
    for name, value in size.items():
        assert effect.parameters[name].value == pytest.approx(value, rel=0.05)


BRAKED = """<mujoco><option timestep="0.001" integrator="implicitfast"/><worldbody>
<body name="arm"><joint name="hinge" axis="0 -1 0"{own}/>
<geom type="sphere" size="0.02" pos="0 0 -0.1" mass="0.5" contype="0" conaffinity="0"/></body></worldbody>
<actuator><position name="goal" joint="hinge" kp="0.9" kv="{kv}" forcerange="-0.8 0.8"/></actuator></mujoco>"""


def test_dry_friction_is_told_where_the_servo_of_the_model_brakes_too_much(tmp_path):
    """Rows without the servo's own damping make up for too much of it with less friction: none, here."""
    own = ' armature="0.002" frictionloss="0.08"'
    model, dt, rows = mujoco.MjModel.from_xml_string(BRAKED.format(own=own, kv=0.03)), 0.01, []
    model.dof_solref[:], model.dof_solimp[:] = (-1.0, -2000.0), (0.9999, 0.9999, 0.001, 0.5, 2.0)
    rng, t = np.random.default_rng(0), dt * np.arange(401)
    swung, lifted = np.sin(0.8 * np.pi * t * (1.0 + t / 2.0)), 1.5 * np.sin(0.4 * np.pi * np.sqrt(4.0 * t))
    for number, goals in enumerate((swung, lifted)):
        data = mujoco.MjData(model)
        for moment, goal in zip(t, goals, strict=True):
            rows.append((number, moment, data.qpos[0] + NOISE * rng.normal(), goal))
            data.ctrl[:] = goal
            mujoco.mj_step(model, data, round(dt / model.opt.timestep))
    believed, noise = BRAKED.format(own="", kv=0.05), {"hinge": NOISE}
    folder = logged(tmp_path, believed, rows, dt, {"hinge": "rad"}, {"goal": "rad"}, noise=noise)
    robot = str(folder / "robot.xml")
    found = gpsim.diagnose(gpsim.read_recording(folder, robot), robot)
    sizes = {(e.family, e.place): next(iter(e.parameters.values())).value for e in found.effects}
    assert sizes == {
        ("coulomb_friction", "hinge"): pytest.approx(0.08, rel=0.1),
        ("armature", "hinge"): pytest.approx(0.002, rel=0.1),
        ("parameter_offset", "goal.kv"): pytest.approx(0.6, rel=0.1),
    }
