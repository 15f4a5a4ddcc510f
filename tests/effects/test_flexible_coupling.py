"""A flexible coupling: against scipy however stiff it is, over windows' starts, and recovered with its sizes."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from gpsim.corrected import EffectsPlant
from gpsim.diagnosis import diagnose
from gpsim.diagnosis.data import cut
from gpsim.diagnosis.fitting import Hypothesis
from gpsim.diagnosis.fitting.simulate import simulate
from gpsim.diagnosis.run import Run
from gpsim.diagnosis.settings import Known, WindowSettings
from gpsim.effects import FAMILIES, Chain, Term
from gpsim.recordings import Episode, HeldOut, Recording
from gpsim.simulators import make_simulator
from gpsim.trials.bodies import Body, Now
from gpsim.trials.worlds import TrueEffect

SLIDER, PENDULUM, MASS, HELD = make_simulator("slider"), make_simulator("pendulum"), 2.0, 0.05
SOFT = {"stiffness": 40.0, "damping": 0.6, "inertia": 0.8}  # 1.3 Hz, fades in a second
STIFF = {"stiffness": 4000.0, "damping": 3.0, "inertia": 0.5}
HANGING = {"gravity": 9.81, "mass": 1.0, "length": 0.5}


def swung(k, pushes, damping=0.0):
    """(K + 1, 4) place and speed of a slider and of the motor behind it, by scipy; each push is held for a while."""

    def slope(_, s, u):
        q, v, motor, speed = s
        pull = k["stiffness"] * (motor - q) + k["damping"] * (speed - v)
        return [v, (pull - damping * v) / MASS, speed, (u - pull) / k["inertia"]]

    state, out = np.zeros(4), [np.zeros(4)]
    for u in pushes:
        found = solve_ivp(slope, (0.0, HELD), state, "LSODA", args=(u,), rtol=1e-9, atol=1e-11)
        state = found.y[:, -1]
        out.append(state)
    return np.array(out)


def stepped(k, pushes, h, scheme="fine"):
    """The same by the chain, the twist behind the slider's state."""
    chain = Chain(SLIDER, {"mass": MASS}, (Term("flexible_coupling", "force", k),), scheme, HELD)
    values = [{name: np.array([value]) for name, value in k.items()}]
    state, bends, out = np.zeros((1, 2)), chain.unbent(1), [np.zeros(4)]
    for u in pushes:
        for _ in range(round(HELD / h)):
            state = chain.advance(state, np.array([[u]]), values, np.array([h]), np.zeros(1), None, bends)
        twist = bends["0/bend"][0]
        out.append(np.array([*state[0], state[0, 0] + twist[0], state[0, 1] + twist[1]]))
    return np.array(out)


@pytest.mark.parametrize("k", [SOFT, STIFF], ids=["soft", "stiff"])
def test_it_swings_as_scipy_does(k):
    pushes = 6.0 * np.sin(0.25 * np.arange(40))
    expected = swung(k, pushes)
    size = np.abs(expected).max(axis=0)
    coarse, fine = (np.abs(stepped(k, pushes, h) - expected).max(axis=0) / size for h in (0.025, 0.0025))
    assert (coarse < 1e-3).all()
    assert (fine < 1e-5).all()


@pytest.mark.parametrize("scheme", ["fine", "euler", "semi_implicit", "rk4"])
@pytest.mark.parametrize("damping", [0.0, 1.0, 1e7], ids=["none", "some", "much"])
def test_no_stiffness_makes_a_step_unstable(scheme, damping):
    """As stiff as can be it is a rotor on the slider: a push moves both; twists stay within what the push makes."""
    k = {"stiffness": 1e9, "damping": damping, "inertia": 0.5}
    got = stepped(k, np.full(40, 10.0), HELD, scheme)
    assert got[-1, 1] == pytest.approx(10.0 / (MASS + 0.5) * 2.0, rel=1e-3)
    assert np.abs(got[:, 2] - got[:, 0]).max() < 1e-6


def test_without_a_motor_all_of_the_command_arrives():
    k = {"stiffness": 50.0, "damping": 1.0, "inertia": 1e-9}
    pushes = 6.0 * np.sin(0.25 * np.arange(20))
    got = stepped(k, pushes, 0.005)[:, 1]
    np.testing.assert_allclose(got[1:], np.cumsum(pushes) * HELD / MASS, atol=2e-3)


