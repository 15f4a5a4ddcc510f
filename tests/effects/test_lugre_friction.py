"""LuGre friction: against scipy however stiff it is, over windows' starts, and where it is asked."""

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
from gpsim.diagnosis.setup import candidates
from gpsim.effects import FAMILIES, Chain, Term
from gpsim.recordings import Episode, HeldOut, Recording
from gpsim.simulators import make_simulator
from gpsim.trials import catalogue

SLIDER, MASS, HELD = make_simulator("slider"), 2.0, 0.05
SOFT = {"force": 2.0, "stiffness": 100.0}
WHOLE = {"force": 2.0, "static_force": 3.0, "stribeck_velocity": 0.1, "stiffness": 300.0}
STIFF = WHOLE | {"stiffness": 1e5}


def slid(k, pushes):
    """(K + 1, 3) position, speed and bend of a slider by scipy, each push held for a while."""
    state, out = np.zeros(3), [np.zeros(3)]
    damping = np.sqrt(k["stiffness"] * MASS)

    def slope(t, s, u):
        _, v, z = s
        more = max(k.get("static_force", 0.0) - k["force"], 0.0)
        level = k["force"] + more * np.exp(-((v / k.get("stribeck_velocity", 1.0)) ** 2))
        rate = v - k["stiffness"] * abs(v) / level * z
        return [v, (u - k["stiffness"] * z - damping * rate) / MASS, rate]

    for u in pushes:
        found = solve_ivp(slope, (0.0, HELD), state, "LSODA", args=(u,), rtol=1e-8, atol=1e-11)
        state = found.y[:, -1]
        out.append(state)
    return np.array(out)


def stepped(k, pushes, h):
    """The same by the chain."""
    chain = Chain(SLIDER, {"mass": MASS}, (Term("lugre_friction", "q", k),), "fine", HELD)
    values = [{name: np.array([value]) for name, value in k.items()}]
    state, bends, out = np.zeros((1, 2)), chain.unbent(1), [np.zeros(3)]
    for u in pushes:
        for _ in range(round(HELD / h)):
            state = chain.advance(state, np.array([[u]]), values, np.array([h]), np.zeros(1), None, bends)
        out.append(np.array([*state[0], bends["0/bend"][0]]))
    return np.array(out)


@pytest.mark.parametrize("k", [SOFT, WHOLE, STIFF], ids=["soft", "whole", "stiff"])
def test_it_slides_as_scipy_does(k):
    pushes = 6.0 * np.sin(0.25 * np.arange(20))
    expected = slid(k, pushes)
    coarse, fine = (np.abs(stepped(k, pushes, h) - expected).max(axis=0) for h in (0.01, 0.0025))
    assert (coarse[:2] < 1e-3).all()
    assert (fine[:2] < 1e-4).all()


@pytest.mark.parametrize("scheme", ["fine", "euler", "semi_implicit", "rk4"])
def test_no_stiffness_makes_a_step_unstable(scheme):
    """A push that friction holds, and one that it does not; steps are ten thousand times too long for the bristles."""
    k = {"force": 9.0, "stiffness": 1e9}
    chain = Chain(SLIDER, {"mass": MASS}, (Term("lugre_friction", "q", k),), scheme, 0.02)
    values = [{name: np.full(2, value) for name, value in k.items()}]
    state, bends = np.zeros((2, 2)), chain.unbent(2)
    for _ in range(100):
        state = chain.advance(
            state, np.array([[8.0], [11.0]]), values, np.full(2, 0.02), np.zeros(2), None, bends
        )
    assert np.abs(state[0]).max() < 1e-4
    assert state[1, 1] == pytest.approx((11.0 - 9.0) / MASS * 2.0, rel=1e-3)


