"""Corrected simulators: shapes, memory, Gaussian processes, and how they are judged."""

import numpy as np
import pytest
from api.conftest import UNITS, pushed

import gpsim
from gpsim.errors import UsageError


@pytest.fixture(scope="module")
def corrected(made):
    return made.diagnosis.corrected()


@pytest.fixture(scope="module")
def process(made):
    return gpsim.fit_gp(made.recording, n_train=80, settings={"restarts": 0})


def test_it_knows_its_channels_and_what_corrects_it(corrected, process):
    assert corrected.state == {"q": "m", "q_dot": "m/s"}
    assert corrected.action == {"force": "N"}
    assert corrected.dt == pytest.approx(0.02)
    assert repr(corrected) == "<CorrectedSimulator of slider: viscous_friction>"
    assert repr(process) == "<CorrectedSimulator of slider: a Gaussian process>"


def test_it_slows_down_as_the_body_does(corrected):
    path = corrected.rollout([0.0, 1.0], np.zeros((50, 1)))
    assert path.shape == (51, 2)
    assert path[-1, 1] == pytest.approx(np.exp(-50 * corrected.dt), rel=0.01)


@pytest.mark.parametrize("which", ["corrected", "process"])
def test_one_row_a_batch_and_a_rollout_are_the_same_steps(which, request):
    simulator = request.getfixturevalue(which)
    starts, pushes = np.array([[0.0, 1.0], [0.2, -0.5]]), np.random.default_rng(0).uniform(-1, 1, (2, 7, 1))
    together = simulator.rollout(starts, pushes)
    assert together.shape == (2, 8, 2)
    for i in range(2):
        np.testing.assert_allclose(simulator.rollout(starts[i], pushes[i]), together[i])
    np.testing.assert_allclose(simulator.step(starts[0], pushes[0, 0]), together[0, 1])
    np.testing.assert_allclose(simulator.step(starts, pushes[:, 0]), together[:, 1])
    batch = simulator.batch(starts)
    for k in range(7):
        states = batch.step(pushes[:, k])
    np.testing.assert_allclose(states, together[:, -1])
    assert batch.steps == 7
    shared = simulator.rollout(starts, pushes[0])
    np.testing.assert_allclose(shared[0], together[0])
    assert not np.allclose(shared[1], together[1])


def test_effects_remember_along_an_episode():
    """A delay of two steps: the first commands arrive later, and the sensor is as late."""
    from gpsim.corrected import EffectsPlant
    from gpsim.effects import Gate, Term
    from gpsim.simulators import make_simulator

    slider = make_simulator("slider")
    delay = Term("actuator_delay", "force", {"delay": 0.2}, Gate())
    late = Term("sensor_delay", "q", {"delay": 0.1}, Gate())
    plant = EffectsPlant(slider, slider.defaults(), (delay, late), "fine", 2, 0.1)
    simulator = gpsim.CorrectedSimulator(plant)
    path = simulator.rollout([0.0, 0.0], np.ones((6, 1)))
    assert path[2, 1] == 0.0
    assert path[3, 1] == pytest.approx(0.1)
    seen = simulator.rollout([0.0, 0.0], np.ones((6, 1)), measured=True)
    np.testing.assert_allclose(seen[1:, 0], path[:-1, 0])
    np.testing.assert_allclose(seen[:, 1], path[:, 1])
    batch = simulator.batch([[0.0, 0.0]])
    for _ in range(3):
        batch.step([[1.0]])
    assert batch.measured[0, 0] == path[2, 0]
    assert batch.states[0, 0] == path[3, 0]


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda s: s.step([0.0], [0.0]), "state: expected shape (2,) or (B, 2), got (1,); its columns are (q [m], q_dot"),
        (lambda s: s.step([0.0, 0.0], [0.0, 1.0]), "action: expected shape (1,) or (B, 1), got (2,)"),
        (lambda s: s.step([[0.0, 0.0]] * 3, [[0.0], [1.0]]), "action: expected shape (3, 1), got (2, 1)"),
        (lambda s: s.step([0.0, np.nan], [0.0]), "state: contains a number that is not finite"),
        (lambda s: s.step("here", [0.0]), "state: expected numbers, got here"),
        (lambda s: s.rollout([0.0, 0.0], [0.0, 1.0]), "actions: expected shape (T, 1) or (1, T, 1), got (2,)"),
        (lambda s: s.batch(np.zeros((2, 3))), "states: expected shape (2,) or (B, 2), got (2, 3)"),
    ],
)  # fmt: skip
def test_what_has_another_shape(corrected, call, said):
    with pytest.raises(UsageError) as caught:
        call(corrected)
    assert said in str(caught.value)


def test_a_gaussian_process_learns_the_damping(process, made):
    slope = process.step([0.0, 1.0], [0.0])[1] - 1.0
    assert slope == pytest.approx(-made.recording.dt, rel=0.2)
    assert process.fits["q_acc"].rows == 80
    drawn = gpsim.fit_gp(made.recording, n_train=80, prediction="sample", settings={"restarts": 0})
    ways = [drawn.rollout([0.0, 1.0], np.zeros((5, 1)), seed=seed)[-1, 1] for seed in (0, 0, 1)]
    assert ways[0] == ways[1] != ways[2]


@pytest.mark.parametrize(
    ("named", "said"),
    [
        ({"inputs": ["speed"]}, "no channel 'speed'"),
        ({"inputs": []}, "gp.inputs is empty"),
        ({"n_train": 5}, "only 5 training transitions"),
        ({"n_train": 0}, "n_train: expected a whole number of at least 1"),
        ({"settings": {"starts": 3}}, "settings: no setting 'starts'"),
        ({"prediction": "mode"}, "prediction: 'mode' is not one of mean, sample"),
    ],
)
def test_what_no_fit_can_have(made, named, said):
    with pytest.raises(UsageError) as caught:
        gpsim.fit_gp(made.recording, **named)
    assert said in str(caught.value)


def test_both_are_judged_on_a_recording_that_they_do_not_know(made, process):
    other = gpsim.recording_from_frame(pushed(seed=3), UNITS, "slider", dt=0.02)
    for corrected in (made.diagnosis, made.diagnosis.corrected(), process):
        found = gpsim.evaluate(corrected, other)
        assert found.one_step["q_acc"].unit == "m/s^2"
        assert found.one_step["q_acc"].corrected < 0.5 * found.one_step["q_acc"].base
        assert found.rollout["q_dot"].corrected < 0.1 * found.rollout["q_dot"].base
        lines = str(found).splitlines()
        assert lines[0] == f"errors of {found.steps} single steps and {found.rollouts} rollouts:"
        assert lines[1].split() == ["unit", "base", "corrected"]
        assert [line.split()[0] for line in lines[2:]] == ["q_acc,", "q,", "q_dot,"]


def test_what_cannot_be_judged(process):
    slow = gpsim.recording_from_frame(pushed(count=100, dt=0.1), UNITS, "slider")
    with pytest.raises(UsageError, match="the recording's step is 0.1 s, the simulator's 0.02 s"):
        gpsim.evaluate(process, slow)
    with pytest.raises(UsageError, match="expected a corrected simulator or a diagnosis, got str"):
        gpsim.evaluate("slider", slow)
