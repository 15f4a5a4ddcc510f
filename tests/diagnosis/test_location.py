"""What a residual depends on: over all rates for the report, of one rate for its picture."""

from types import SimpleNamespace

import numpy as np

from gpsim.channels import Channels
from gpsim.diagnosis.assessment.location import _concentrated, depends_on, most_telling
from gpsim.diagnosis.run import Run
from gpsim.findings import StepErrors
from gpsim.simulators import make_simulator, wrapping

RNG = np.random.default_rng(0)
INPUTS = RNG.normal(size=(4000, 5))  # x, x_dot, theta, theta_dot, force
LEFT = RNG.normal(size=(4000, 2))
LEFT[:, 0] += 1.0 * np.sign(INPUTS[:, 1]) + 0.3 * INPUTS[:, 4]
LEFT[:, 1] += 3.0 * np.cos(2.0 * INPUTS[:, 2])
COMPARISON = SimpleNamespace(inputs=INPUTS, left_before=LEFT, one_step={"x_acc": {}, "theta_acc": {}})


def test_the_report_names_what_any_rate_depends_on_the_most_telling_first():
    assert depends_on(make_simulator("cartpole"), COMPARISON, LEFT) == ["theta", "x_dot"]


def test_a_picture_shows_the_two_inputs_that_tell_most_of_its_own_rate():
    assert most_telling(make_simulator("cartpole"), COMPARISON, 0) == ["x_dot", "force"]
    assert most_telling(make_simulator("cartpole"), COMPARISON, 1)[0] == "theta"
    assert len(most_telling(make_simulator("cartpole"), COMPARISON, 1)) == 2
    assert (
        len(
            most_telling(
                make_simulator("slider"),
                SimpleNamespace(inputs=INPUTS[:, :3], left_before=LEFT),
                0,
            )
        )
        == 2
    )


EPISODE = np.repeat(np.arange(20), 200)


def concentrated(acts, *, clock="session", since_reversal=None, inputs=INPUTS, simulator=None):
    """Where it lies if x_acc has a mismatch in the samples (N,) in which something `acts`."""
    left = np.random.default_rng(1).normal(size=(4000, 2))
    left[:, 0] += 4.0 * acts * np.sign(INPUTS[:, 1])
    errors = {
        name: StepErrors(before=before, after=before, noise_floor=1.0, unit="m/s^2")
        for name, before in {"x_acc": 3.2, "theta_acc": 1.0}.items()
    }
    comparison = SimpleNamespace(
        inputs=inputs,
        times=np.tile(0.02 * np.arange(200), 20),
        episodes=EPISODE,
        since_reversal=since_reversal or {},
        left_before=left,
        one_step=errors,
    )
    question = SimpleNamespace(
        everything=SimpleNamespace(simulator=simulator or make_simulator("cartpole"), run=Run()),
        recording=SimpleNamespace(clock=clock),
        origin=0.0,
    )
    return _concentrated(question, comparison)


def test_what_began_between_two_episodes_is_located_where_each_has_a_clock_of_its_own():
    found = concentrated(EPISODE >= 8, clock="episode")
    assert (found.rate, found.channel, found.where) == ("x_acc", "episode", "inside")
    assert 7.0 < found.interval[0] <= 8.0
    assert found.interval[1] == 19.0
    assert concentrated(EPISODE >= 8) is None


def test_what_follows_a_reversal_is_located_there_and_what_comes_long_after_one_is_not():
    age = 0.02 * RNG.integers(0, 12, 4000)
    soon = concentrated(age < 0.05, since_reversal={"force": age})
    assert (soon.channel, soon.where) == ("since_reversal:force", "inside")
    assert soon.interval[0] == 0.0
    assert 0.04 <= soon.interval[1] <= 0.07
    assert concentrated(age > 0.18, since_reversal={"force": age}) is None


def test_an_angle_that_wraps_is_looked_at_as_a_place_on_the_circle():
    cartpole = make_simulator("cartpole")
    turning = wrapping(cartpole, Channels.of(cartpole.state.units, wraps=("theta",)))
    inputs = np.array(INPUTS)
    inputs[:, 2] = RNG.uniform(-20.0, 20.0, 4000)
    behind = np.cos(inputs[:, 2]) < -0.8
    found = concentrated(behind, inputs=inputs, simulator=turning)
    assert (found.channel, found.where) == ("theta", "outside")
    np.testing.assert_allclose(np.abs(found.interval), np.arccos(-0.8), atol=0.2)
