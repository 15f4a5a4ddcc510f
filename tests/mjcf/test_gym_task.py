"""Gymnasium's own tasks on plants of gpsim: what they reward and when they end is theirs; a changed model is driven."""

import gymnasium
import mujoco
import numpy as np
import pytest
from stable_baselines3.common.env_checker import check_env

import gpsim
from gpsim.api.corrected import CorrectedSimulator
from gpsim.corrected import CorrectedPlant, EffectsPlant
from gpsim.effects import Term
from gpsim.errors import UsageError
from gpsim.mjcf import load_mjcf, new_environment
from gpsim.mjcf.gym_task import GymTask
from gpsim.simulators import SimulatorPlant
from gpsim.targets import ChangedModel

DOUBLE = "gym:InvertedDoublePendulum-v5"
NO_CONTEXT = np.empty((0, 0))


def plant_of(*terms, reference=DOUBLE, dt=0.05):
    simulator = load_mjcf(reference)
    return EffectsPlant(simulator, simulator.defaults(), terms, "fine", simulator.steps_of(dt), dt)


def tip(states):
    """Where the upper pole's end is: x and height [m]."""
    first, second = states[:, 2], states[:, 2] + states[:, 4]
    return states[:, 0] + 0.6 * (np.sin(first) + np.sin(second)), 0.6 * (np.cos(first) + np.cos(second))


def test_reward_and_end_are_the_environments_own():
    task, rng = GymTask(DOUBLE), np.random.default_rng(0)
    before, after = (rng.uniform(-0.6, 0.6, (50, 6)) for _ in range(2))
    x, y = tip(after)
    over = y <= 1.0
    assert 5 < over.sum() < 50 or over.any()
    want = 10.0 * ~over - 0.01 * x**2 - (y - 2.0) ** 2 - 1e-3 * after[:, 3] ** 2 - 5e-3 * after[:, 5] ** 2
    assert task.reward(before, np.zeros((50, 1)), after, NO_CONTEXT) == pytest.approx(want)
    assert (task.terminated(after, NO_CONTEXT) == over).all()
    assert (
        GymTask(DOUBLE).terminated(after, NO_CONTEXT) == over
    ).all()  # of which nothing was rewarded before


def test_observations_and_starts_are_the_environments_own():
    task = GymTask(DOUBLE)
    start = task.start(20, np.random.default_rng(0))
    assert start.states.shape == (20, 6)
    assert np.abs(start.states[:, ::2]).max() < 0.1
    states = start.states
    seen = task.observe(states, start.context)
    angles = states[:, [2, 4]]
    want = np.hstack([states[:, :1], np.sin(angles), np.cos(angles), states[:, 1::2]])
    assert seen[:, :8] == pytest.approx(want, abs=1e-6)
    assert (
        task.observe(states[::-1], start.context)[::-1] == seen
    ).all()  # none depends on who was asked before
    assert (task.max_steps, GymTask(DOUBLE, 30).max_steps, task.dt) == (1000, 30, 0.05)


@pytest.mark.parametrize("name", ["Hopper-v5", "HalfCheetah-v5", "Reacher-v5"])
@pytest.mark.filterwarnings("ignore")
def test_it_judges_a_transition_as_the_environment_that_made_it(name):
    """Those of which nothing but positions and velocities counts: else MuJoCo's own quantities lag a step behind."""
    task, (env, _) = GymTask(f"gym:{name}"), new_environment(f"gym:{name}")
    layout = load_mjcf(f"gym:{name}").layout
    env.reset(seed=0)
    env.action_space.seed(0)
    for _ in range(5):
        before = layout.state(env.data.qpos[None], env.data.qvel[None])
        action = env.action_space.sample()
        seen, reward, terminated, *_ = env.step(action)
        after = layout.state(env.data.qpos[None], env.data.qvel[None])
        assert task.reward(before, action[None], after, NO_CONTEXT)[0] == pytest.approx(reward, abs=1e-5)
        assert task.terminated(after, NO_CONTEXT)[0] == terminated
        assert task.observe(after, NO_CONTEXT)[0] == pytest.approx(seen, abs=1e-5)


