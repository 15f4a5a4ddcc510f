"""Effects together, between substeps: order of integration, partial substeps at gates, fixed order, late sensors."""

import itertools
from typing import ClassVar

import numpy as np
import pytest

from gpsim.channels import Channels
from gpsim.effects import Chain, Gate, Term
from gpsim.simulators import Coordinate, make_simulator
from gpsim.simulators.systems import PlanarVehicle, Unicycle


def run(simulator, terms, state, action, h, seconds, parameters=None):
    """The state after some seconds of one action."""
    system = make_simulator(simulator)
    chain = Chain(system, system.defaults(parameters or {}), tuple(terms), "fine", 0.02)
    values = [{k: np.array([v]) for k, v in term.values.items()} for term in terms]
    s, step = np.array([state], dtype=float), np.array([h])
    for i in range(round(seconds / h)):
        s = chain.advance(s, np.array([action], dtype=float), values, step, np.array([i * h]))
    return s[0]


def test_the_fine_scheme_is_of_third_order():
    start, errors = [0.1, 0.3, 2.5, -1.0], []
    exact = run("cartpole", [], start, [3.0], 1e-4, 1.0)
    for h in (0.02, 0.01, 0.005):
        errors.append(np.abs(run("cartpole", [], start, [3.0], h, 1.0) - exact).max())
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all((orders > 2.7) & (orders < 3.4)), orders


def test_an_onset_inside_a_substep_acts_for_the_rest_of_it():
    force, mass, since = 4.0, 2.0, 0.0133
    term = Term("constant_force", "q", {"force": force}, Gate(since=since))
    end = run("slider", [term], [0.0, 0.0], [0.0], 0.01, 0.1, {"mass": mass})
    assert end[1] == pytest.approx(force / mass * (0.1 - since), rel=1e-12)


def test_an_edge_crossed_inside_a_substep_counts_for_the_share_of_the_way():
    """A brake between two places: the energy it takes is force times the way between them, whatever the grid."""
    force, mass, v = 3.0, 2.0, 2.0
    left = np.sqrt(v**2 - 2 * force * 0.25 / mass)
    for h in (0.02, 0.01):
        term = Term("local_friction_patch", "q", {"force": force}, Gate(region={"q": (0.137, 0.387)}))
        end = run("slider", [term], [0.0, v], [0.0], h, 0.6, {"mass": mass})
        assert end[1] == pytest.approx(left, rel=5e-3)


def test_a_region_of_an_angle_that_wraps_is_met_again_after_every_turn():
    channels = make_simulator("unicycle").state + make_simulator("unicycle").action
    gate, t = Gate(region={"yaw": (3.0, 3.5)}), np.zeros(5)  # across the seam
    yaw = 3.2 + 2 * np.pi * np.arange(-2, 3)
    begin, end = (np.stack([0 * yaw, 0 * yaw, yaw + d], axis=1) for d in (-0.3, 0.1))
    share = gate.share((begin, end), np.zeros((5, 2)), t, np.full(5, 0.1), channels, {})
    np.testing.assert_allclose(share, 0.75)  # from 2.9 to 3.3
    outside = gate.share((begin + 2.0, begin + 2.0), np.zeros((5, 2)), t, t, channels, {})
    np.testing.assert_array_equal(outside, 0.0)


def test_several_effects_on_a_twist_act_in_a_fixed_order():
    terms = [
        Term("lateral_slip", "vehicle", {"slip": 0.2}),
        Term("understeer", "vehicle", {"gradient": 0.5}),
        Term("minimum_turning_radius", "vehicle", {"radius": 0.8}),
        Term("steering_bias", "vehicle", {"curvature": 0.1}),
    ]
    ends = [
        run("unicycle", order, [0, 0, 0.3], [0.7, 1.5], 0.01, 0.5) for order in itertools.permutations(terms)
    ]
    for end in ends[1:]:
        np.testing.assert_array_equal(end, ends[0])
    w = (0.7 / 0.8) / (
        1 + 0.5 * 0.7**2
    ) + 0.1 * 0.7  # what the wheels can do, understeered, and the bent linkage
    assert ends[0][2] == pytest.approx(0.3 + 0.5 * w, rel=1e-9)


