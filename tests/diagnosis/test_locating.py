"""What a residual depends on: over all rates for the report, of one rate for its picture."""

from types import SimpleNamespace

import numpy as np

from gpsim.diagnosis.locating import _concentrated, depends_on, most_telling
from gpsim.simulators import make_simulator

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
            most_telling(make_simulator("slider"), SimpleNamespace(inputs=INPUTS[:, :3], left_before=LEFT), 0)
        )
        == 2
    )


def test_what_began_between_two_episodes_is_located_where_each_has_a_clock_of_its_own():
    episode = np.repeat(np.arange(20), 200)
    left = RNG.normal(size=(4000, 2))
    left[:, 0] += 4.0 * (episode >= 8) * np.sign(INPUTS[:, 1])
    errors = {"x_acc": {"before": 3.2, "noise_floor": 1.0}, "theta_acc": {"before": 1.0, "noise_floor": 1.0}}
    comparison = SimpleNamespace(
        inputs=INPUTS,
        times=np.tile(0.02 * np.arange(200), 20),
        episodes=episode,
        left_before=left,
        one_step=errors,
    )

    def located(clock):
        question = SimpleNamespace(
            everything=SimpleNamespace(simulator=make_simulator("cartpole")),
            recording=SimpleNamespace(clock=clock),
            origin=0.0,
        )
        return _concentrated(question, comparison)

    found = located("episode")
    assert (found["rate"], found["channel"], found["where"]) == ("x_acc", "episode", "inside")
    assert 7.0 < found["interval"][0] <= 8.0
    assert found["interval"][1] == 19.0
    assert located("session") is None
