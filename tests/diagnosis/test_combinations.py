"""Parameters that only act together: a slide's mass and its motor's gain are one number, told as such."""

import numpy as np
import pytest

from gpsim.diagnosis.assessment.combinations import WIDE, identifiable_combinations, open_groups, simple
from gpsim.diagnosis.fitting import Hypothesis, fit
from gpsim.diagnosis.setup import offers_of, prepare
from gpsim.simulators import make_simulator

from .truths import channel_filter
from .worlds import World, record

NOT_HELD = np.zeros(3, dtype=bool)


def posed(world, **given):
    recording = record(world, seed=4, episodes=5, steps=80, **given)
    simulator = make_simulator(recording.system)
    question = prepare(recording, simulator, simulator.defaults(recording.parameters))
    offers = {(c.family, c.place.on): c for c in offers_of(question) if not c.variant}
    return question.searched, offers


def fitted(problem, offers, **values):
    """A fit of these effects, each as FAMILY__ON=(values)."""
    h = Hypothesis()
    for name, start in values.items():
        candidate = offers[tuple(name.split("__"))]
        h = h.plus(candidate.term(start), candidate.declared)
    return fit(problem, h, problem.windows.measured[:, 0])


def weak_and_damped():
    damped = {0: lambda q, v, t: -1.5 * v}
    return posed(World("slider", forces=damped, filters=[channel_filter(0, lambda u, t, h, m: 0.8 * u)]))


def test_mass_and_gain_and_damping_leave_their_common_scale_open():
    problem, offers = weak_and_damped()
    found = fitted(
        problem,
        offers,
        actuator_gain__force=(0.9,),
        parameter_offset__mass=(1.1,),
        viscous_friction__q=(1.0,),
    )
    told = {
        frozenset(zip(c.of, c.exponents, strict=True)): c
        for c in identifiable_combinations(problem, found, [])
    }
    assert len(told) == 2
    names = {name for of in told for name, _ in of}
    assert names == {
        "actuator_gain on force: gain",
        "parameter_offset on mass: ratio",
        "viscous_friction on q: damping",
    }
    for c in told.values():
        powers = dict(zip((name.split()[0] for name in c.of), c.exponents, strict=True))
        truth = {"actuator_gain": 0.8, "parameter_offset": 1.0, "viscous_friction": 1.5}
        expected = np.prod([truth[name] ** power for name, power in powers.items()])
        assert sum(powers.values()) == 0.0
        assert c.low < c.value < c.high
        assert c.value == pytest.approx(expected, rel=0.05)
        assert c.high / c.low < 1.2
        assert (c.unit == "1") == ("viscous_friction" not in powers)


def test_what_a_rival_would_change_instead_belongs_to_it():
    problem, offers = posed(World("slider", filters=[channel_filter(0, lambda u, t, h, m: 0.8 * u)]))
    leader = fitted(problem, offers, actuator_gain__force=(0.9,))
    rival = fitted(problem, offers, parameter_offset__mass=(1.1,))
    (told,) = identifiable_combinations(problem, leader, [rival])
    assert set(told.of) == {"actuator_gain on force: gain", "parameter_offset on mass: ratio"}
    assert sorted(told.exponents) == [-1.0, 1.0]
    gain = told.value ** told.exponents[told.of.index("actuator_gain on force: gain")]
    assert gain == pytest.approx(0.8, rel=0.02)
    assert identifiable_combinations(problem, leader, []) == ()


def test_what_the_data_fix_each_by_itself_is_no_combination():
    problem, offers = weak_and_damped()
    assert (
        identifiable_combinations(
            problem, fitted(problem, offers, actuator_gain__force=(0.9,), viscous_friction__q=(1.0,)), []
        )
        == ()
    )
    assert (
        identifiable_combinations(problem, fit(problem, Hypothesis(), problem.windows.measured[:, 0]), [])
        == ()
    )


def information(*rows):
    """Of products whose logarithms are known to 1 %, by their exponents."""
    rows = np.array(rows, dtype=float)
    return 1e4 * rows.T @ rows


def test_the_products_of_any_powers_are_found():
    ((group, products),) = open_groups(information([1, -2, 0], [0, 0, 1]), NOT_HELD)
    assert group.tolist() == [0, 1]
    ((powers, deviation),) = products
    np.testing.assert_allclose(simple(powers) / powers[0], [1.0, -2.0])
    assert deviation == pytest.approx(0.01 * abs(powers[0]), rel=1e-6)


def test_two_open_directions_of_four_fix_two_products():
    groups = open_groups(information([1, -1, 0, 0], [0, 0, 1, 1]), np.zeros(4, dtype=bool))
    assert [group.tolist() for group, _ in groups] == [[0, 1], [2, 3]]
    assert [np.sign(products[0][0]).tolist() for _, products in groups] in (
        [[1, -1], [1, 1]],
        [[-1, 1], [1, 1]],
    )


def test_what_stopped_at_its_bound_takes_those_along_that_would_follow():
    tight = information([1, -1, 0], [0.0, 0.05, 0.0], [0, 0, 1])  # 20 % of the second by itself
    assert open_groups(tight, NOT_HELD) == []
    ((group, products),) = open_groups(tight, np.array([False, True, False]))
    assert group.tolist() == [0, 1]
    assert len(products) == 1
    loose = information([1, 0, 0], [0, 1, 0], [0, 0, 1])
    assert open_groups(loose, np.array([False, True, False])) == []


def test_exponents_are_rounded_where_they_are_nearly_simple():
    np.testing.assert_allclose(
        simple(np.array([0.98, -0.52, 0.335, 0.85])), [1.0, -0.5, 1 / 3, 0.85], atol=1e-12
    )


def test_one_that_is_little_known_by_itself_takes_no_other_along():
    loose = information([1, -0.2, 0], [0, 1, 0], [0, 0, 1]) * [[1e-4, 1e-2, 1e-2], [1e-2, 1, 1], [1e-2, 1, 1]]
    assert np.sqrt(np.linalg.inv(loose)[0, 0]) > WIDE
    assert open_groups(loose, NOT_HELD) == []