def test_a_plant_keeps_its_twist_on_a_pendulum():
    k, rng = {"stiffness": 8.0, "damping": 0.05, "inertia": 0.1}, np.random.default_rng(0)
    pushes = 2.0 * np.sin(0.5 * np.arange(20))
    plant = EffectsPlant(PENDULUM, HANGING, (Term("flexible_coupling", "torque", k),), "fine", 20, HELD)
    state, memory = np.zeros((2, 2)), plant.begin(2, rng)
    for u in pushes:
        state = plant.step(state, np.full((2, 1), u), memory, rng)

    def slope(_, s, u):
        q, v, motor, speed = s
        pull = k["stiffness"] * (motor - q) + k["damping"] * (speed - v)
        return [v, pull / 0.25 - 9.81 / 0.5 * np.sin(q), speed, (u - pull) / k["inertia"]]

    expected = np.zeros(4)
    for u in pushes:
        expected = solve_ivp(slope, (0.0, HELD), expected, args=(u,), rtol=1e-9, atol=1e-11).y[:, -1]
    np.testing.assert_allclose(state, np.tile(expected[:2], (2, 1)), atol=3e-3)


def recorded(k, count, seed, noise=(0.0, 0.0), damping=0.0):
    """A slider with such a drive under steps of a random force."""
    rng = np.random.default_rng(seed)
    pushes = np.repeat(rng.uniform(-8.0, 8.0, count // 5 + 1), 5)[:count]
    true, t = swung(k, pushes, damping), HELD * np.arange(count + 1)
    said = true[:, :2] + rng.normal(size=(count + 1, 2)) * noise
    episode = Episode("0", t, said, pushes[:, None])
    return true, Recording(
        "slider", SLIDER.state, SLIDER.action, (episode,), HELD, {"mass": MASS}, held_out=HeldOut(episodes_from=1)
    )  # fmt: skip


@pytest.mark.parametrize("noise", [0.0, 1.0])
def test_windows_begin_with_the_twist_that_the_way_before_tells(noise):
    true, recording = recorded(SOFT, 240, 1, (0.001 * noise, 0.01 * noise))
    hypothesis = Hypothesis((Term("flexible_coupling", "force", SOFT),), ((),))
    chain = hypothesis.chain(SLIDER, {"mass": MASS}, HELD)
    windows = cut(recording, WindowSettings(), 10)
    begins = np.searchsorted(recording.episodes[0].t, windows.t[:, 0])
    got = simulate(Run(), chain, windows, true[None, begins, :2], hypothesis.spread, np.empty((1, 0)), 8)[0]
    left = [
        got[i, : windows.length + 1] - true[b : b + windows.length + 1, :2] for i, b in enumerate(begins[:-1])
    ]
    assert len(windows) >= 9
    assert np.abs(left)[..., 1].max() < (1e-6 + 3e-3 * noise) * np.abs(true[:, 1]).max()


@pytest.mark.parametrize("system", ["slider", "pendulum", "cartpole"])
def test_the_truth_is_the_same_law(system):
    """A Runge-Kutta step of the trials' own equations against the chain, both fine."""
    simulator, rng, h = make_simulator(system), np.random.default_rng(2), 1e-3
    k, (on,) = {"stiffness": 60.0, "damping": 0.8, "inertia": 0.4}, simulator.action.names
    body = Body(system, simulator.defaults(), [TrueEffect("flexible_coupling", on, k)])
    chain = Chain(simulator, simulator.defaults(), (Term("flexible_coupling", on, k),), "fine", HELD)
    values = [{name: np.full(3, value) for name, value in k.items()}]
    state = truth = 0.1 * rng.normal(size=(3, len(simulator.state)))
    bends, hidden, t = chain.unbent(3), body.begin(state), np.zeros(3)
    for _ in range(10):
        u = 5.0 * rng.normal(size=(3, 1))
        for _ in range(20):
            truth, hidden = body.step(truth, hidden, Now(u, t, t), h)
            state = chain.advance(state, u, values, np.full(3, h), t, None, bends)
    np.testing.assert_allclose(state, truth, atol=1e-4)
    np.testing.assert_allclose(bends["0/bend"][:, 0], hidden[:, 0], atol=1e-4)
    assert np.abs(hidden[:, 0]).min() > 1e-3


@pytest.mark.slow
def test_it_is_asked_on_request_and_a_short_log_gives_its_sizes():
    _, recording = recorded(SOFT, 800, 4, (0.001, 0.01), damping=1.0)
    recording = replace(recording, held_out=None, noise={"q": 0.001, "q_dot": 0.01})
    assert not FAMILIES["flexible_coupling"].asked
    asked = Known(only=("flexible_coupling", "viscous_friction", "actuator_delay", "actuator_lag"))
    answer = diagnose(recording, SLIDER, {"mass": MASS}, np.random.default_rng(0), run=Run(known=asked))
    found = {e.family: {n: p.value for n, p in e.parameters.items()} for e in answer.diagnosis.effects}
    assert set(found) == {"flexible_coupling", "viscous_friction"}
    assert answer.diagnosis.verdict == "named"
    assert found["flexible_coupling"] == pytest.approx(SOFT, rel=0.1)
    assert found["viscous_friction"] == pytest.approx({"damping": 1.0}, rel=0.1)
