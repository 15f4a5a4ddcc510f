"""The usual machine: several large effects at once are found by taking away from the full model."""

from types import SimpleNamespace

import numpy as np
import pytest

from gpsim.diagnosis.attribution.importance import importances, players
from gpsim.diagnosis.attribution.twins import unsure_twins
from gpsim.diagnosis.fitting import Hypothesis, child_of, fit, quadratic, scores
from gpsim.diagnosis.run import Run
from gpsim.diagnosis.selection import inertias, usual_machine
from gpsim.diagnosis.selection.acceptance import _held
from gpsim.diagnosis.selection.elimination import SMALL_ACCOUNT, doubtful
from gpsim.diagnosis.selection.scaling import moved_inertias
from gpsim.diagnosis.setup import offers_of, prepare
from gpsim.effects import Gate, Term
from gpsim.simulators import make_simulator

from .worlds import World, record

TRUTH = {"coulomb_friction": 1.2, "viscous_friction": 1.5, "constant_force": -0.6}
AXIS = World(
    "slider",
    parameters={"mass": 2.6},
    forces={0: lambda q, v, t: -1.5 * v - 0.6},
    grips={0: lambda q, v, normal: 1.2 + 0.0 * q},
)


@pytest.fixture(scope="module")
def asked():
    recording = record(AXIS, seed=5, episodes=6, steps=200)
    question = prepare(recording, make_simulator("slider"), recording.parameters, Run())
    return question, offers_of(question)


@pytest.fixture(scope="module")
def path(asked):
    question, offers = asked
    return usual_machine(question, offers)


@pytest.fixture(scope="module")
def best(asked, path):
    return path[int(np.argmax(scores(asked[0].searched, path)))]


def test_four_large_effects_at_once_are_found_with_their_sizes(best):
    found = {t.family: t.values for t in best.hypothesis.terms}
    assert set(TRUTH) <= set(found)
    pair = found.keys() & {"parameter_offset", "actuator_gain"}
    assert len(pair) == 1  # of mass and gain only the ratio shows: one of them is told
    scale = found["actuator_gain"]["gain"] if "actuator_gain" in pair else 1.0
    for family, size in TRUTH.items():
        (value,) = found[family].values()
        assert value / scale == pytest.approx(size, rel=0.05), family


def test_the_paths_are_two_of_ever_fewer_terms_the_second_without_the_inertia(path):
    counts = [len(f.hypothesis.terms) for f in path]
    second = counts.index(counts[0] - 1, 2)
    for part in (counts[:second], counts[second:]):
        assert part == sorted(set(part), reverse=True)
    assert not any(("parameter_offset", "mass") in f.hypothesis.claims for f in path[second:])


def test_the_quadratic_foretells_what_leaving_a_term_out_costs(asked, best):
    """The fits themselves are the oracle: squares in the noise of the account, all other parameters fitted anew."""
    problem = asked[0].searched
    around = quadratic(problem, best)
    for index in range(len(best.hypothesis.terms)):
        refitted = fit(problem, best.hypothesis.without(index), best.starts, near=True)
        gone = (refitted.residuals**2 - best.residuals**2).sum(axis=(0, 1)) / best.variance / 2
        lost = float(gone[problem.observed].sum())
        assert 0.5 * lost < around.cost([index]) < 3.0 * lost  # far from nothing, friction is no line
        quick = around.refitted(problem, [index], 8)
        assert refitted.objective <= quick.objective + 1.0
        assert quick.objective < refitted.objective + 0.2 * (refitted.objective - best.objective)


def test_one_step_says_what_some_of_the_windows_alone_would(asked, best):
    problem = asked[0].searched
    around, spread = quadratic(problem, best), np.sqrt(np.diag(quadratic(problem, best).covariance))
    kept = np.flatnonzero(np.arange(len(problem.windows)) % 4 != 0)
    again = fit(problem.on(problem.windows.take(kept)), best.hypothesis, best.starts[kept], near=True)
    moved = again.hypothesis.theta - best.hypothesis.theta
    assert np.abs(moved / spread).max() > 0.1  # they say something else
    assert np.abs(around.learnt_from(kept).theta - again.hypothesis.theta).max() < 0.25 * np.abs(moved).max()
    assert around.learnt_from(np.arange(len(problem.windows))).theta == pytest.approx(
        best.hypothesis.theta, rel=1e-2
    )