def test_the_truth_is_the_same_law():
    """How fast bristles bend and what they push, by what the trials have of it."""
    law = catalogue.BRISTLES["lugre_friction"]
    k, v, z = WHOLE, np.array([0.2, -0.03]), np.array([0.001, 0.004])
    push, rate = law(k, v, z, np.full(2, MASS))
    h = 1e-7
    chain = Chain(SLIDER, {"mass": MASS}, (Term("lugre_friction", "q", k),), "fine", HELD)
    values = [{name: np.full(2, value) for name, value in k.items()}]
    bends = {"0/bend": z.copy()}
    after = chain.advance(
        np.stack([0 * v, v], axis=1), np.zeros((2, 1)), values, np.full(2, h), np.zeros(2), None, bends
    )
    np.testing.assert_allclose((after[:, 1] - v) / h * MASS, push, rtol=1e-4)
    np.testing.assert_allclose((bends["0/bend"] - z) / h, rate, rtol=1e-4)


def recorded(k, count, seed, noise=(0.0, 0.0)):
    """A slider with such friction under steps of a random force."""
    rng = np.random.default_rng(seed)
    pushes = np.repeat(rng.uniform(-8.0, 8.0, count // 5 + 1), 5)[:count]
    true = slid(k, pushes)
    t = HELD * np.arange(count + 1)
    said = true[:, :2] + rng.normal(size=(count + 1, 2)) * noise
    episode = Episode("0", t, said, pushes[:, None])
    return true, Recording("slider", SLIDER.state, SLIDER.action, (episode,), HELD, {"mass": MASS})


def test_windows_begin_with_the_bend_that_the_way_before_tells():
    true, recording = recorded(WHOLE, 120, 1)
    hypothesis = Hypothesis((Term("lugre_friction", "q", WHOLE),), ((),))
    chain = hypothesis.chain(SLIDER, {"mass": MASS}, HELD)
    held_out = Recording(
        "slider", SLIDER.state, SLIDER.action, recording.episodes, HELD, {"mass": MASS},
        held_out=HeldOut(episodes_from=1),
    )  # fmt: skip
    windows = cut(held_out, WindowSettings(), 10)
    starts = true[np.searchsorted(recording.episodes[0].t, windows.t[:, 0]), :2]
    got = simulate(Run(), chain, windows, starts[None], hypothesis.spread, np.empty((1, 0)), 8)[0]
    left = np.where(windows.valid[..., None], got - windows.measured, 0.0)
    assert len(windows) >= 9
    assert np.abs(left[..., 1]).max() < 0.03 * np.abs(true[:, 1]).max()


def test_a_plant_keeps_how_far_its_bristles_are_bent():
    pushes = 6.0 * np.sin(0.5 * np.arange(8))
    term, rng = Term("lugre_friction", "q", WHOLE), np.random.default_rng(0)
    plant = EffectsPlant(SLIDER, {"mass": MASS}, (term,), "fine", 20, HELD)
    state, memory = np.zeros((2, 2)), plant.begin(2, rng)
    for u in pushes:
        state = plant.step(state, np.full((2, 1), u), memory, rng)
    np.testing.assert_allclose(state, np.tile(slid(WHOLE, pushes)[-1, :2], (2, 1)), atol=1e-4)


def test_it_is_asked_on_request_and_from_several_ways():
    _, recording = recorded(SOFT, 100, 3)
    offered = candidates(recording, SLIDER, {"mass": MASS})
    starts = [p.starts for c in offered if c.identity == ("lugre_friction", "q") for p in c.declared]
    assert max(map(len, starts)) == 3
    assert not FAMILIES["lugre_friction"].asked


@pytest.mark.slow
def test_a_log_gives_its_sizes():
    _, recording = recorded(SOFT, 800, 3, (1e-4, 1e-3))
    recording = replace(recording, noise={"q": 1e-4, "q_dot": 1e-3})
    asked = Known(only=("lugre_friction", "coulomb_friction", "viscous_friction"))
    answer = diagnose(recording, SLIDER, {"mass": MASS}, np.random.default_rng(0), run=Run(known=asked))
    (effect,) = answer.diagnosis.effects
    assert effect.family == "lugre_friction"
    assert {n: p.value for n, p in effect.parameters.items()} == pytest.approx(SOFT, rel=0.1)
