"""What to record next: for every rival that is reported, with commands of the size that was given."""

from types import SimpleNamespace

import numpy as np
import pytest

from gpsim.diagnosis.assessment.experiment_design import design_experiment
from gpsim.diagnosis.fitting import Hypothesis
from gpsim.diagnosis.setup import prepare
from gpsim.effects import Term
from gpsim.simulators import make_simulator

from .worlds import World, record


@pytest.fixture(scope="module")
def problem():
    recording = record(World("slider"), episodes=6, steps=100)
    simulator = make_simulator("slider")
    return prepare(recording, simulator, simulator.defaults(recording.parameters)).everything


def test_every_rival_that_is_reported_is_told_apart(problem):
    laws = [
        ("constant_force", {"force": 1.0}),
        ("viscous_friction", {"damping": 1.0}),
        ("coulomb_friction", {"force": 1.0}),
        ("quadratic_drag", {"drag": 1.0}),
        ("spring", {"stiffness": 1.0, "rest_position": 0.0}),
        ("actuator_gain", {"gain": 0.5}),
    ]
    on = {"actuator_gain": "force"}
    leader, *rivals = (
        SimpleNamespace(hypothesis=Hypothesis((Term(family, on.get(family, "q"), values),), ((),)))
        for family, values in laws
    )
    noise = np.array([0.001, 0.01])
    judgement = SimpleNamespace(verdict="ambiguous", leader=leader, rivals=rivals, noise=noise)
    found = design_experiment(problem, judgement)
    told = [claims for recording in found.recordings for claims in recording.explanations]
    told += [claims for pair in found.inseparable for claims in pair]
    assert set(told) == {((family, on.get(family, "q")),) for family, _ in laws}
    assert all(recording.difference >= 1.0 for recording in found.recordings)
