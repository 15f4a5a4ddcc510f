"""How soon a fit gets somewhere."""

import numpy as np
import pytest

from gpsim.diagnosis.fitting.hypothesis import Hypothesis
from gpsim.diagnosis.fitting.multiple_shooting import fit
from gpsim.diagnosis.setup.candidates import candidates
from gpsim.diagnosis.setup.prepare import prepare
from gpsim.simulators import make_simulator

from .worlds import World, record


@pytest.mark.parametrize("astray", [0.0, 1.0])
@pytest.mark.parametrize("family", ["viscous_friction", "quadratic_drag", "actuator_saturation"])
def test_start_states_do_not_hold_the_parameters_back(family, astray):
    """Start states alone may gain more at first than together with a step of theta, which then never was taken.

    The recording is one of dry friction, by a law that is wrong, as most that are tried are. astray: in typical sizes,
    how far from the measured ones the start states begin.
    """
    world = World("slider")
    world.grips[0] = lambda q, v, normal: 2.5 + 0 * q
    recording = record(world, seed=4, noise=0.1, episodes=6)
    simulator = make_simulator("slider")
    question = prepare(recording, simulator, simulator.defaults(recording.parameters))
    problem, measured = question.everything, question.everything.windows.measured[:, 0]
    offers = candidates(question.recording, simulator, simulator.defaults(recording.parameters))
    law = next(c for c in offers if c.family == family and not c.variant)
    hypothesis = Hypothesis().plus(law.term([p.starts[0] for p in law.declared]), law.declared)
    starts = measured + astray * np.random.default_rng(0).normal(size=measured.shape) * problem.scale
    soon, end = (fit(problem, hypothesis, starts, iterations=i).objective for i in (4, 25))
    assert soon < end + 3.0
