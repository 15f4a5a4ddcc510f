"""What was commanded before a window is simulated as far as an actuator remembers it, and no further."""

from dataclasses import replace
from importlib import import_module

import numpy as np
import pytest

from gpsim.diagnosis.assessment import comparison as comparing
from gpsim.diagnosis.data.windows import cut
from gpsim.diagnosis.fitting.gauss_newton import Step
from gpsim.diagnosis.fitting.hypothesis import Hypothesis
from gpsim.diagnosis.fitting.point import point_at
from gpsim.diagnosis.fitting.steps import stepped
from gpsim.diagnosis.run import Run
from gpsim.diagnosis.settings import WindowSettings
from gpsim.diagnosis.setup.candidates import candidates
from gpsim.diagnosis.setup.prepare import prepare
from gpsim.effects import Gate, Term, effect_of
from gpsim.effects.actuation import Actuation
from gpsim.effects.chain import Chain
from gpsim.effects.effect import ActuatorEffect
from gpsim.effects.registry import FAMILIES
from gpsim.recordings import Episode, HeldOut, Recording
from gpsim.simulators import make_simulator

from .worlds import World, record

TERMS = {
    "gain and late sensor": [("actuator_gain", "force", [0.8]), ("sensor_delay", "q", [0.05])],
    "delay": [("actuator_delay", "force", [0.07])],
    "delay and lag": [("actuator_delay", "force", [0.05]), ("actuator_lag", "force", [0.03])],
    "backlash": [("actuator_backlash", "force", [0.5])],
}

simulate = import_module("gpsim.diagnosis.fitting.simulate")  # the package has a function of that name


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


HELD = sorted(f for f in FAMILIES if isinstance(effect_of(f), ActuatorEffect) and effect_of(f).holds)
LAG = Term("actuator_lag", "force", {"time_constant": 0.05})


@pytest.mark.parametrize("family", [*HELD, "actuator_lag"])
def test_whole_control_steps_lead_up_to_a_window_as_small_ones_do(monkeypatch, family):
    """Every law that says it makes held commands of held ones, before a lag."""
    problem, offers = posed(155)
    candidate = next(c for c in offers if c.identity == (family, "force"))
    first = candidate.term([p.starts[0] for p in candidate.declared])
    terms = (first,) if family == "actuator_lag" else (first, LAG)
    hypothesis = Hypothesis(terms, tuple(() for _ in terms))
    assert hypothesis.chain(problem.simulator, problem.parameters, problem.dt).actuation.leaps
    starts = problem.windows.measured[None, :, 0]
    leapt = problem.residuals(hypothesis, np.zeros((1, 0)), starts)
    monkeypatch.setattr(Actuation, "leaps", False)
    np.testing.assert_allclose(problem.residuals(hypothesis, np.zeros((1, 0)), starts), leapt, atol=1e-7)


@pytest.mark.parametrize(
    "terms",
    [
        (Term("actuator_rate_limit", "force", {"rate": 30.0}), LAG),
        (Term("battery_sag", "force", {"loss_per_second": 0.01}), LAG),
        (replace(LAG, gate=Gate(region={"q": (-1.0, 1.0)})),),
        (replace(LAG, gate=Gate(since=1.0)),),
    ],
)
def test_they_do_not_where_a_law_changes_within_a_step(terms):
    slider = make_simulator("slider")
    assert not Chain(slider, slider.defaults(), terms, "fine", 0.02).actuation.leaps


