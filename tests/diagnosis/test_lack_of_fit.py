"""The score test of smooth laws: it sees what noise hides, and nothing where nothing is missing."""

from dataclasses import replace
from importlib import import_module

import numpy as np
import pytest

from gpsim.diagnosis.fitting.evidence import whiteness
from gpsim.diagnosis.fitting.hypothesis import Hypothesis
from gpsim.diagnosis.fitting.multiple_shooting import fit
from gpsim.diagnosis.run import Run
from gpsim.diagnosis.selection.lack_of_fit import lack_of_fit, lack_of_memory
from gpsim.diagnosis.settings import AcceptanceSettings, read_settings
from gpsim.diagnosis.setup.candidates import candidates
from gpsim.diagnosis.setup.prepare import prepare
from gpsim.simulators import make_simulator

from .truths import level_filter
from .worlds import World, record

module = import_module(
    "gpsim.diagnosis.selection.lack_of_fit"
)  # the function of its name stands before it in the room


def posed(world, **how):
    recording = record(world, seed=8, episodes=6, steps=155, **how)
    simulator = make_simulator(world.system)
    parameters = simulator.defaults(recording.parameters)
    return prepare(recording, simulator, parameters).everything, candidates(recording, simulator, parameters)


def without_a_name(problem):
    return fit(problem, Hypothesis(), problem.windows.measured[:, 0])


def test_a_law_is_found_with_its_rate_and_its_input():
    problem, _ = posed(World("pendulum", forces={0: lambda q, v, t: 0.3 * np.sin(6 * q)}), noise=4.0)
    lack = lack_of_fit(problem, without_a_name(problem))
    assert lack.significant
    assert (lack.rate, lack.on) == ("theta_acc", ("theta",))


def test_a_law_of_two_inputs_is_found():
    problem, _ = posed(World("unicycle", twist=lambda v, s, w: (v * (1 - 0.1 * np.abs(w)), s, w)), noise=2.0)
    lack = lack_of_fit(problem, without_a_name(problem))
    assert lack.significant
    assert lack.rate == "v"
    assert set(lack.on) == {"v_cmd", "w_cmd"}


@pytest.mark.parametrize("system", ["slider", "pendulum", "unicycle", "cartpole"])
@pytest.mark.parametrize("noise", [0.0, 1.0, 4.0])
def test_nothing_is_found_where_nothing_is_missing(system, noise):
    problem, _ = posed(World(system), noise=noise)
    assert not lack_of_fit(problem, without_a_name(problem)).significant


def test_nothing_is_found_beside_the_right_law():
    problem, offers = posed(World("slider", forces={0: lambda q, v, t: -1.5 * v * np.abs(v)}))
    drag = next(c for c in offers if c.family == "quadratic_drag")
    named = fit(problem, Hypothesis().plus(drag.term([1.0]), drag.declared), problem.windows.measured[:, 0])
    assert lack_of_fit(problem, without_a_name(problem)).significant
    assert not lack_of_fit(problem, named).significant


def lagging(*times):
    """An actuator that follows its command through lags [s] one after the other."""

    def follow(time):
        follows = level_filter(lambda level, u, h: u + (level - u) * np.exp(-h / time))
        return lambda u, t, h, m: follows(u, t, h, m)

    return World("pendulum", filters=[follow(time) for time in times])


def beside_a_lag(world, **how):
    problem, offers = posed(world, **how)
    lag = next(c for c in offers if c.family == "actuator_lag")
    return problem, fit(
        problem, Hypothesis().plus(lag.term([0.03]), lag.declared), problem.windows.measured[:, 0]
    )


def test_a_law_that_remembers_is_found_with_its_command():
    """Two lags, one of which was named: under noise no law of the present tells, nor does whiteness."""
    problem, named = beside_a_lag(lagging(0.03, 0.02), noise=6.0)
    assert whiteness(problem, named)[0] > AcceptanceSettings().structured
    assert not lack_of_fit(problem, named).significant
    lack = lack_of_memory(problem, named)
    assert lack.significant
    assert (lack.rate, lack.on) == ("theta_acc", ("torque",))
    assert lack.memory == pytest.approx(0.04)  # two samples


@pytest.mark.parametrize("noise", [0.0, 1.0, 4.0])
def test_no_law_that_remembers_is_found_beside_the_right_one(noise):
    problem, named = beside_a_lag(lagging(0.03), noise=noise, differentiated=noise > 1.0)
    assert lack_of_memory(problem, without_a_name(problem)).significant
    assert not lack_of_memory(problem, named).significant


@pytest.mark.parametrize("system", ["slider", "unicycle", "cartpole"])
def test_no_law_that_remembers_is_found_where_nothing_is_missing(system):
    problem, _ = posed(World(system), noise=1.0)
    assert not lack_of_memory(problem, without_a_name(problem)).significant


def test_the_past_of_a_command_is_an_average_of_what_was_before():
    problem, _ = posed(World("slider"))
    windows, memory = problem.windows, 2.0
    given = np.concatenate([windows.before_actions, windows.actions], axis=1)[3, :, 0]
    before, k = windows.before_actions.shape[1], 5
    ages = np.arange(before + k)[::-1]
    weights = np.exp(-ages / memory)
    expected = (weights * given[: before + k]).sum() / weights.sum()
    assert module.average_of(problem, 0, memory)[3, k] == pytest.approx(expected, abs=1e-6)


def test_nothing_to_explain_beside_numerical_error_is_chance():
    """SciPy's survival function overflows so far below what is to be expected."""
    assert module._chance(2.4e-9, 7, 1008.0, 20) == 1.0
    assert module._chance(1500.0, 7, 1008.0, 20) < 1e-6


def test_what_is_significant_is_a_setting():
    problem, _ = posed(World("slider"), noise=1.0)
    lenient = replace(problem, run=Run(settings=read_settings({"lack_of_fit": {"significance": 1.1}})))
    assert not lack_of_fit(problem, without_a_name(problem)).significant
    assert lack_of_fit(lenient, without_a_name(problem)).significant


def test_of_many_inputs_only_the_most_telling_ones_are_paired():
    problem, _ = posed(World("cartpole", forces={0: lambda q, v, t: 0.5 * np.sin(9 * q)}), noise=1.0)
    problem = replace(problem, run=Run(settings=read_settings({"lack_of_fit": {"paired_inputs": 2}})))
    single = module._single(problem)
    nats = [10.0 if group.inputs[0] in (0, 4) else 1.0 for group in single]
    assert [g.inputs for g in module._double(problem, single, nats)] == [(0, 4), (0, 4)]


def test_the_same_question_is_answered_once(monkeypatch):
    problem, _ = posed(World("slider"))
    at = without_a_name(problem)
    first = lack_of_fit(problem, at)
    monkeypatch.setattr(module, "_single", lambda *_: pytest.fail("looked again"))
    assert lack_of_fit(problem, at) is first