class Tanker(PlanarVehicle):
    """A unicycle with a load that slides in it along d."""

    name = "tanker"
    state = PlanarVehicle.state + Channels.of({"d": "m", "d_dot": "m/s"})
    action = Channels.of({"v_cmd": "m/s", "w_cmd": "rad/s"})
    rate = PlanarVehicle.rate + Channels.of({"d_acc": "m/s^2"})
    parameters: ClassVar = {}
    coordinates = (Coordinate("d", "d_dot", "d_acc", "N"),)

    def rates(self, state, action, parameters, forces=None):
        load = np.zeros(len(state)) if forces is None else forces[:, 0]
        return np.stack([action[:, 0], 0 * load, action[:, 1], load], axis=1)

    def derivative(self, state, rates):
        pose = super().derivative(state[:, :3], rates[:, :3])
        return np.concatenate([pose, state[:, 4:], rates[:, 3:]], axis=1)


def test_effects_on_a_twist_act_beside_forces():
    curve = Term("minimum_turning_radius", "vehicle", {"radius": 2.0})
    drag = Term("viscous_friction", "d", {"damping": 0.5})
    state, action = np.array([[0.0, 0.0, 0.0, 0.0, 1.0]]), np.array([[1.0, 2.0]])
    ends = []
    for terms in ((curve,), (curve, drag), (drag,)):
        chain, at = Chain(Tanker(), {}, terms, "fine", 0.1), state
        for _ in range(10):
            at = chain.advance(at, action, [t.values for t in terms], np.array([0.1]), np.zeros(1))
        ends.append(at[0])
    assert [end[2] for end in ends] == pytest.approx([0.5, 0.5, 2.0])
    assert [end[4] for end in ends] == pytest.approx([1.0, np.exp(-0.5), np.exp(-0.5)], rel=1e-4)


class Leaning(Unicycle):
    """A unicycle that turns the more, the further it has come: no longer kinematic, though derived from one."""

    def rates(self, state, action, parameters, forces=None):
        return super().rates(state, action, parameters) + np.array([0.0, 0.0, 1.0]) * state[:, :1]


@pytest.mark.parametrize("scheme", ["fine", "euler", "rk4"])
def test_rates_that_an_action_holds_are_the_same_found_once_or_at_every_state(scheme):
    terms = (Term("lateral_slip", "vehicle", {"slip": 0.2}), Term("understeer", "vehicle", {"gradient": 0.5}))
    values, action = [t.values for t in terms], np.array([[0.7, 1.5]])
    ends = []
    for kinematic in (True, False):
        vehicle = type("Vehicle", (Unicycle,), {"kinematic": kinematic})()
        at, chain = np.array([[0.0, 0.0, 0.3]]), Chain(vehicle, {}, terms, scheme, 0.1)
        for _ in range(20):
            at = chain.advance(at, action, values, np.array([0.1]), np.zeros(1))
        ends.append(at)
    np.testing.assert_array_equal(*ends)


def test_a_vehicle_with_rates_of_its_own_is_asked_at_every_state():
    assert Unicycle().kinematic
    assert not Leaning().kinematic
    at, chain = np.zeros((1, 3)), Chain(Leaning(), {}, (), "fine", 0.01)
    for _ in range(100):
        at = chain.advance(at, np.array([[1.0, 0.0]]), [], np.full(1, 0.01), np.zeros(1))
    # With yaw' = x and x' = cos yaw, x^2 / 2 - sin yaw stays what it was.
    assert at[0, 0] ** 2 / 2 == pytest.approx(np.sin(at[0, 2]), abs=1e-6)


def test_a_sensor_scales_before_it_is_biased_whatever_was_found_first():
    slider = make_simulator("slider")
    terms = [Term("sensor_bias", "q", {"offset": 0.1}), Term("sensor_scale", "q", {"scale": 2.0})]
    for order in (terms, terms[::-1]):
        chain = Chain(slider, slider.defaults({}), tuple(order), "fine", 0.02)
        values = [{k: np.array([v]) for k, v in term.values.items()} for term in order]
        read = chain.sensors.measure(np.array([[0.5, 0.0]]), values, {}, np.array([0.01]))
        assert read[0, 0] == pytest.approx(1.1)


