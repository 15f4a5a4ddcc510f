"""Around a policy that holds a cart-pole upright: what would fall stays in the box, and is told apart meanwhile."""

import dataclasses

import numpy as np
import pytest
from made_posteriors import LAG_OR_DELAY, made_explanation, made_machine, made_posterior

from gpsim.corrected import EffectsPlant
from gpsim.diagnosis.run import Run
from gpsim.errors import UsageError
from gpsim.planning import Around, Machine, PlanSettings, limits_of, make_plan
from gpsim.planning.models import model_of
from gpsim.posterior import LeftOpen, Visited
from gpsim.simulators import make_simulator

CARTPOLE, DT = make_simulator("cartpole"), 0.02
GAINS = np.array([1.0, 2.0, 30.0, 6.0])
STATED = {
    "box": {"x": [-1, 1], "x_dot": [-3, 3], "theta": [-0.2, 0.2], "theta_dot": [-3, 3]},
    "rates": {"force": 300.0},
}
QUICK = PlanSettings(piece=1.6, settle=2.4, candidates=4, rounds=0, draws=2, checked=20)
LATE, SLOW = (
    {("actuator_delay", "force"): {"delay": 0.04}},
    {("actuator_lag", "force"): {"time_constant": 0.04}},
)


def upright(seen):
    """A regulator that pushes the cart under its pole."""
    return 10.0 * np.tanh(0.1 * (seen @ GAINS))[:, None]


def left_open(*terms):
    found = tuple(
        made_explanation({("viscous_friction", "x"): {"damping": 0.5}, **more}, 1.0 / len(terms))
        for more in terms
    )
    noise = dict(zip(CARTPOLE.state.names, (0.002, 0.01, 0.002, 0.01), strict=True))
    visited = Visited(
        40.0, np.full(4, -1.0), np.full(4, 1.0), np.array([-10.0]), np.array([10.0]), np.array([100.0]),
        np.zeros(4), np.random.default_rng(0).uniform(-0.1, 0.1, (40, 5)),
    )  # fmt: skip
    return LeftOpen(found, 0.9, noise, noise, visited)


def planned(steer, stated=STATED, settings=QUICK, minutes=0.1):
    posterior = left_open(LATE, SLOW)
    limits = limits_of(stated, CARTPOLE, posterior.visited)
    around = steer and Around(steer, limits.low, limits.high, limits.rate, limits.idle, DT)
    machine = Machine(CARTPOLE, CARTPOLE.defaults({}), DT, 2, Run(), around)
    plan = make_plan(machine, posterior, limits, settings, minutes, np.random.default_rng(0))
    return plan, limits, around


@pytest.fixture(scope="module")
def held():
    return planned(upright)


@pytest.mark.parametrize("terms", [LATE, SLOW], ids=["late", "slow"])
def test_what_would_fall_stays_in_the_box_on_a_machine_that_is_one_of_the_explanations(held, terms):
    plan, limits, around = held
    assert plan.dithers
    assert np.abs(plan.commands).max() > 0.5
    assert plan.safety.left == 0
    truth = left_open(terms).explanations[0].hypothesis.terms
    plant, rng = EffectsPlant(CARTPOLE, CARTPOLE.defaults({}), truth, "fine", 8, DT), np.random.default_rng(3)
    alone, state, last = np.zeros((1, 4)), np.zeros((1, 4)), limits.idle[None]
    memory, untouched = plant.begin(1, rng), plant.begin(1, rng)
    fell = False
    for dither in plan.commands[:, None]:
        noisy = state + np.array([0.002, 0.01, 0.002, 0.01]) * rng.standard_normal(4)
        command = around.command(noisy, dither, last)
        assert limits.low[0] <= command[0, 0] <= limits.high[0]
        assert abs(command - last)[0, 0] <= 300.0 * DT + 1e-9
        state, last = plant.step(state, command, memory, rng), command
        assert limits.inside(state, 0.0).all()
        alone = plant.step(alone, dither, untouched, rng)
        fell |= not limits.inside(alone, 0.0).all()
    assert fell  # by the same dithers without the policy


def test_the_pair_is_told_apart_and_left_alone_nothing_is_found(held):
    (pair,) = held[0].pairs
    assert pair.separated
    with pytest.raises(UsageError, match="no commands keep the states in the box"):
        planned(None, settings=dataclasses.replace(QUICK, candidates=1, draws=1, checked=4))


def test_a_policy_that_does_not_hold_the_machine_is_refused():
    with pytest.raises(UsageError, match="--policy: it may leave the box"):
        planned(lambda seen: -upright(seen), {**STATED, "rest": {"theta": 0.01}})


def test_a_policy_that_commands_nothing_plays_the_commands_as_they_are():
    """The closed loop and the open one are simulated by different code."""
    dithers = np.random.default_rng(1).uniform(-1, 1, (3, 60, 1))
    box = (np.array([-1.5]), np.array([1.5]), np.array([np.inf]), np.zeros(1))
    alone, machine = made_machine(), made_machine()
    machine = dataclasses.replace(machine, around=Around(lambda seen: np.zeros((len(seen), 1)), *box, DT))
    for one in made_posterior(*LAG_OR_DELAY).explanations:
        starts = np.zeros((len(model_of(alone, one, 2, np.random.default_rng(0)).thetas), 2))
        open_loop, closed = (
            model_of(m, one, 2, np.random.default_rng(0)).said(starts, dithers, np.zeros(1), 0.0)
            for m in (alone, machine)
        )
        for one_way, other in zip(open_loop, closed, strict=True):
            assert other == pytest.approx(one_way, abs=1e-6)
        assert np.abs(closed[1]).max() > 0.02
