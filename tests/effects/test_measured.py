"""Measured curves as effects: what they add, beyond where they were measured, in files and in a corrected simulator."""

import json

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from gpsim.corrected import EffectsPlant, describe, plant_from
from gpsim.effects import CURVES, FAMILIES, Gate, Place, Shape, Term, effect_of, from_json, shape_of, to_json
from gpsim.errors import UsageError
from gpsim.simulators import make_simulator

SHAPE = Shape(((-1.0, 0.0, 2.0),), (3.0, 0.0, -4.0))


def one(x):
    return np.array([float(x)])


def values(term):
    return {name: one(value) for name, value in term.values.items()}


def test_a_force_is_straight_between_its_knots_and_held_beyond_them():
    term = Term("force_curve", "q", SHAPE.values(3.0), variant="speed")
    speeds = np.array([-5.0, -1.0, -0.5, 1.0, 2.0, 9.0])
    force = term.effect.force(np.zeros(6), speeds, {"scale": np.full(6, 2.0)})
    np.testing.assert_allclose(force, 2.0 * np.array([3.0, 3.0, 1.5, -2.0, -4.0, -4.0]))
    np.testing.assert_array_equal(SHAPE.outside(speeds), [True, False, False, False, False, True])


def test_friction_holds_at_rest_as_much_as_both_directions_say():
    shape = Shape(((-1.0, 0.0, 0.0, 1.0),), (4.0, 1.0, 2.0, 5.0))
    effect = Term("force_curve", "q", shape.values(4.0), variant="friction").effect
    speeds = np.array([-0.5, 0.0, 0.5])
    assert effect.dry
    assert effect.force(speeds, speeds, {}) is None
    most = effect.friction_limit(np.zeros(3), speeds, {"scale": np.ones(3)}, None)
    np.testing.assert_allclose(most, [2.5, 1.5, 3.5])


def test_a_position_that_turns_round_is_the_same_place():
    term = Term(
        "force_curve",
        "theta",
        Shape(((-3.0, 0.0, 3.0),), (1.0, 0.0, 2.0), True).values(3.0),
        variant="position",
    )
    turned = [term.effect.force(one(x), one(0.0), values(term)) for x in (1.5, 1.5 + 4.0 * np.pi)]
    np.testing.assert_allclose(turned[0], turned[1])
    np.testing.assert_allclose(turned[0], 1.0)


def test_commands_readings_and_twists_keep_what_they_are_and_get_the_curve_beside():
    motor, sensor = (Term(family, "u", SHAPE.values(3.0)) for family in ("actuator_curve", "sensor_curve"))
    none = np.zeros((1, 1))
    said = motor.effect.actuate(np.array([[1.0]]), {"scale": np.ones((1, 1))}, {}, none, none)
    np.testing.assert_allclose(said, [[-1.0]])
    np.testing.assert_allclose(
        sensor.effect.measure(np.array([[7.0, 1.0]]), (1,), values(sensor), {}, one(0)), [[7.0, -1.0]]
    )
    table = Shape(((0.0, 1.0), (-1.0, 1.0)), (0.0, 0.0, -0.5, 0.5))
    turn = Term("rate_curve", "vehicle", table.values(4.0), variant="w")
    v, lateral, w = turn.effect.twist(one(0.5), one(0.0), one(1.0), values(turn))
    np.testing.assert_allclose([v, lateral, w], [[0.5], [0.0], [1.25]])


def test_a_curve_does_nothing_at_the_scale_that_says_so():
    for family, effect in CURVES.items():
        (scale,) = effect.parameters(Place("q", "N"))
        assert (scale.name, scale.none) == ("scale", 0.0), family
    term = Term("force_curve", "q", SHAPE.values(3.0) | {"scale": 0.0}, variant="speed")
    assert term.effect.force(one(0), one(1), values(term)) == 0.0


def test_the_catalogue_offers_no_curve():
    assert not set(CURVES) & set(FAMILIES)
    assert effect_of("force_curve") is CURVES["force_curve"]
    with pytest.raises(UsageError, match="did you mean 'force_curve'"):
        effect_of("force_curv")


def test_a_shape_comes_back_from_its_values():
    assert shape_of(SHAPE.values(7.5)) == SHAPE


def test_a_term_comes_back_from_its_file():
    term = Term("force_curve", "q", SHAPE.values(7.5), Gate(), "speed")
    again = from_json(json.loads(json.dumps(to_json(term))))
    assert again == term
    assert again.effect.shape == SHAPE


def test_a_corrected_simulator_moves_as_the_curve_says():
    """Beside SciPy's integration of the same force."""
    simulator = make_simulator("slider")
    terms = (Term("force_curve", "q", SHAPE.values(3.0), variant="speed"),)
    plant = EffectsPlant(simulator, simulator.defaults({"mass": 2.0}), terms, "fine", 20, 0.02)
    plant = plant_from(json.loads(json.dumps(describe(plant, False))), simulator)
    rng = np.random.default_rng(0)
    state, memory = np.array([[0.1, 1.6]]), plant.begin(1, rng)
    for _ in range(50):
        state = plant.step(state, np.array([[1.0]]), memory, rng)

    def slope(t, s):
        return [s[1], (1.0 + np.interp(s[1], [-1.0, 0.0, 2.0], [3.0, 0.0, -4.0])) / 2.0]

    true = solve_ivp(slope, (0.0, 1.0), [0.1, 1.6], rtol=1e-10, atol=1e-12).y[:, -1]
    np.testing.assert_allclose(state[0], true, rtol=1e-6)


def test_a_corrected_simulator_knows_where_a_curve_is_a_guess():
    simulator = make_simulator("slider")
    terms = (
        Term("force_curve", "q", SHAPE.values(3.0), variant="speed"),
        Term("actuator_curve", "force", Shape(((-5.0, 5.0),), (0.0, 1.0)).values(2.0)),
    )
    plant = EffectsPlant(simulator, simulator.defaults({}), terms, "fine", 4, 0.02)
    states = np.array([[9.0, 0.0], [0.0, 3.0], [0.0, 0.0]])
    actions = np.array([[0.0], [0.0], [-7.0]])
    np.testing.assert_array_equal(plant.extrapolates(states, actions), [False, True, True])
