"""A sensor's lag: against closed forms, behind a late sensor, over windows' starts, and where it is asked."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from gpsim.diagnosis.data import cut
from gpsim.diagnosis.fitting import Hypothesis
from gpsim.diagnosis.fitting.simulate import simulate
from gpsim.diagnosis.run import Run
from gpsim.diagnosis.settings import WindowSettings
from gpsim.diagnosis.setup.offers import candidates
from gpsim.diagnosis.setup.sizes import trails
from gpsim.effects import Chain, Term
from gpsim.recordings import Episode, HeldOut, Recording
from gpsim.simulators import make_simulator
from gpsim.trials import catalogue

SLIDER, TURN, T = make_simulator("slider"), 3.0, 0.05


def read(terms, steps):
    """What is read of q = sin(3 t) and its speed after these steps (K,) s, and when."""
    chain = Chain(SLIDER, {"mass": 1.0}, terms, "fine", 0.02)
    values = [{k: np.array([v]) for k, v in term.values.items()} for term in terms]
    t = np.cumsum(steps)
    states = np.stack([np.sin(TURN * t), TURN * np.cos(TURN * t)], axis=1)[None]
    half = len(steps) // 2
    memory = chain.sensors.begin(states[:, :half], values, steps[:1], steps[None, :half])
    for k in range(half, len(steps)):
        chain.sensors.watch(states[:, k], values, memory, steps[[k]])
    return chain.sensors.measure(states[:, -1], values, memory, steps[-1:])[0], t[-1]


@pytest.mark.parametrize("delay", [0.0, 0.037])
@pytest.mark.parametrize("uneven", [False, True])
def test_a_wave_arrives_smaller_and_later(delay, uneven):
    """A steady wave through T y' = x - y: its size falls to 1 / sqrt(1 + (w T)^2), its phase by atan(w T)."""
    steps = np.full(400, 0.005)
    if uneven:
        steps *= np.random.default_rng(1).uniform(0.3, 1.7, 400)
    terms = (Term("sensor_delay", "q", {"delay": delay}), Term("sensor_lag", "q", {"time_constant": T}))
    said, t = read(terms if delay else terms[1:], steps)
    size, phase = 1.0 / np.hypot(1.0, TURN * T), np.arctan(TURN * T)
    assert said[0] == pytest.approx(size * np.sin(TURN * (t - delay) - phase), abs=3e-5)
    assert said[1] == TURN * np.cos(TURN * t)


def test_the_truth_is_the_same_law():
    t = 0.001 * np.arange(2001)
    said = catalogue.PAST_SENSORS["sensor_lag"]({"time_constant": T}, np.sin(TURN * t)[:, None], 0.001)
    size, phase = 1.0 / np.hypot(1.0, TURN * T), np.arctan(TURN * T)
    assert said[0] == pytest.approx(size * np.sin(TURN * t[-1] - phase), abs=1e-5)


def test_a_lag_of_nothing_reads_the_truth():
    said, t = read((Term("sensor_lag", "q_dot", {"time_constant": 0.0}),), np.full(40, 0.005))
    assert said[1] == pytest.approx(TURN * np.cos(TURN * t), abs=1e-7)


@pytest.mark.parametrize("jitter", [0.0, 0.6])
def test_windows_say_what_one_long_integration_says(jitter):
    """Readings by scipy; windows that begin in the middle know their start's true state and what was read before."""
    rng, count, lag = np.random.default_rng(4), 90, 0.03
    t = np.concatenate([[0.0], np.cumsum(0.02 * rng.uniform(1 - jitter, 1 + jitter, count))])
    actions, state, states = rng.normal(size=(count, 1)), np.zeros(3), [np.zeros(3)]
    for k in range(count):
        found = solve_ivp(
            lambda _, s, u=actions[k, 0]: [s[1], u, (s[1] - s[2]) / lag],
            (t[k], t[k + 1]), state, rtol=1e-10, atol=1e-12,
        )  # fmt: skip
        state = found.y[:, -1]
        states.append(state)
    true, said = np.array(states)[:, :2], np.array(states)[:, [0, 2]]
    recording = Recording(
        "slider", SLIDER.state, SLIDER.action, (Episode("0", t, said, actions),), 0.02, {"mass": 1.0},
        held_out=HeldOut(episodes_from=1),
    )  # fmt: skip
    hypothesis = Hypothesis((Term("sensor_lag", "q_dot", {"time_constant": lag}),), ((),))
    chain = hypothesis.chain(SLIDER, {"mass": 1.0}, 0.02)
    windows = cut(recording, WindowSettings(), 9)
    starts = true[np.searchsorted(t, windows.t[:, 0])]
    got = simulate(Run(), chain, windows, starts[None], hypothesis.spread, np.empty((1, 0)), 4)[0]
    left = np.where(windows.valid[..., None], got - windows.measured, 0.0)
    assert len(windows) >= 9
    assert np.abs(left[0]).max() < 1e-6  # an episode begins at rest
    assert np.abs(left).max() < 0.02 * np.abs(said - true).max()


def drive(lagging: str | None, noise: float = 1.0) -> Recording:
    """A slider under steps of a random force, one of its channels read with a lag of 0.01 s."""
    rng, h, every = np.random.default_rng(7), 0.001, 20
    u = np.repeat(rng.normal(size=1500), every)
    true = np.zeros((len(u) + 1, 2))
    for k in range(len(u)):
        v = true[k, 1]
        acceleration = 5.0 * u[k] - 0.5 * v
        true[k + 1] = true[k] + h * np.array([v + h / 2 * acceleration, acceleration])
    said = true.copy()
    if lagging:
        column = SLIDER.state.index(lagging)
        for k in range(len(u)):
            said[k + 1, column] += np.exp(-h / 0.01) * (said[k, column] - true[k + 1, column])
    said = said[::every] + noise * rng.normal(0.0, [0.0005, 0.005], (1501, 2))
    t = 0.02 * np.arange(1501)
    return Recording(
        "slider", SLIDER.state, SLIDER.action, (Episode("0", t, said, u[::every, None]),), 0.02, {"mass": 1.0}
    )


@pytest.mark.parametrize("noise", [0.02, 1.0])
@pytest.mark.parametrize("lagging", [None, "q", "q_dot"])
def test_it_is_asked_of_the_channel_that_trails(lagging, noise):
    offers = candidates(drive(lagging, noise), SLIDER, {"mass": 0.2})
    assert [c.place.on for c in offers if c.family == "sensor_lag"] == ([lagging] if lagging else [])


def test_a_speed_that_is_off_or_scaled_does_not_trail():
    t = 0.02 * np.arange(200)
    q, v = np.sin(3 * t), 3 * np.cos(3 * t)
    assert trails([(q, 1.3 * v + 0.1, t)]) == 0
    assert trails([(q, 3 * np.cos(3 * (t - 0.01)), t)]) == 1
    assert trails([(q, np.zeros(200), t)]) == trails([(q[:1], v[:1], t[:1])]) == 0
