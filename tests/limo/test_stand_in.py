"""The stand-in car: what its source says it does, against closed forms."""

import numpy as np
import pytest

from gpsim.targets import Limo

FIGURES = {
    "wheelbase": 0.2, "track": 0.172, "inner_angle": 28.0, "scale_left": 1.0, "scale_right": 1.0, "delay": 0.12,
    "steering_lag": 0.15, "motor_lag": 0.12, "position_noise": 0.0005, "yaw_noise": 0.2, "mocap_rate": 100.0,
    "dt": 0.1, "substeps": 20,
}  # fmt: skip


def car(**changes):
    return Limo(**{**FIGURES, **changes})


def settle(limo, v, w, steps=60):
    """The mean twist of the last second under a held command."""
    state, memory = np.zeros((1, 3)), limo.begin(1, np.random.default_rng(0))
    states = [state]
    for _ in range(steps):
        states.append(limo.step(states[-1], np.array([[v, w]]), memory, np.random.default_rng(0)))
    path = np.concatenate(states)[-11:]
    metres = np.hypot(*np.diff(path[:, :2], axis=0).T).sum()
    return metres, path[-1, 2] - path[0, 2]


def test_the_turning_radius_is_the_makers():
    limo = car()
    assert limo.turning_radius == pytest.approx(0.2 / np.tan(np.deg2rad(28.0)) + 0.086)
    assert limo.turning_radius == pytest.approx(0.462, abs=5e-4)
    v, w = settle(limo, 0.1, 0.3)
    assert v / w == pytest.approx(limo.turning_radius, rel=1e-3)


def test_the_motor_answers_after_the_delay_and_then_by_its_lag():
    """Distance of a straight start: v (t - T (1 - exp(-t / T))), t from the end of the delay."""
    limo = car(substeps=40)
    state, memory = np.zeros((1, 3)), limo.begin(1, np.random.default_rng(0))
    for k in range(1, 8):
        state = limo.step(state, np.array([[0.2, 0.0]]), memory, np.random.default_rng(0))
        t = max(0.1 * k - 0.12, 0.0)
        assert state[0, 0] == pytest.approx(0.2 * (t - 0.12 * (1.0 - np.exp(-t / 0.12))), abs=1e-5)


def test_a_batch_is_its_cars_and_the_camera_sees_what_the_car_does():
    limo, rng = car(), np.random.default_rng(0)
    plan = rng.uniform([0.0, -0.3], [0.2, 0.3], (10, 3, 2))
    state, memory = np.zeros((3, 3)), limo.begin(3, rng)
    single, alone = np.zeros((1, 3)), limo.begin(1, rng)
    for commands in plan:
        state = limo.step(state, commands, memory, rng)
        seen = limo.glimpses(single, commands[1:2], alone)
        assert seen.shape == (1, 10, 3)
        single = seen[:, -1]
        np.testing.assert_allclose(single[0], state[1], rtol=0, atol=1e-15)
    measured = limo.measure(np.zeros((20_000, 3)), {}, rng)
    np.testing.assert_allclose(measured.std(axis=0), [5e-4, 5e-4, np.deg2rad(0.2)], rtol=0.03)


def test_impossible_figures_are_refused():
    for changes in ({"wheelbase": 0.0}, {"motor_lag": 0.0}, {"substeps": 7}, {"delay": -0.1}):
        with pytest.raises(ValueError, match="must be"):
            car(**changes)


@pytest.mark.parametrize(
    ("rate", "samples", "nearest"), [(125.0, "12.5", "120"), (55.0, "5.5", "60"), (3.0, "0.3", "10")]
)
def test_the_camera_looks_a_whole_number_of_times_in_a_step(rate, samples, nearest):
    with pytest.raises(ValueError, match=f"in a step of 0.1 s, got {samples}; .* is {nearest} Hz"):
        car(mocap_rate=rate, substeps=24)