def test_a_late_sensor_reads_between_substeps_to_fourth_order():
    def read(h, delay=0.0337):
        slider = make_simulator("slider")
        chain = Chain(
            slider, slider.defaults({}), (Term("sensor_delay", "q", {"delay": delay}),), "fine", 0.02
        )
        t = 1.0 + h * np.arange(-12, 1)
        history = np.stack([np.sin(3 * t), 3 * np.cos(3 * t)], axis=1)[None]
        values, step = [{"delay": np.array([delay])}], np.array([h])
        seen = chain.sensors.begin(history, values, step)
        said = chain.sensors.measure(history[:, -1], values, seen, step)
        return abs(said[0, 0] - np.sin(3 * (1.0 - delay)))

    assert read(0.01) < 1e-6
    assert read(0.005) < read(0.01)


@pytest.mark.parametrize("delay", [0.0, 0.0111, 0.0337])
def test_a_late_sensor_reads_a_time_ago_on_an_uneven_clock(delay):
    slider = make_simulator("slider")
    chain = Chain(slider, {}, (Term("sensor_delay", "q", {"delay": delay}),), "fine", 0.02)
    values = [{"delay": np.full(2, delay)}]
    steps = np.random.default_rng(1).uniform(0.002, 0.015, (2, 40))
    steps[1, 10:] = 0.005
    steps[1, 25] = 0.0  # two samples that bear one stamp
    t = np.cumsum(steps, axis=1)
    states = np.stack([np.sin(3 * t), 3 * np.cos(3 * t)], axis=2)
    memory = chain.sensors.begin(states[:, :20], values, steps[:, 0], steps[:, :20])
    for k in range(20, 40):
        chain.sensors.watch(states[:, k], values, memory, steps[:, k])
        said = chain.sensors.measure(states[:, k], values, memory, steps[:, k])
        np.testing.assert_allclose(said[0, 0], np.sin(3 * (t[0, k] - delay)), atol=2e-6)
        np.testing.assert_allclose(
            said[1, 0], np.sin(3 * (t[1, k] - delay)), atol=5e-5
        )  # straight between some


@pytest.mark.parametrize(
    ("name", "coordinate"), [("cartpole", 0), ("cartpole", 1), ("slider", 0), ("pendulum", 0)]
)
def test_mobility_is_what_a_unit_force_changes(name, coordinate):
    system = make_simulator(name)
    rng = np.random.default_rng(0)
    state, action = rng.normal(size=(9, len(system.state))), rng.normal(size=(9, 1))
    fixed = system.defaults({})
    for parameters in (fixed, {k: v * rng.uniform(0.5, 2.0, 9) for k, v in fixed.items()}):
        unit = np.zeros((9, len(system.coordinates)))
        unit[:, coordinate] = 1.0
        pushed, free = (system.rates(state, action, parameters, f) for f in (unit, 0 * unit))
        found = system.mobility(state, parameters, coordinate)
        np.testing.assert_allclose(found, pushed - free, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("follower", ["actuator_dead_zone", "actuator_rate_limit", "actuator_backlash"])
def test_what_follows_a_delay_sees_both_commands_of_a_substep(follower):
    """Means over substeps of any length are the means over much shorter ones, whose delay is a whole number of them."""
    given = {
        "actuator_dead_zone": {"width": 1.0},
        "actuator_rate_limit": {"rate": 200.0},
        "actuator_backlash": {"half_width": 0.4},
    }[follower]
    terms = (Term("actuator_delay", "force", {"delay": 0.0266}), Term(follower, "force", given))
    commands = np.random.default_rng(3).uniform(-3, 3, 12)
    chain = Chain(make_simulator("slider"), {"mass": 1.0}, terms, "fine", 0.02)
    values = [{k: np.array([v]) for k, v in term.values.items()} for term in terms]

    def means(substeps):
        h, count = 0.02 / substeps, 12 * substeps
        held = np.repeat(commands, substeps)[None, :, None]
        t, step = h * np.arange(count)[None], np.full((1, count), h)
        memory = chain.actuation.rest(1, h)
        acted = chain.commands(held, np.zeros((1, count + 1, 2)), values, memory, step, t)
        return acted.reshape(12, substeps).mean(axis=1)

    np.testing.assert_allclose(means(2), means(400), atol=2e-3)