def test_what_is_not_finite_is_over_and_earns_nothing():
    task, states = GymTask(DOUBLE), np.full((2, 6), np.nan)
    assert task.terminated(states, NO_CONTEXT).all()
    assert (task.reward(states, np.zeros((2, 1)), states, NO_CONTEXT) == 0.0).all()
    assert (task.observe(states, NO_CONTEXT) == 0.0).all()


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_make_env_trains_anywhere_one_by_one_and_as_a_batch():
    corrected = CorrectedSimulator(plant_of(Term("coulomb_friction", "hinge", {"force": 0.4})))
    env = gpsim.make_env(corrected, task=DOUBLE, max_steps=20)
    check_env(env)
    batch = gpsim.make_env(corrected, task=DOUBLE, count=3)
    states = np.tile([0.0, 0.0, 0.05, 0.0, -0.02, 0.0], (3, 1))
    seen, _ = batch.reset(seed=1, options={"states": states})
    first, _ = env.reset(seed=0, options={"states": states[0]})
    assert (seen[0] == first).all()
    many, alone = batch.step(np.full((3, 1), 0.2)), env.step(np.array([0.2]))
    assert many[0][1] == pytest.approx(alone[0], abs=1e-6)
    assert many[1][2] == pytest.approx(alone[1])
    base = gpsim.make_env(CorrectedSimulator(plant_of()), task=DOUBLE)
    base.reset(options={"states": states[0]})
    base.step(np.array([0.2]))
    assert not np.allclose(base.state, env.state, atol=1e-4)  # the friction is there


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (
            lambda: gpsim.make_env(CorrectedSimulator(plant_of(dt=0.02)), task=DOUBLE),
            "control steps of 0.05 s",
        ),
        (lambda: gpsim.make_env(CorrectedSimulator(plant_of()), task="gym:Hopper-v5"), "of another system"),
        (
            lambda: gpsim.make_env(CorrectedSimulator(plant_of()), task="gym:CartPole-v1"),
            "not based on MuJoCo",
        ),
        (lambda: gpsim.make_env(CorrectedSimulator(plant_of()), task="gym:Nothing-v5"), "cannot make it"),
        (
            lambda: gpsim.make_env(CorrectedSimulator(plant_of()), task=DOUBLE, force=2.0),
            "no setting 'force'",
        ),
    ],
)
def test_what_does_not_go_together_is_refused(make, said):
    with pytest.raises(UsageError, match=said):
        make()


def test_a_changed_model_is_the_model_where_nothing_is_changed():
    target, simulator = ChangedModel(DOUBLE, 0.05, finer=1), load_mjcf(DOUBLE)
    base = SimulatorPlant(simulator, simulator.defaults(), "euler", 0.05)
    rng = np.random.default_rng(0)
    states, actions = rng.uniform(-0.1, 0.1, (5, 6)), rng.uniform(-0.2, 0.2, (5, 1))
    memory = target.begin(5, rng)
    found, want = target.step(states, actions, memory, rng), base.step(states, actions, {}, rng)
    assert found == pytest.approx(want, abs=1e-9)


@pytest.mark.parametrize(
    ("change", "terms"),
    [
        ({"gain": {"slide": 0.5}}, [Term("actuator_gain", "slide", {"gain": 0.5})]),
        ({"delay": {"slide": 0.02}}, [Term("actuator_delay", "slide", {"delay": 0.02})]),
        ({"friction": {"hinge": 0.4}}, [Term("coulomb_friction", "hinge", {"force": 0.4})]),
        ({"damping": {"hinge2": 0.3}}, [Term("viscous_friction", "hinge2", {"damping": 0.3})]),
        ({"mass": {"pole2": 1.5}}, [
            Term("parameter_offset", "pole2.mass", {"ratio": 1.5}), Term("parameter_offset", "pole2.inertia", {"ratio": 1.5}),
        ]),
    ],
)  # fmt: skip
def test_what_a_changed_model_conceals_is_what_the_catalogue_means_by_it(change, terms):
    target, plant, base = ChangedModel(DOUBLE, 0.05, **change), plant_of(*terms), plant_of()
    rng = np.random.default_rng(0)
    paths = []
    for driven in (target, plant, base):
        state, memory = np.array([[0.0, 0.1, 0.05, 0.4, -0.05, -0.3]]), driven.begin(1, rng)
        for k in range(6):
            state = driven.step(state, np.array([[0.1 * np.cos(k)]]), memory, rng)
        paths.append(state)
    assert paths[0] == pytest.approx(paths[1], rel=3e-3, abs=2e-3)
    assert np.abs(paths[0] - paths[2]).max() > 2e-2


def test_a_changed_model_refuses_what_its_model_has_not():
    with pytest.raises(UsageError, match="no knee; it has: slider, hinge, hinge2"):
        ChangedModel(DOUBLE, 0.05, friction={"knee": 1.0}).step(
            np.zeros((1, 6)), np.zeros((1, 1)), {"commands": np.zeros((1, 1, 1))}, np.random.default_rng(0)
        )
    with pytest.raises(ValueError, match="at least 0"):
        ChangedModel(DOUBLE, 0.05, friction={"hinge": -1.0})


class Push:
    """A correction of accelerations that is the same everywhere."""

    def __init__(self, rates):
        self.added = np.array(rates)

    def begin(self, count, rng):
        return {}

    def rates(self, state, action, memory, rng):
        return np.tile(self.added, (len(state), 1))


def test_a_gaussian_process_corrects_generalised_accelerations():
    """Held over the control step, while MuJoCo integrates: on a body that nothing else moves a speed of a t."""
    simulator, rng = load_mjcf(DOUBLE), np.random.default_rng(0)
    plant = CorrectedPlant(simulator, simulator.defaults(), "euler", 0.05, Push([0.5, 0.0, -0.3]))
    bare = SimulatorPlant(simulator, simulator.defaults(), "euler", 0.05)
    states = np.zeros((2, 6))
    moved = plant.step(states, np.zeros((2, 1)), {}, rng) - bare.step(states, np.zeros((2, 1)), {}, rng)
    assert moved[:, 1] == pytest.approx(0.5 * 0.05, rel=0.02)
    assert moved[:, 5] == pytest.approx(-0.3 * 0.05, rel=0.1)


def test_the_environments_id_is_registered():
    with pytest.raises(UsageError, match="no finished artifact|no such|manifest"):
        gymnasium.make("gpsim/Corrected-v0", diagnosis="nowhere", task=DOUBLE)
    assert mujoco.__version__