@pytest.mark.parametrize(("jitter", "gated"), [(0.0, False), (0.6, False), (0.6, True)])
def test_what_came_before_a_window_is_as_late_as_in_one_long_simulation(jitter, gated):
    """With the true start states, windows cut from what one run over a whole episode says leave nothing."""
    rng, slider, dt, count = np.random.default_rng(4), make_simulator("slider"), 0.02, 90
    t = np.concatenate([[0.0], np.cumsum(dt * rng.uniform(1 - jitter, 1 + jitter, count))])
    actions = rng.normal(size=(count, 1))
    gate = Gate(region={"q": (-9.0, 9.0)}) if gated else Gate()  # open, but commands are taken step by step
    moved = (Term("actuator_delay", "force", {"delay": 0.053}, gate),)
    read = (Term("sensor_delay", "q", {"delay": 0.047}), *moved)

    def said(terms, windows, starts):
        hypothesis = Hypothesis(terms, tuple(() for _ in terms))
        chain = hypothesis.chain(slider, {"mass": 1.0}, dt)
        thetas = np.empty((1, 0))
        return simulate.simulate(Run(), chain, windows, starts[None], hypothesis.spread, thetas, 4)[0]

    def recorded(states):
        episode = Episode("0", t, states, actions)
        recording = Recording("slider", slider.state, slider.action, (episode,), dt, {"mass": 1.0})
        return replace(recording, held_out=HeldOut(episodes_from=1))  # in one piece

    whole = cut(recorded(np.zeros((count + 1, 2))), WindowSettings(), count)
    true, heard = (said(terms, whole, np.zeros((1, 2)))[0] for terms in (moved, read))
    windows = cut(recorded(heard), WindowSettings(), 9)
    windows = windows.take(windows.t[:, 0] > 0.3)  # a start states nothing of what was before an episode
    starts = true[np.searchsorted(t, windows.t[:, 0])]
    left = np.where(windows.valid[..., None], said(read, windows, starts) - windows.measured, 0.0)
    assert len(windows) >= 5
    assert np.abs(left).max() < 2e-5


def test_two_samples_may_bear_one_stamp():
    """A log of the cart-pole rig has such pairs; how far back to look was once not a number there."""
    slider = make_simulator("slider")
    hypothesis = Hypothesis()
    chain = hypothesis.chain(slider, slider.defaults({"mass": 2.0}), 0.02)
    assert chain.sensors.reach([], np.array([0.02, 0.0])) == 2


def test_a_step_that_is_no_number_is_not_taken():
    """A window that flew off left a whole fit without a direction, and a delay that was not a number."""
    problem, offers = posed(60)
    delay = next(c for c in offers if c.identity == ("sensor_delay", "q"))
    hypothesis = Hypothesis().plus(delay.term([0.05]), delay.declared)
    starts = problem.windows.measured[:, 0]
    residual = problem.residuals(hypothesis, hypothesis.theta[None], starts[None])[0]
    here = point_at(problem, hypothesis.theta, starts, residual)
    nowhere = Step(np.full(1, np.nan), np.zeros((*starts.shape, 1)), np.zeros_like(starts))
    new, moved, *_ = stepped(problem, hypothesis, here, nowhere, np.zeros(1), np.ones(1), alone=False)
    assert not moved
    assert (new.theta == here.theta).all()
    assert np.isfinite(new.value)


def test_a_start_state_may_be_anywhere():
    problem, _ = posed(60)
    starts = np.array(problem.windows.measured[:, 0])
    starts[0] = np.nan, 1e300
    residual = problem.residuals(Hypothesis(), np.empty((1, 0)), starts[None])
    assert np.isfinite(residual**2).all()


@pytest.mark.parametrize("terms", [(), (Term("actuator_delay", "force", {"delay": 0.03}),)])
def test_single_steps_of_which_nobody_knows_the_past_are_no_evidence(terms):
    """An actuator's first step in an episode, 0.05 m/s off, once made an exact model six times worse than it is."""
    recording = record(World("slider"), seed=1, episodes=6, steps=120)
    simulator = make_simulator("slider")
    question = prepare(recording, simulator, simulator.defaults(recording.parameters))
    base, after = Hypothesis(scheme="euler"), Hypothesis(terms, ((),) * len(terms))
    steps = comparing.steps_of(question, {"before": base, "after": after}, None)
    begun = [int(part.fresh.sum()) for part in (steps["after"].train, steps["after"].test)]
    assert begun == ([0, 0] if terms else [5, 1])
    assert steps["before"] is steps["after"]  # all models are judged on the same steps
