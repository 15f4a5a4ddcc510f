"""The simulator corrected by named effects, as a plant: late sensors, batteries, onsets, against closed forms."""

from dataclasses import replace

import numpy as np
import pytest

from gpsim.corrected import EffectsPlant, ages_of, describe, plant_from
from gpsim.effects import Gate, Term
from gpsim.environments import BatchedEnv, Episodes
from gpsim.recordings import Episode, Recording
from gpsim.simulators import make_simulator
from gpsim.tasks import Balance

SLIDER, DT = make_simulator("slider"), 0.02


def slider(*terms, **kwargs):
    return EffectsPlant(SLIDER, {"mass": 1.0}, terms, "fine", 2, DT, **kwargs)


def pushed(plant, steps, seed=0, count=1):
    """(steps + 1, count, 2) what the policy reads, and the same of the truth, under a force of 1 N from rest."""
    rng = np.random.default_rng(seed)
    state, memory = np.zeros((count, 2)), plant.begin(count, rng)
    read, true = [plant.measure(state, memory, rng)], [state]
    for _ in range(steps):
        state = plant.step(state, np.ones((count, 1)), memory, rng)
        read.append(plant.measure(state, memory, rng))
        true.append(state)
    return np.stack(read), np.stack(true)


@pytest.mark.parametrize("delay", [0.0, 0.02, 0.05, 0.053])
def test_a_late_sensor_is_late_for_the_policy_too(delay):
    """q = t^2 / 2 under 1 N and 1 kg; the sensor says it a delay later, 0 while the body stood still."""
    read, true = pushed(slider(Term("sensor_delay", "q", {"delay": delay})), 20)
    t = DT * np.arange(21)
    np.testing.assert_allclose(true[:, 0, 0], t**2 / 2, atol=1e-12)
    after = t > delay + 0.03  # a cubic around the start sees its kink
    np.testing.assert_allclose(read[after, 0, 0], (t - delay)[after] ** 2 / 2, atol=1e-9)
    assert np.abs(read[t < delay, 0, 0]).max(initial=0.0) < 2e-5
    np.testing.assert_allclose(read[:, 0, 1], true[:, 0, 1])


def test_what_sensors_remember_belongs_to_each_episode_and_asking_twice_changes_nothing():
    plant, rng = slider(Term("sensor_delay", "q", {"delay": 0.04})), np.random.default_rng(0)

    class Hold(Balance):
        def start(self, count, rng):
            start = super().start(count, rng)
            return replace(start, states=np.tile([3.0, 0.0], (count, 1)))

        def terminated(self, states, context):
            return np.zeros(len(states), dtype=np.bool_)

        def observe(self, states, context):
            return states

        def command(self, actions):
            return np.asarray(actions, dtype=float)[:, None]

    running = Episodes(plant, Hold(), 3, rng)
    np.testing.assert_allclose(running.begin(), np.tile([3.0, 0.0], (3, 1)))  # long at rest there
    for _ in range(6):
        running.step(np.ones(3))
    before = running.observe()
    np.testing.assert_array_equal(before, running.observe())
    np.testing.assert_allclose(before[:, 0], 3.0 + 0.08**2 / 2)
    running.restart(np.array([False, True, False]))
    after = running.observe()
    np.testing.assert_allclose(after[1], [3.0, 0.0])
    np.testing.assert_array_equal(after[[0, 2]], before[[0, 2]])


def test_an_episode_that_is_over_reads_what_it_read_when_an_action_is_played_on():
    """With `repeat`, the others go on; the late sensor of the one that has ended must not."""
    cartpole = make_simulator("cartpole")
    terms = (Term("sensor_delay", "x", {"delay": 0.03}),)
    plant = EffectsPlant(cartpole, cartpole.defaults(), terms, "fine", 2, DT)
    starts = np.array([[0.0, 2.0, 0.0, 0.0], [0.0, 2.0, 0.17, 3.0]])
    last = {}
    for repeat in (1, 4):
        env = BatchedEnv(plant, Balance(angle_limit=0.2), 2, seed=0, repeat=repeat)
        env.reset(options={"states": starts})
        *_, terminated, _, info = env.step(np.array([1, 1]))
        assert terminated.tolist() == [False, True]
        last[repeat] = info["final_obs"][1]
    np.testing.assert_array_equal(last[1], last[4])