def test_what_is_surely_needed_is_not_in_doubt_of_a_large_account(asked, best):
    question, offers = asked
    problem, idle = question.searched, best.hypothesis
    for candidate in offers:
        if candidate.family == "sensor_bias":
            idle = child_of(idle, candidate, [p.none for p in candidate.declared])
    large = fit(problem, idle, best.starts, near=True)
    assert len(idle.terms) > SMALL_ACCOUNT
    names = [idle.terms[i].family for i in doubtful(problem, large)]
    assert not {"viscous_friction", "coulomb_friction", "constant_force"} & set(names)
    assert set(names) == {"sensor_bias"}


def test_a_gate_holds_the_share_of_the_samples_that_lies_in_it(asked, best):
    problem, hypothesis = asked[0].searched, best.hypothesis
    moved = problem.windows.measured[:, :-1, 0][problem.windows.valid[:, 1:]]
    middle = float(np.median(moved))
    gated = hypothesis.gated(0, Gate(region={"q": (middle, np.inf)}))
    (held,) = _held(problem, fit(problem, gated, best.starts, iterations=0), best)
    assert held == pytest.approx(0.5, abs=0.05)
    assert _held(problem, best, best) == []


class AddsUp:
    """A judge by whom every term is worth its own value."""

    mismatch = SimpleNamespace(overall=lambda squares: squares)

    def __init__(self, worth):
        self.worth = worth

    def squares(self, accounts):
        names = [[t.on for t in account[0].terms] for account in accounts]
        return np.array([[sum(self.worth[n] for n in some), 0.0] for some in names])


def test_of_a_large_account_families_play_and_their_terms_share_by_need():
    joints = [f"j{i}" for i in range(5)]
    terms = tuple(Term(f, f"{f[0]}{j}", {}) for f in ("coulomb_friction", "viscous_friction") for j in joints)
    account = Hypothesis(terms, ((),) * len(terms))
    assert players(account) == [tuple(range(5)), tuple(range(5, 10))]
    worth = {t.on: 0.01 * (i + 1) for i, t in enumerate(terms)}
    whole = np.array([sum(worth.values()), 0.0])
    needed = np.array(list(worth.values()))
    parts = importances(AddsUp(worth), account, whole, whole, needed)
    assert parts[:, 0] == pytest.approx(needed)
    assert parts[:, 0].sum() == pytest.approx(whole[0])


def test_of_many_players_of_a_robot_coming_first_and_last_stand_for_all_orders():
    terms = tuple(
        Term(f, f[:3], {}) for f in ("coulomb_friction", "viscous_friction", "armature", "spring", "payload")
    )
    account = Hypothesis(terms, ((),) * len(terms))
    worth = {t.on: 0.01 * (i + 1) for i, t in enumerate(terms)}
    whole = np.array([sum(worth.values()), 0.0])
    judge, asked = AddsUp(worth), []
    judge.squares = lambda accounts: (asked.extend(accounts), AddsUp.squares(judge, accounts))[1]
    parts = importances(judge, account, whole, whole, np.ones(len(terms)), dear=True)
    assert parts[:, 0] == pytest.approx(list(worth.values()))
    assert len(asked) == 2 * len(terms)


@pytest.mark.parametrize(
    ("system", "coordinate", "inertia"),
    [("slider", "q", ("mass",)), ("cartpole", "x", ("cart_mass",)), ("pendulum", "theta", ("mass",))],
)
def test_what_a_drive_moves_is_read_off_its_acceleration(system, coordinate, inertia):
    assert inertias(make_simulator(system), coordinate) == inertia


def test_of_a_gain_beside_its_inertia_the_account_is_unsure(asked, best):
    """Mass, gain and every force may grow together: with both, none of them has a size; with one, all have."""
    question, offers = asked
    problem, found = question.searched, {t.family for t in best.hypothesis.terms}
    assert unsure_twins(problem, best) == []
    other = "actuator_gain" if "parameter_offset" in found else "parameter_offset"
    candidate = next(c for c in offers if c.family == other and not c.variant)
    both = fit(problem, child_of(best.hypothesis, candidate, (1.1,)), best.starts, near=True)
    twins = unsure_twins(problem, both)
    assert {both.hypothesis.terms[i].family for i in twins} == {"actuator_gain", "parameter_offset"}


def test_beside_a_gain_an_inertia_that_it_moves_may_be_left_out():
    terms = [("actuator_gain", "force"), ("parameter_offset", "pole_mass"), ("parameter_offset", "cart_mass")]

    def moved(some):
        account = Hypothesis(tuple(Term(f, on, {}) for f, on in some), ((),) * len(some))
        return moved_inertias(make_simulator("cartpole"), account)

    assert moved(terms) == [2]
    assert moved(terms[1:]) == []
