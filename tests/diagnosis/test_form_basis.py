"""Piecewise linear functions: what they are between their knots, at jumps, beyond, and what their bends cost."""

import numpy as np
import pytest

from gpsim.diagnosis.form.basis import Basis, jumps_of, knots_of, speed_knots, two_sided_knots, with_jumps
from gpsim.diagnosis.form.laws import FreeGrip, HatGate
from gpsim.effects import Gate
from gpsim.simulators import make_simulator

PLAIN = Basis(((0.0, 1.0, 3.0),))
JUMPING = Basis(((-1.0, 0.0, 0.0, 2.0),))
PRODUCT = Basis(((0.0, 2.0), (0.0, 1.0, 3.0)))


def values(basis, coefficients, rows=1):
    return {name: np.full(rows, c) for name, c in zip(basis.names, coefficients, strict=True)}


def test_it_is_a_line_between_knots_and_constant_beyond():
    x = np.array([-5.0, 0.0, 0.5, 1.0, 2.0, 3.0, 9.0])
    said = PLAIN.value([x], values(PLAIN, [1.0, 2.0, -2.0], len(x)))
    np.testing.assert_allclose(said, [1.0, 1.0, 1.5, 2.0, 0.0, -2.0, -2.0])


def test_it_may_jump_at_a_knot_that_stands_twice():
    x = np.array([-1.0, -1e-12, 1e-12, 1.0])
    said = JUMPING.value([x], values(JUMPING, [0.0, 1.0, -3.0, -1.0], len(x)))
    np.testing.assert_allclose(said, [0.0, 1.0, -3.0, -2.0], atol=1e-9)


def test_friction_at_rest_is_the_mean_of_both_directions():
    law = FreeGrip(JUMPING, of_speed=True)
    speed = np.array([0.0, 1.0])
    said = law.grip(speed, speed, values(JUMPING, [0.0, 1.0, 3.0, 3.0], 2), None)
    np.testing.assert_allclose(said, [2.0, 3.0])


@pytest.mark.parametrize("basis", [PLAIN, JUMPING, PRODUCT])
def test_what_a_coefficient_counts_adds_up_to_the_function(basis):
    rng = np.random.default_rng(0)
    inputs = [rng.uniform(-2.0, 4.0, 50) for _ in basis.axes]
    coefficients = rng.normal(size=basis.size)
    design = basis.design(inputs)
    np.testing.assert_allclose(design.sum(axis=1), 1.0)
    np.testing.assert_allclose(design @ coefficients, basis.value(inputs, values(basis, coefficients, 50)))


def test_every_row_of_a_batch_has_coefficients_of_its_own():
    x = np.array([[0.5, 2.0], [0.5, 2.0]])
    own = {name: np.array([[a], [b]]) for name, a, b in zip(PLAIN.names, (1, 2, 0), (0, 0, 4), strict=True)}
    np.testing.assert_allclose(PLAIN.value([x], own), [[1.5, 1.0], [0.0, 2.0]])


def test_a_line_does_not_bend_and_a_constant_does_not_rise():
    line = np.array(PLAIN.axes[0])
    np.testing.assert_allclose(PLAIN.bends(0) @ line, 0.0, atol=1e-12)
    assert np.abs(PLAIN.bends(0) @ line**2).max() > 0.1
    np.testing.assert_allclose(PLAIN.slopes(0) @ np.ones(3), 0.0, atol=1e-12)
    x, y = np.meshgrid(*PRODUCT.axes, indexing="ij")
    np.testing.assert_allclose(PRODUCT.bends(1) @ (x * y).ravel(), 0.0, atol=1e-12)
    assert np.abs(PRODUCT.slopes(0) @ (x * y).ravel()).max() > 0.1
    np.testing.assert_allclose(PRODUCT.slopes(0) @ y.ravel(), 0.0, atol=1e-12)


def test_a_jump_costs_nothing():
    np.testing.assert_allclose(JUMPING.bends(0) @ [1.0, 2.0, -7.0, -5.0], 0.0, atol=1e-12)


def test_mean_curvature_does_not_depend_on_how_many_knots_there_are():
    def curvature(count):
        x = np.linspace(0.0, 1.0, count)
        return float(((Basis((tuple(x),)).bends(0) @ x**2) ** 2).sum())

    assert curvature(101) == pytest.approx(4.0, rel=0.03)  # of x squared: the square of 2
    assert curvature(41) == pytest.approx(curvature(101), rel=0.05)


def test_knots_are_close_where_samples_are_and_not_too_far_in_the_tails():
    visited = np.append(np.random.default_rng(0).normal(size=1000), [8.0])
    knots = np.array(knots_of(visited, 16))
    assert len(knots) == 16
    assert (knots[0], knots[-1]) == (visited.min(), 8.0)
    assert np.diff(knots).max() < 0.8 * np.diff(np.quantile(visited, np.linspace(0, 1, 16))).max()
    assert np.diff(knots).min() < 0.7 * np.ptp(visited) / 15
    assert knots_of(np.ones(5), 16) == (1.0,)
    assert knots_of(np.empty(0), 16) == ()


def test_friction_has_a_knot_at_rest_or_two_where_it_jumps():
    speeds = np.random.default_rng(0).normal(size=1000)
    assert 0.0 in speed_knots(speeds, 11)
    both = two_sided_knots(speeds, 10, 0.02)
    assert both.count(0.0) == 2
    assert len(both) == 12
    forward = two_sided_knots(np.append(np.abs(speeds), -0.1), 10, 0.02)
    assert forward[0] == 0.0
    assert forward.count(0.0) == 1


def test_jumps_of_a_law_are_found_to_a_point_and_nothing_else_is_one():
    def dead_zone(u):
        return u * (np.abs(u) > 1.37)

    np.testing.assert_allclose(jumps_of(dead_zone, -5.0, 4.0), [-1.37, 1.37], atol=1e-9)
    assert not jumps_of(lambda u: np.clip(u, -3.0, 3.0), -5.0, 5.0)
    assert not jumps_of(lambda u: 0.0 * u, -5.0, 5.0)
    assert with_jumps((0.0, 1.0, 1.999, 4.0), [2.0, 9.0]) == (0.0, 1.0, 2.0, 2.0, 4.0)


def test_gates_along_a_further_input_add_up_to_the_gate_that_they_divide():
    channels = make_simulator("slider").state + make_simulator("slider").action
    state = np.stack([np.linspace(-1.0, 1.0, 9), np.zeros(9)], axis=1)
    action, t, step = np.zeros((9, 1)), np.linspace(0.0, 1.0, 9), np.zeros(9)
    knots = (-0.5, 0.0, 0.5)
    for own in (Gate(), Gate(since=0.45)):
        gates = [HatGate(since=own.since, along="q", knots=knots, place=i) for i in range(3)]
        assert all(gates)
        shares = [g.share((state, state), action, t, step, channels, {}) for g in gates]
        np.testing.assert_allclose(sum(shares), own.share((state, state), action, t, step, channels, {}))
        assert max(s.max() for s in shares) == 1.0
