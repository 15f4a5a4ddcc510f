"""Worker processes: the same fits and simulations, whatever their number, and with a user's own system too."""

from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gpsim.diagnosis.fitting.batch import Order, fit_all
from gpsim.diagnosis.fitting.hypothesis import Hypothesis
from gpsim.diagnosis.fitting.simulate import _parts, simulate
from gpsim.diagnosis.run import Run, cores
from gpsim.diagnosis.setup.prepare import prepare
from gpsim.effects import Gate, Term
from gpsim.effects.chain import Chain
from gpsim.recordings import Episode, Recording
from gpsim.simulators import make_simulator

from .worlds import World, record


@pytest.fixture(scope="module")
def two():
    """Two processes, started once."""
    with cores(2) as workers:
        yield workers


EXAMPLE = Path(__file__).resolve().parents[2] / "docs" / "examples" / "cascaded_tanks.py"


@pytest.mark.slow
@pytest.mark.usefixtures("own_files")
@pytest.mark.parametrize("reference", ["slider", "user"])
def test_two_processes_fit_what_one_does(reference, two):
    rng = np.random.default_rng(0)
    if reference == "user":
        simulator, count, dt = make_simulator(f"{EXAMPLE}:CascadedTanks"), 2, 4.0
    else:
        simulator, count, dt = make_simulator("slider"), 2, 0.02
    episodes = tuple(
        Episode(str(i), dt * np.arange(101), 3 + rng.normal(size=(101, count)), 2 + rng.normal(size=(100, 1)))
        for i in range(5)
    )
    recording = Recording(
        simulator.name, simulator.state, simulator.action, episodes, dt, simulator.defaults(), "euler"
    )
    problem = prepare(recording, simulator, simulator.defaults()).searched
    assert problem.run.workers.count == 1
    orders = [Order(Hypothesis(scheme=s), problem.windows.measured[:, 0], 3, 0.5) for s in ("fine", "euler")]
    alone, run = fit_all(problem, orders), Run()
    fit_all(replace(problem, run=run), orders)
    # What a process may run of a user's is told to it when it begins.
    with cores(2) if reference == "user" else nullcontext(two) as workers:
        shared = Run(workers)
        together = fit_all(replace(problem, run=shared), orders)
    assert run.budget.spent > 0
    assert shared.budget.spent == pytest.approx(run.budget.spent, rel=1e-12)
    for one, two in zip(alone, together, strict=True):
        np.testing.assert_array_equal(one.residuals, two.residuals)
        assert one.objective == two.objective


SPRING = {"stiffness": 3.0, "rest_position": 0.1}
GATED = Gate(region={"x": (-0.2, 0.3)})
TERMS = {
    "nothing": [],
    "late and sticking": [
        Term("actuator_delay", "force", {"delay": 0.03}),
        Term("coulomb_friction", "x", {"force": 2.0}),
    ],
    "in a region": [Term("actuator_gain", "force", {"gain": 0.7}, GATED), Term("spring", "x", SPRING, GATED)],
    "read late": [
        Term("sensor_delay", "x", {"delay": 0.03}),
        Term("actuator_lag", "force", {"time_constant": 0.05}),
    ],
}


@pytest.mark.parametrize("terms", TERMS.values(), ids=TERMS.keys())
def test_a_large_batch_is_simulated_in_two_parts_as_in_one(terms, two):
    """To the last digit, and at the same effort: what a search finds must not depend on the cores."""
    recording = record(World("cartpole"), episodes=12, steps=155)
    problem = prepare(recording, make_simulator("cartpole"), recording.parameters).everything
    chain = Chain(problem.simulator, problem.parameters, tuple(terms), "fine", problem.dt)
    starts = np.tile(problem.windows.measured[:, 0], (12, 1, 1))
    starts += 0.01 * np.random.default_rng(0).normal(size=starts.shape)
    hypothesis = Hypothesis(tuple(terms), tuple(() for _ in terms))

    def simulated(run):
        return simulate(run, chain, problem.windows, starts, hypothesis.spread, np.zeros((12, 0)), 4)

    one = Run()
    alone = simulated(one)
    assert _parts(two.count, *starts.shape[:2], 4 * problem.windows.length) == 2
    both = Run(two)
    together = simulated(both)
    assert one.budget.spent > 0
    assert both.budget.spent == pytest.approx(one.budget.spent)
    np.testing.assert_array_equal(alone, together)


def test_one_window_is_simulated_in_one_part_however_many_copies_there_are():
    assert _parts(2, 700, 1, 100) == 1
    assert _parts(2, 700, 5, 100) == 2
    assert _parts(1, 700, 5, 100) == 1


def spending(run: Run, answer: int, effort: float) -> int:
    """A call that takes so much effort."""
    run.budget.add(effort)
    return answer


def test_calls_after_the_effort_is_used_up_do_not_count_whatever_the_cores(two):
    """The second call begins before 15 are spent, the third after."""
    for run in (Run(), Run(two)):
        calls = [(run, k, 10.0) for k in range(5)]
        assert run.side_by_side(spending, calls, until=15.0) == [0, 1]
        assert run.budget.spent == pytest.approx(20.0)


def test_what_was_diagnosed_may_be_asked_for_more_when_the_workers_have_gone():
    with cores(2) as workers:
        run = Run(workers)
    assert run.side_by_side(spending, [(run, k, 1.0) for k in range(3)]) == [0, 1, 2]
    assert run.workers.at_once(divmod, [(7, 3), (9, 4)]) == [(2, 1), (2, 1)]