def test_a_battery_goes_by_its_episodes_age_whatever_else_began_when():
    """v = (1 - loss (age + t / 2)) t under 1 N; a force of 0 N that began at 40 s makes no battery older."""
    sag = Term("battery_sag", "force", {"loss_per_second": 0.01})
    late = Term("constant_force", "q", {"force": 0.0}, Gate(since=40.0))
    t = DT * np.arange(26)
    for terms in ((sag,), (sag, late)):
        for age in (0.0, 30.0):
            _, true = pushed(slider(*terms, ages=(age, age)), 25)
            np.testing.assert_allclose(true[:, 0, 1], (1 - 0.01 * (age + t / 2)) * t, atol=1e-4)


def test_ages_are_drawn_between_the_first_and_the_last_start_of_an_episode():
    sag = Term("battery_sag", "force", {"loss_per_second": 0.01})
    plant = slider(sag, ages=(10.0, 60.0))
    _, true = pushed(plant, 1, count=4000)
    ages = (1 - true[1, :, 1] / DT) / 0.01
    assert 9.9 < ages.min() < 10.5
    assert 59.5 < ages.max() < 60.1
    assert ages.mean() == pytest.approx(35.0, abs=1.0)
    onset = slider(replace(sag, gate=Gate(since=50.0)), ages=(10.0, 60.0))
    _, true = pushed(onset, 1, count=400)
    assert ((1 - true[1, :, 1] / DT) / 0.01).min() > 49.9  # the battery as it is now has begun to sag


def test_nothing_is_drawn_where_nothing_drifts():
    rng, untouched = np.random.default_rng(0), np.random.default_rng(0)
    slider(Term("spring", "q", {"stiffness": 1.0, "rest_position": 0.0}), ages=(0.0, 50.0)).begin(5, rng)
    assert rng.uniform() == untouched.uniform()


@pytest.mark.parametrize("since", [0.1, 40.0])  # of a clock that begins anew in every episode, or runs on
def test_an_effect_that_began_in_the_recording_acts_from_an_episodes_start(since):
    _, true = pushed(slider(Term("constant_force", "q", {"force": 1.0}, Gate(since=since))), 10)
    np.testing.assert_allclose(true[:, 0, 1], 2.0 * DT * np.arange(11), atol=1e-12)


def test_ages_travel_with_the_artifact():
    states, actions = np.zeros((3, 2)), np.zeros((2, 1))
    episodes = tuple(
        Episode(str(i), s + DT * np.arange(3), states, actions) for i, s in enumerate((2.0, 9.0))
    )
    recording = Recording("slider", SLIDER.state, SLIDER.action, episodes, DT, {"mass": 1.0})
    plant = slider(Term("battery_sag", "force", {"loss_per_second": 0.01}), ages=ages_of(recording))
    assert plant.ages == (2.0, 9.0)
    data = describe(plant, gp=False)
    assert plant_from(data, SLIDER) == plant
    del data["ages"]  # as earlier versions wrote it
    assert plant_from(data, SLIDER).ages == (0.0, 0.0)


@pytest.mark.parametrize(
    ("family", "values"),
    [
        ("actuator_lag", {"time_constant": 0.2}),
        ("actuator_rate_limit", {"rate": 1.0}),
        ("actuator_backlash", {"half_width": 0.2}),
    ],
)
def test_an_actuators_bias_has_arrived_before_an_episode_begins(family, values):
    """As the diagnosis has it, which lets no command pass for a while; a bias must not climb anew in every episode."""
    bias = Term("actuator_bias", "force", {"bias": 0.5})
    plant, rng = slider(bias, Term(family, "force", values)), np.random.default_rng(0)
    state = plant.step(np.zeros((3, 2)), np.zeros((3, 1)), plant.begin(3, rng), rng)
    expected = 0.5 - values.get("half_width", 0.0)
    np.testing.assert_allclose(state[:, 1], expected * DT, rtol=1e-3)
    alone = slider(Term(family, "force", values))
    np.testing.assert_array_equal(
        alone.step(np.zeros((1, 2)), np.zeros((1, 1)), alone.begin(1, rng), rng), 0.0
    )
