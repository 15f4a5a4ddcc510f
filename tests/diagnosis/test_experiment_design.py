"""What to record next: for every rival that is reported, with commands of the size that was given."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from gpsim.diagnosis.assessment.experiment_design import _amplitudes, design_experiment
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


def commanded(problem, actions):
    return replace(problem.windows, actions=actions)


def test_seldom_commands_count_with_their_size(problem):
    actions, rng = np.zeros_like(problem.windows.actions), np.random.default_rng(0)
    pushed = rng.random(actions.shape) < 0.02
    actions[pushed] = 5.0
    actions[0, 0] = 5.0
    assert _amplitudes(commanded(problem, actions)) == pytest.approx([5.0])
    idle = actions + 1e-4 * rng.normal(size=actions.shape)  # an analogue stick is never quite at rest
    assert _amplitudes(commanded(problem, idle)) == pytest.approx([5.0], rel=1e-3)
    assert _amplitudes(commanded(problem, 0.0 * actions)) == [0.0]


def test_steady_commands_count_as_before(problem):
    actions = problem.windows.actions
    assert _amplitudes(problem.windows)[0] == np.quantile(np.abs(actions), 0.95)


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
