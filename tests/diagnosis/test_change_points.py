"""When a term that was fitted everywhere began, from one linearisation."""

import numpy as np
import pytest

from gpsim.diagnosis.fitting.hypothesis import Hypothesis
from gpsim.diagnosis.fitting.multiple_shooting import fit
from gpsim.diagnosis.selection.change_points import LEAST_GAIN_OF_AN_ONSET, begun_later, onsets
from gpsim.diagnosis.setup.candidates import candidates
from gpsim.diagnosis.setup.prepare import prepare
from gpsim.simulators import make_simulator

from .worlds import World, record

SLIDER = make_simulator("slider")


def posed(seed, *, forces=None, filters=(), session=True, noise=1.0):
    """The problem that a slider's recording poses, and what may be added to it."""
    world = World("slider", forces=forces or {}, filters=list(filters))
    recording = record(world, seed=seed, episodes=10, steps=155, session=session, noise=noise)
    problem = prepare(recording, SLIDER, SLIDER.defaults(recording.parameters)).everything
    return problem, candidates(recording, SLIDER, SLIDER.defaults(recording.parameters))


def everywhere(problem, offers, *laws):
    """The fit of laws (family, values) that act all the time."""
    hypothesis = Hypothesis()
    for family, values in laws:
        law = next(c for c in offers if c.family == family and not c.variant)
        hypothesis = hypothesis.plus(law.term(values), law.declared)
    return fit(problem, hypothesis, problem.windows.measured[:, 0])


@pytest.mark.parametrize("since", [8.0, 12.0])
def test_a_dead_zone_that_began_late(since):
    """Beside drag that always acted, which keeps its place."""

    def narrow(u, t, h, m):
        return np.where((np.asarray(t)[:, None] >= since) & (np.abs(u) < 1.0), 0.0, u)

    problem, offers = posed(3, forces={0: lambda q, v, t: -2.0 * v}, filters=[narrow])
    leader = everywhere(problem, offers, ("viscous_friction", [1.0]), ("actuator_dead_zone", [0.9]))
    found = {o.index: o for o in onsets(problem, leader, [0, 1])}
    assert found[0].gain < 0.0
    assert found[1].gain > LEAST_GAIN_OF_AN_ONSET
    assert found[1].gate.since == pytest.approx(since, abs=1.0)  # nothing was commanded that tells more
    (best,) = begun_later(problem, leader, offers)
    assert best.objective < leader.objective - LEAST_GAIN_OF_AN_ONSET
    drag, zone = best.hypothesis.terms
    assert not drag.gate
    assert zone.gate.since == pytest.approx(since, abs=1.0)
    assert drag.values["damping"] == pytest.approx(2.0, rel=0.05)
    assert zone.values["width"] == pytest.approx(1.0, rel=0.05)


def test_what_is_promised_a_fit_gains():
    """Of a force, which acting everywhere halved; and more, since the residual's variance falls."""
    problem, offers = posed(5, forces={0: lambda q, v, t: 0.4 * (t >= 15.0) - 2.0 * v})
    leader = everywhere(problem, offers, ("viscous_friction", [1.0]), ("constant_force", [0.5]))
    assert 0.1 < leader.hypothesis.theta[1] < 0.3
    onset = onsets(problem, leader, [0, 1])[1]
    gated = leader.hypothesis.having(onset.theta).gated(1, onset.gate)
    found = fit(problem, gated, leader.starts)
    assert onset.gate.since == pytest.approx(15.0, abs=1.0)
    assert LEAST_GAIN_OF_AN_ONSET < onset.gain < leader.objective - found.objective
    assert onset.theta == pytest.approx(found.hypothesis.theta, abs=0.05)
    assert found.hypothesis.theta == pytest.approx([2.0, 0.4], abs=0.05)


@pytest.mark.parametrize("seed", range(6))
def test_what_always_acted_began_at_no_moment(seed):
    problem, offers = posed(seed, forces={0: lambda q, v, t: 0.8 - 2.0 * v})
    leader = everywhere(problem, offers, ("viscous_friction", [1.0]), ("constant_force", [0.5]))
    assert all(o.gain < LEAST_GAIN_OF_AN_ONSET for o in onsets(problem, leader, [0, 1]))
    assert begun_later(problem, leader, offers) == []


def test_too_short_to_say():
    problem, offers = posed(1, forces={0: lambda q, v, t: -2.0 * v})
    leader = everywhere(problem, offers, ("viscous_friction", [1.0]))
    one = problem.on(problem.windows.take(np.arange(1)))
    assert onsets(one, fit(one, leader.hypothesis, one.windows.measured[:, 0]), [0]) == []
    assert onsets(problem, leader, []) == []
