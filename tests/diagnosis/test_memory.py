"""What was commanded before a window is simulated as far as an actuator remembers it, and no further."""

import numpy as np
import pytest

from gpsim.diagnosis import shooting, simulate
from gpsim.diagnosis.catalogue import candidates
from gpsim.diagnosis.hypothesis import Hypothesis
from gpsim.diagnosis.preparing import prepare
from gpsim.simulators import make_simulator

from .worlds import World, record

TERMS = {
    "gain and late sensor": [("actuator_gain", "force", [0.8]), ("sensor_delay", "q", [0.05])],
    "delay": [("actuator_delay", "force", [0.07])],
    "delay and lag": [("actuator_delay", "force", [0.05]), ("actuator_lag", "force", [0.03])],
    "backlash": [("actuator_backlash", "force", [0.5])],
}


def posed(steps):
    """A slider's windows and what may be missing there."""
    recording, slider = record(World("slider"), seed=2, episodes=3, steps=steps), make_simulator("slider")
    parameters = slider.defaults(recording.parameters)
    return prepare(recording, slider, parameters).everything, candidates(recording, slider, parameters)


@pytest.mark.parametrize("terms", TERMS.values(), ids=TERMS)
def test_the_rest_of_the_past_does_not_matter(monkeypatch, terms):
    problem, offers = posed(155)
    hypothesis = Hypothesis()
    for family, on, values in terms:
        candidate = next(c for c in offers if c.identity == (family, on))
        hypothesis = hypothesis.plus(candidate.term(values), candidate.declared)
    starts, lengths = problem.windows.measured[None, :, 0], []
    kept = simulate._what_matters

    def noted(chain, windows, *rest):
        out = kept(chain, windows, *rest)
        lengths.append(out.before_actions.shape[1])
        return out

    monkeypatch.setattr(simulate, "_what_matters", noted)
    short = problem.residuals(hypothesis, hypothesis.theta[None], starts)
    monkeypatch.setattr(simulate, "_what_matters", lambda chain, windows, *rest: windows)
    assert problem.residuals(hypothesis, hypothesis.theta[None], starts) == pytest.approx(short, abs=1e-6)
    whole = problem.windows.before_actions.shape[1]
    assert (lengths[0] == whole) == ("actuator_backlash" in terms[0])
    assert np.isfinite(short).all()


def test_two_samples_may_bear_one_stamp():
    """A log of the cart-pole rig has such pairs; how far back to look was once not a number there."""
    slider = make_simulator("slider")
    hypothesis = Hypothesis()
    chain = hypothesis.chain(slider, slider.defaults({"mass": 2.0}), 0.02)
    assert chain.reach([], np.array([0.02, 0.0])) == 2


def test_a_step_that_is_no_number_is_not_taken():
    """A window that flew off left a whole fit without a direction, and a delay that was not a number."""
    problem, offers = posed(60)
    delay = next(c for c in offers if c.identity == ("sensor_delay", "q"))
    hypothesis = Hypothesis().plus(delay.term([0.05]), delay.declared)
    starts = problem.windows.measured[:, 0]
    residual = problem.residuals(hypothesis, hypothesis.theta[None], starts[None])[0]
    here = shooting._point(problem, hypothesis.theta, starts, residual)
    nowhere = shooting.Step(np.full(1, np.nan), np.zeros((*starts.shape, 1)), np.zeros_like(starts))
    new, moved, _ = shooting._stepped(problem, hypothesis, here, nowhere, np.zeros(1), np.ones(1))
    assert not moved
    assert (new.theta == here.theta).all()
    assert np.isfinite(new.value)


def test_a_start_state_may_be_anywhere():
    problem, _ = posed(60)
    starts = np.array(problem.windows.measured[:, 0])
    starts[0] = np.nan, 1e300
    residual = problem.residuals(Hypothesis(), np.empty((1, 0)), starts[None])
    assert np.isfinite(residual**2).all()
