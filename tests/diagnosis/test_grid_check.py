"""What a coarse grid leaves over is no physics."""

import numpy as np
import pytest

from gpsim.diagnosis.fitting.hypothesis import Hypothesis
from gpsim.diagnosis.fitting.multiple_shooting import fit
from gpsim.diagnosis.selection.grid_check import simplest_on_fine_grid
from gpsim.diagnosis.setup.candidates import candidates
from gpsim.diagnosis.setup.prepare import prepare, settled_question
from gpsim.effects import Term
from gpsim.simulators import make_simulator

from .truths import delayed
from .worlds import World, record

LATE = 0.074


@pytest.fixture(scope="module")
def question():
    late = delayed(LATE)
    world = World("cartpole", filters=[lambda u, t, h, m: late(u, t, h, m)])
    recording = record(world, seed=2, episodes=10, steps=200, noise=0.01, hold=1, differentiated=True)
    simulator = make_simulator("cartpole")
    return prepare(recording, simulator, simulator.defaults(recording.parameters))


def fitted(question, *terms):
    problem = question.searched
    offers = candidates(question.recording, problem.simulator, problem.parameters)
    declared = {(c.family, c.place.on): c.declared for c in offers}
    hypothesis = Hypothesis(terms, tuple(declared[t.family, t.on] for t in terms))
    return fit(problem, hypothesis, problem.windows.measured[:, 0], iterations=25)


DELAY = Term("actuator_delay", "force", {"delay": 0.07})
MORE_WORDS = {
    "two late sensors": [Term("sensor_delay", on, {"delay": 0.07}) for on in ("x", "theta")],
    "a gain": [DELAY, Term("actuator_gain", "force", {"gain": 1.01})],
}


@pytest.mark.parametrize("name", MORE_WORDS)
def test_a_late_command_is_nothing_more_because_it_changes_inside_a_substep(question, name):
    """With a sensor read to 20 micrometres a late force was once called two sensors that are late by as much."""
    command, more = fitted(question, DELAY), fitted(question, *MORE_WORDS[name])
    assert more.objective < command.objective - 100.0  # on the usual grid it is far ahead
    as_it_is, as_good = simplest_on_fine_grid(question.searched, more, [more, command])
    assert as_it_is is command
    assert as_good.objective < command.objective - 100.0
    np.testing.assert_allclose(as_good.hypothesis.theta, LATE, rtol=1e-4)
    assert settled_question(question, as_it_is).everything.substeps > question.everything.substeps


def test_what_a_fine_grid_does_not_mend_is_no_better_for_being_simple(question):
    command, sensors = fitted(question, DELAY), fitted(question, *MORE_WORDS["two late sensors"])
    lag = fitted(question, Term("actuator_lag", "force", {"time_constant": 0.05}))
    assert simplest_on_fine_grid(question.searched, command, [command, lag]) == (command, command)
    chosen, _ = simplest_on_fine_grid(question.searched, sensors, [sensors, lag])
    assert chosen is sensors
