"""A clock that drifts: against exact integrals and scipy, where it is asked, and named again in a log of a minute."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from gpsim.corrected import EffectsPlant
from gpsim.diagnosis import diagnose
from gpsim.diagnosis.setup.offers import candidates
from gpsim.effects import Chain, Term
from gpsim.recordings import Episode, Recording
from gpsim.simulators import make_simulator
from gpsim.trials import catalogue

SLIDER, MASS, DT = make_simulator("slider"), 2.0, 0.02
SLOW = 1600.0  # ppm


def driven(pushes, t, drift, damping=0.0):
    """(K + 1, 2) a slider's states at t (K + 1,) s by scipy, under what a slow clock reads off the pushes (K,)."""
    slower = 1.0 - drift * 1e-6
    switches = t / slower  # when that clock, too, says that the next command is given

    def slope(_, s, u):
        return [s[1], (u - damping * s[1]) / MASS]

    state, out = np.zeros(2), [np.zeros(2)]
    for begin, end in pairwise(t):
        inside = switches[(switches > begin) & (switches < end)]
        edges = np.array([begin, *inside, end])
        for a, b in pairwise(edges):
            place = np.searchsorted(t, slower * (a + b) / 2, side="right") - 1
            u = pushes[place] if place >= 0 else 0.0
            state = solve_ivp(slope, (a, b), state, rtol=1e-9, atol=1e-12, args=(u,)).y[:, -1]
        out.append(state)
    return np.array(out)


@pytest.mark.parametrize("uneven", [False, True])
def test_commands_are_means_of_what_a_slow_clock_reads(uneven):
    """The command is a known function: its integral is exact, between any two readings of the slow clock."""
    rng = np.random.default_rng(1)
    steps = 0.005 * (rng.uniform(0.4, 1.6, 300) if uneven else np.ones(300))
    edges = 50.0 + np.concatenate([[0.0], np.cumsum(steps)])
    u = np.repeat(rng.normal(size=75), 4)
    area = np.concatenate([[0.0], np.cumsum(u * steps)])
    chain = Chain(SLIDER, {"mass": MASS}, (Term("clock_drift", "force", {"drift": SLOW}),), "fine", DT)
    got = chain.commands(
        u[None, :, None], np.zeros((1, 301, 2)), [{"drift": np.array([SLOW])}], chain.actuation.rest(1, 0.005), steps[None],
        edges[None, :-1],
    )[0, :, 0]  # fmt: skip
    read = np.interp(edges * (1.0 - SLOW * 1e-6), edges, area)
    known = edges[:-1] > edges[0] + 0.1
    expected = np.diff(read) / (steps * (1.0 - SLOW * 1e-6))
    np.testing.assert_allclose(got[known], expected[known], atol=5e-3)
    assert np.abs(u - expected)[known].max() > 1.0


def test_a_plant_that_is_driven_is_late_by_its_age():
    rng, age = np.random.default_rng(2), 60.0
    pushes, t = np.repeat(rng.normal(size=20), 3), age + DT * np.arange(61)
    plant = EffectsPlant(
        SLIDER, {"mass": MASS}, (Term("clock_drift", "force", {"drift": SLOW}),), "fine", 8, DT, ages=(age, age)
    )  # fmt: skip
    state, memory = np.zeros((1, 2)), plant.begin(1, rng)
    for u in pushes:
        state = plant.step(state, np.array([[u]]), memory, rng)
    expected = driven(pushes, t, SLOW)[-1]
    np.testing.assert_allclose(state[0], expected, atol=2e-4)
    assert np.abs(driven(pushes, t, 0.0)[-1] - expected).max() > 0.02


def test_the_truth_is_the_same_law():
    rng, h = np.random.default_rng(3), 0.001
    u, t = rng.normal(size=(2, 400)), np.array([[30.0], [90.0]]) + h * np.arange(400)
    truth, nowhere = catalogue.ACTUATORS["clock_drift"]({"drift": SLOW}), np.zeros((2, 2))
    said = np.stack([truth.act(u[:, k], nowhere, t[:, k], h) for k in range(400)], axis=1)
    chain = Chain(SLIDER, {"mass": MASS}, (Term("clock_drift", "force", {"drift": SLOW}),), "fine", DT)
    ours = chain.commands(
        u[..., None], np.zeros((2, 401, 2)), [{"drift": np.full(2, SLOW)}], chain.actuation.rest(2, h), np.full((2, 400), h), t
    )  # fmt: skip
    np.testing.assert_allclose(said, ours[..., 0], atol=1e-9)
    assert not said[0, :48].any()
    assert said[0, 50:].all()


def recorded(drift, count, noise=True):
    rng = np.random.default_rng(5)
    pushes, t = np.repeat(rng.normal(size=count // 4) * 3.0, 4), DT * np.arange(count + 1)
    said = driven(pushes, t, drift, damping=1.5)
    said += noise * rng.normal(size=said.shape) * [0.0005, 0.005]
    return Recording(
        "slider", SLIDER.state, SLIDER.action, (Episode("0", t, said, pushes[:, None]),), DT, {"mass": MASS},
        noise={"q": 0.0005, "q_dot": 0.005},
    )  # fmt: skip


@pytest.mark.parametrize(("count", "asked"), [(1200, False), (2400, True)])
def test_it_is_not_asked_where_a_log_is_short(count, asked):
    found = candidates(recorded(0.0, count), SLIDER, {"mass": MASS})
    assert ("clock_drift" in {c.family for c in found}) == asked


@pytest.mark.slow
@pytest.mark.parametrize("drift", [300.0, 0.0])
def test_a_log_of_a_minute_names_it_among_all_families(drift):
    answer = diagnose(recorded(drift, 3200), SLIDER, {"mass": MASS}, np.random.default_rng(0))
    found = {e.family: e for e in answer.diagnosis.effects}
    assert answer.diagnosis.verdict == "named"
    assert set(found) == {"viscous_friction", *(["clock_drift"] if drift else [])}
    if drift:
        assert found["clock_drift"].parameters["drift"].value == pytest.approx(drift, rel=0.1)
