"""Angles that wrap because the recording says so, though the simulator does not know it, or the other way round."""

import pickle
from dataclasses import replace
from types import SimpleNamespace

import numpy as np

from gpsim import load_simulator
from gpsim.channels import Channels, wrap_angle
from gpsim.corrected import EffectsPlant, plant_from
from gpsim.diagnosis.assessment.remainder_gp import _features
from gpsim.diagnosis.fitting import Hypothesis, predicted
from gpsim.diagnosis.setup import prepare
from gpsim.effects import Gate, Term
from gpsim.simulators import make_simulator
from gpsim.stages.diagnosis_files import described, plant_of

from .worlds import World, record

UPRIGHT = Gate(region={"theta": (2.8, 3.5)})  # seen from the other side of the seam: -3.48 to -2.78
PUSHED = Term("constant_force", "theta", {"force": 2.0}, UPRIGHT)
TURNING = Channels.of({"theta": "rad", "theta_dot": "rad/s"}, wraps=("theta",))
SYSTEM = """
class Pendulum:
    state = {"theta": "rad", "theta_dot": "rad/s"}
    action = {"torque": "N m"}
    parameters = {"inertia": ("kg m^2", 0.25, 0.01, 10.0)}
    coordinates = {"theta": "theta_dot"}

    def rates(self, state, action, p, forces):
        return {"theta_dot": (action["torque"] + forces["theta"]) / p["inertia"]}
"""


def turned(wraps: bool):
    """A pendulum's recording on the far side of the seam, angles between -pi and pi."""
    recording = record(World("pendulum"), episodes=6, steps=100)
    episodes = tuple(
        replace(e, states=np.stack([wrap_angle(e.states[:, 0] * 0.1 - 3.0), e.states[:, 1] * 0.1], axis=1))
        for e in recording.episodes
    )
    return replace(recording, episodes=episodes, **({"state": TURNING} if wraps else {}))


def question_of(recording, simulator=None):
    simulator = simulator or make_simulator(recording.system)
    return prepare(recording, simulator, simulator.defaults())


def pushed_by(question) -> float:
    """By how much a term behind a gate changes the first step's speed."""
    problem = question.everything
    first = problem.windows.take(np.abs(problem.windows.measured[:, 0, 0] + 3.0) < 0.1)
    assert len(first)
    said = [predicted(problem, first, h)[:, 1, 1] for h in (Hypothesis((PUSHED,), ((),)), Hypothesis((), ()))]
    return float(np.median(said[0] - said[1]))


def test_a_gate_acts_across_the_seam_where_the_recording_wraps():
    assert abs(pushed_by(question_of(turned(wraps=False)))) < 1e-6
    assert pushed_by(question_of(turned(wraps=True))) > 0.1
    assert _features(question_of(turned(wraps=True)).everything).wraps[:2] == (True, False)


def test_a_recording_that_says_nothing_keeps_the_simulator_and_its_angles():
    simulator = make_simulator("pendulum")
    assert question_of(turned(wraps=False), simulator).everything.simulator is simulator
    unicycle = make_simulator("unicycle")
    recording = record(World("unicycle"), episodes=6, steps=100)
    plain = replace(recording, state=Channels.of(recording.state.units))
    assert question_of(plain, unicycle).everything.simulator.state.wraps.tolist() == [False, False, True]


def test_it_still_wraps_in_another_process(tmp_path):
    (tmp_path / "mine.py").write_text(SYSTEM)
    simulator = question_of(turned(wraps=True), load_simulator(f"{tmp_path / 'mine.py'}:Pendulum"))
    copy = pickle.loads(pickle.dumps(simulator.everything.simulator))
    assert copy.state == TURNING
    state, action = np.array([[3.0, 1.0]]), np.array([[0.5]])
    np.testing.assert_allclose(copy.rates(state, action, copy.defaults()), [[2.0]])
    after = np.array([[-3.0, 2.0]])
    np.testing.assert_allclose(copy.measured_rates(state, after, np.ones(1)), [[1.0]])


def test_the_corrected_simulator_remembers_what_wraps():
    own, recording = make_simulator("pendulum"), turned(wraps=True)
    simulator = question_of(recording, own).everything.simulator
    plant = EffectsPlant(simulator, own.defaults(), (PUSHED,), "fine", 2, 0.02)
    diagnosis = SimpleNamespace(remainder=SimpleNamespace(gp=None))

    def told(plant):
        outcome = SimpleNamespace(plant=plant, question=SimpleNamespace(recording=recording))
        return described(outcome, diagnosis, own.state)

    data = told(plant)
    assert data["wraps"] == ["theta"]
    assert plant_of(data, own).state == TURNING
    assert "wraps" not in told(replace(plant, simulator=own))
    assert plant_from(data, own).terms == plant.terms
