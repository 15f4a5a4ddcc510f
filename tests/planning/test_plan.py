"""A plan separates what can be separated, keeps to its limits, and says what no command tells."""

import dataclasses

import numpy as np
import pytest
from made_posteriors import (
    DT,
    LAG_OR_DELAY,
    MASS_OR_GAIN,
    SLIDER,
    made_explanation,
    made_machine,
    made_posterior,
)

from gpsim.errors import UsageError
from gpsim.planning import PlanSettings, limits_of, make_plan

QUICK = PlanSettings(piece=4.0, settle=4.0, candidates=16, rounds=1, draws=3, checked=60)


def planned(posterior, minutes=0.25, settings=QUICK, stated=None, anew=False, seed=0):
    limits = limits_of(stated or {}, SLIDER, posterior.visited)
    rng = np.random.default_rng(seed)
    return make_plan(made_machine(), posterior, limits, settings, minutes, rng, anew=anew), limits


@pytest.fixture(scope="module")
def told_apart():
    return planned(made_posterior(*LAG_OR_DELAY), stated={"rates": {"force": 20.0}})


def test_a_delay_is_told_from_a_lag_sooner_than_by_what_is_usually_played(told_apart):
    plan, _ = told_apart
    (pair,) = plan.pairs
    assert pair.separated
    assert pair.a_minute > max(pair.fixed["chirp"], pair.fixed["random walk"])


def test_what_is_played_keeps_to_the_limits_and_ends_at_rest(told_apart):
    plan, limits = told_apart
    assert (plan.commands >= limits.low).all()
    assert (plan.commands <= limits.high).all()
    assert np.abs(np.diff(plan.commands, axis=0)).max() <= 20.0 * DT + 1e-9
    assert plan.commands[-1] == pytest.approx(limits.idle)
    for course in plan.courses.values():
        assert limits.inside(course, QUICK.margin).all()
    assert plan.safety.draws == 60
    assert plan.safety.left == 0
    assert 0.0 < plan.safety.most < 0.06


def test_a_gain_and_a_mass_are_told_apart_by_no_command_and_the_sensor_is_named():
    plan, _ = planned(made_posterior(*MASS_OR_GAIN, relative=0.1), 0.12)
    (pair,) = plan.pairs
    assert not pair.separated
    assert any("force" in sensor for sensor in pair.sensors)
    assert any("mass" in sensor for sensor in pair.sensors)


def test_the_same_seed_makes_the_same_plan_and_another_one_another(told_apart):
    again, _ = planned(made_posterior(*LAG_OR_DELAY), stated={"rates": {"force": 20.0}})
    other, _ = planned(made_posterior(*LAG_OR_DELAY), stated={"rates": {"force": 20.0}}, seed=1)
    assert np.array_equal(told_apart[0].commands, again.commands)
    assert not np.array_equal(told_apart[0].commands, other.commands)


def test_what_does_not_come_back_is_played_anew_each_time():
    """Without its spring nothing brings the slider back."""
    free = made_posterior(*LAG_OR_DELAY)
    loose = dataclasses.replace(
        free,
        explanations=tuple(
            made_explanation({("viscous_friction", "q"): {"damping": 0.05}, **more}) for more in LAG_OR_DELAY
        ),
    )
    plan, limits = planned(loose, 0.2, dataclasses.replace(QUICK, piece=2.0), anew=True)
    assert len(np.unique(plan.episode)) == len(plan.pieces) > 1
    for course in plan.courses.values():
        starts = np.flatnonzero(np.diff(plan.episode, prepend=-1))
        assert course[starts] == pytest.approx(np.tile(limits.rest, (len(starts), 1)), abs=1e-9)


@pytest.mark.parametrize(
    ("stated", "said"),
    [
        ({"commands": {"force": [1.0, 2.0]}}, "excludes the command at rest"),
        ({"commands": {"force": [2.0, -2.0]}}, "leaves no possible command"),
        ({"box": {"q": [0.5, 2.0]}}, "does not contain the first state"),
        ({"box": {"q": [1.0, -1.0]}}, "is empty"),
        ({"box": {"p": [-1.0, 1.0]}}, "no channel 'p'"),
        ({"box": {"q": 3.0}}, r"expected \[low, high\]"),
        ({"rates": {"force": 0.0}}, "expected more than 0 per second"),
        ({"rest": {"q": 0.9}}, "without commands, q goes from"),
    ],
)
def test_limits_that_cannot_be_kept_are_refused(stated, said):
    with pytest.raises(UsageError, match=said):
        planned(made_posterior(*LAG_OR_DELAY), 0.12, dataclasses.replace(QUICK, candidates=4), stated)


@pytest.mark.parametrize("deviation", [0.0, np.inf, 1e6])
def test_a_singular_posterior_is_refused_and_names_the_parameter(deviation):
    posterior = made_posterior(*LAG_OR_DELAY)
    first = posterior.explanations[0]
    matrix = first.covariance.copy()
    matrix[0, 0] = deviation**2
    wrong = dataclasses.replace(first, covariance=matrix)
    with pytest.raises(UsageError, match="viscous_friction on q: damping"):
        planned(dataclasses.replace(posterior, explanations=(wrong, *posterior.explanations[1:])), 0.12)


@pytest.mark.parametrize(
    ("name", "value"),
    [("piece", 0.0), ("probability", 1.0), ("candidates", 0), ("fastest", 0.7), ("margin", -0.1)],
)
def test_settings_that_make_no_sense_are_refused(name, value):
    with pytest.raises(ValueError, match=name):
        PlanSettings(**{name: value})
