"""Velocities that were differentiated: which filter made them is found, and what it did is undone."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import median_filter
from scipy.signal import savgol_coeffs, savgol_filter

from gpsim.diagnosis import diagnose
from gpsim.diagnosis.data import cut
from gpsim.diagnosis.fitting import Hypothesis
from gpsim.diagnosis.settings import WindowSettings
from gpsim.diagnosis.setup import candidates, filters, prepare, undone
from gpsim.simulators import make_simulator

from .worlds import World, record

DT, GAIN = 0.02, 0.8


def backward(q):
    return np.diff(q, prepend=2 * q[0] - q[1]) / DT


FILTERS = {
    "backward": backward,
    "central": lambda q: np.gradient(q, DT),
    "savgol": lambda q: savgol_filter(q, 7, 2, deriv=1, delta=DT),
}


def weaker(u, t, h, memory):
    return GAIN * u


def recorded(make, noise=1.0):
    """A slider whose force is weaker than commanded, as it was, and with velocities that were differentiated."""
    truth = record(World("slider", filters=[weaker]), seed=2, episodes=6, steps=120, noise=noise)
    episodes = []
    for e in truth.episodes:
        states = np.array(e.states)
        states[:, 1] = make(states[:, 0])
        episodes.append(replace(e, states=states))
    return truth, replace(truth, episodes=tuple(episodes), velocities="differentiated", noise={})


@pytest.mark.parametrize(
    ("name", "weights"),
    [
        ("backward", [-1.0 / DT, 1.0 / DT, 0.0]),
        ("central", [-0.5 / DT, 0.0, 0.5 / DT]),
        ("savgol", savgol_coeffs(7, 2, deriv=1, delta=DT, use="dot")),
    ],
)
def test_the_filter_is_found(name, weights):
    recording = recorded(FILTERS[name])[1]
    (found,) = filters(replace(recording, dt=1.005 * DT), make_simulator("slider"))  # dt may be rounded
    np.testing.assert_allclose(found.weights, weights, atol=1e-6)


def test_what_was_measured_or_made_otherwise_has_no_filter():
    simulator = make_simulator("slider")
    truth, _ = recorded(FILTERS["central"])
    assert not filters(truth, simulator)
    assert not filters(replace(truth, velocities="differentiated"), simulator)
    _, bent = recorded(lambda q: median_filter(np.gradient(q, DT), 5))
    assert not filters(bent, simulator)
    _, late = recorded(FILTERS["central"])
    moved = tuple(replace(e, t=e.t + 0.3 * DT * (np.arange(len(e.t)) % 2)) for e in late.episodes)
    assert not filters(replace(late, episodes=moved), simulator)


@pytest.mark.parametrize("name", FILTERS)
def test_what_the_right_model_says_of_a_filter_gives_the_velocity_back(name):
    truth, recording = recorded(FILTERS[name], noise=0.0)
    simulator = make_simulator("slider")
    parameters = simulator.defaults(recording.parameters)
    problem = prepare(recording, simulator, parameters).everything
    (gain,) = (c for c in candidates(recording, simulator, parameters) if c.family == "actuator_gain")
    steps = cut(recording, WindowSettings(), 1)
    was = cut(truth, WindowSettings(), 1)
    right = Hypothesis().plus(gain.term([GAIN]), gain.declared)
    made_by = filters(recording, simulator)
    back = undone(problem, recording, steps, right, made_by)
    known = dict(zip(zip(was.episode, was.t[:, 0], strict=True), was.measured, strict=True))
    true = np.array([known[key] for key in zip(back.episode, back.t[:, 0], strict=True)])
    off = np.abs(back.measured - true)[..., 1].max()
    assert off < 1e-3 * np.abs(steps.measured - was.measured)[..., 1].max()
    assert 0.8 * len(steps) < len(back) < len(steps)


@pytest.mark.slow
@pytest.mark.parametrize("name", FILTERS)
def test_the_fit_shows_what_was_named_and_not_what_the_filter_did(name):
    """The right law was once no better than none, 1.21 after 1.19 m/s^2, because the filter's own error hid it."""
    _, recording = recorded(FILTERS[name], noise=0.01)
    simulator = make_simulator("slider")
    report = diagnose(
        recording, simulator, simulator.defaults(recording.parameters), np.random.default_rng(0)
    ).diagnosis
    errors = report.fit.one_step["q_acc"]
    assert errors.after < (0.2 if name == "backward" else 0.1) * errors.before  # that one doubles the noise
    assert errors.after < 1.5 * errors.noise_floor


def test_a_finer_step_is_judged_by_its_own_motion():
    """With velocities undone by the coarse base its error was the base's, and the page said that it would not help."""
    recording = record(World("pendulum"), seed=3, episodes=6, steps=155, noise=0.0, differentiated=True)
    simulator = make_simulator("pendulum")
    report = diagnose(
        recording, simulator, simulator.defaults(recording.parameters), np.random.default_rng(0)
    ).diagnosis
    assert report.verdict == "none"
    errors = report.fit.one_step["theta_acc"]
    assert errors.finely < 0.01 * errors.before
