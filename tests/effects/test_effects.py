"""Effects against closed-form solutions: memory, sticking, composition, gates, and the registry's promises."""

import re
from dataclasses import dataclass

import numpy as np
import pytest

from gpsim.effects import (
    FAMILIES,
    ActuatorEffect,
    Chain,
    ForceEffect,
    Gate,
    Place,
    RateEffect,
    Term,
    effect_of,
    from_json,
    has_patch,
    to_json,
)
from gpsim.effects.registry import register
from gpsim.errors import UsageError
from gpsim.simulators import SIMULATORS, make_simulator

H = 0.005


def actuate(family, commands, h=H, **values):
    """What an actuator effect makes of a sequence of commands, each held for h: at once and one by one the same."""
    effect = FAMILIES[family]
    columns = {k: np.array([[v]]) for k, v in values.items()}
    u = np.asarray(commands, dtype=float)[None]
    t, step = h * np.arange(u.shape[1])[None], np.full(u.shape, h)
    given = u.copy()
    at_once = effect.actuate(u, columns, effect.begin(1, 0.5, h), step, t)[0]
    memory = effect.begin(1, 0.5, h)
    one_by_one = []
    for i in range(u.shape[1]):
        command = u[:, i : i + 1].copy()
        one_by_one.append(effect.actuate(command, columns, memory, step[:, [i]], t[:, [i]])[0, 0])
        assert command == given[:, i]
    np.testing.assert_array_equal(u, given)  # what was commanded is another's
    np.testing.assert_allclose(one_by_one, at_once, rtol=0, atol=1e-14)
    return at_once


def slide(family, values, state, force=0.0, seconds=1.0, mass=2.0, h=H, gate=None, on="q"):
    """A slider with one force effect, after some seconds."""
    slider = make_simulator("slider")
    chain = Chain(slider, {"mass": mass}, (Term(family, on, values, gate or Gate()),), "fine", 0.02)
    arrays = [{k: np.array([v]) for k, v in values.items()}]
    s, step = np.array([state], dtype=float), np.array([h])
    for i in range(round(seconds / h)):
        s = chain.advance(s, np.array([[force]]), arrays, step, np.array([i * h]))
    return s[0]


def test_delay_shifts_and_splits_between_substeps():
    u = np.array([0, 1, 1, 1, 0, 0, 0, 0.0])
    np.testing.assert_allclose(actuate("actuator_delay", u, delay=2 * H), [0, 0, 0, 1, 1, 1, 0, 0])
    np.testing.assert_allclose(actuate("actuator_delay", u, delay=0.25 * H)[:3], [0, 0.75, 1])


@pytest.mark.parametrize("delay", [0.0, 0.004, 0.0373, 0.2])
def test_a_delay_is_a_time_on_an_uneven_clock_too(delay):
    """Means over the substeps of what was commanded a delay ago, against sums over very short ones."""
    rng, effect = np.random.default_rng(5), FAMILIES["actuator_delay"]
    step = rng.uniform(0.3, 1.7, (1, 60)) * H
    step[0, [7, 8, 31]] = 0.0  # samples that bear one stamp
    commands, values = rng.normal(size=(1, 60)), {"delay": np.array([[delay]])}
    ends = np.cumsum(step[0])
    begins = ends - step[0]
    fine = begins[:, None] + step[0, :, None] * (np.arange(2000) + 0.5) / 2000 - delay
    given = np.where(fine < 0, 0.0, commands[0][np.searchsorted(ends, fine, side="right").clip(max=59)])
    expected, lasting = given.mean(axis=1), step[0] > 0
    at_once = effect.actuate(commands, values, effect.begin(1, 0.5, H), step, begins[None])[0]
    np.testing.assert_allclose(at_once[lasting], expected[lasting], atol=5e-3)
    assert np.isfinite(at_once).all()
    memory = effect.begin(1, 0.5, H)
    one_by_one = [
        effect.actuate(commands[:, [i]], values, memory, step[:, [i]], begins[None, [i]])[0, 0]
        for i in range(60)
    ]
    np.testing.assert_allclose(one_by_one, at_once, rtol=0, atol=1e-9)
    pieces, shares = effect.pieces(commands, values, effect.begin(1, 0.5, H), step, begins[None])
    np.testing.assert_allclose(shares.sum(axis=2), 1.0)
    np.testing.assert_allclose((pieces * shares).sum(axis=2)[0], at_once, atol=1e-12)


def test_lag_is_the_exact_mean_of_the_exponential():
    tau, n = 0.03, 200
    out = actuate("actuator_lag", np.ones(n), time_constant=tau)
    edges = H * np.arange(n + 1)
    integral = edges + tau * np.exp(-edges / tau)
    np.testing.assert_allclose(out, np.diff(integral) / H, rtol=1e-10)


def test_rate_limit_is_the_exact_mean_of_the_ramp():
    rate, n = 30.0, 12
    out = actuate("actuator_rate_limit", np.ones(n), rate=rate)
    fine = np.minimum(rate * (np.arange(n * 1000) + 0.5) * H / 1000, 1.0).reshape(n, 1000).mean(axis=1)
    np.testing.assert_allclose(out, fine, atol=1e-6)


def test_backlash_keeps_its_output_inside_the_gap():
    u = np.array([0, 0.5, 2.0, 1.5, 0.9, -3.0])
    np.testing.assert_allclose(actuate("actuator_backlash", u, half_width=1.0), [0, 0, 1, 1, 1, -2])


@pytest.mark.parametrize(
    ("family", "values", "expected"),
    [
        ("actuator_gain", {"gain": 0.5}, [-1.0, -0.1, 0.1, 1.0]),
        ("actuator_bias", {"bias": 0.3}, [-1.7, 0.1, 0.5, 2.3]),
        ("actuator_dead_zone", {"width": 0.5}, [-2.0, 0.0, 0.0, 2.0]),
        ("actuator_saturation", {"limit": 1.0}, [-1.0, -0.2, 0.2, 1.0]),
        ("actuator_asymmetry", {"gain_positive": 2.0, "gain_negative": 0.5}, [-1.0, -0.1, 0.4, 4.0]),
    ],
)
def test_static_actuators(family, values, expected):
    np.testing.assert_allclose(actuate(family, [-2.0, -0.2, 0.2, 2.0], **values), expected)


def test_coulomb_friction_stops_a_body_where_the_energy_is_spent_and_holds_it():
    v, force, mass = 1.3, 3.0, 2.0
    end = slide("coulomb_friction", {"force": force}, [0.0, v], seconds=3.0)
    assert end[1] == 0.0
    np.testing.assert_allclose(end[0], mass * v**2 / (2 * force), rtol=2e-4)
    held = slide("coulomb_friction", {"force": force}, [0.0, 0.0], force=2.99)
    np.testing.assert_array_equal(held, [0.0, 0.0])
    moved = slide("coulomb_friction", {"force": force}, [0.0, 0.0], force=4.0)
    np.testing.assert_allclose(moved, [0.25, 0.5], rtol=1e-12)


def test_coulomb_friction_reverses_without_losing_time():
    """Against the push a body stops at v m / (F + Fc) and then starts the other way."""
    v, push, force, mass, total = 1.0, -6.0, 2.0, 2.0, 1.0
    stop = v * mass / (abs(push) + force)
    expected = -(total - stop) * (abs(push) - force) / mass
    end = slide("coulomb_friction", {"force": force}, [0.0, v], force=push, seconds=total, h=0.013 / 1.3)
    np.testing.assert_allclose(end[1], expected, rtol=1e-9)


def test_viscous_and_quadratic_drag_decay_as_they_should():
    t, mass = 1.0, 2.0
    end = slide("viscous_friction", {"damping": 1.5}, [0.0, 2.0], seconds=t)
    np.testing.assert_allclose(end[1], 2 * np.exp(-1.5 * t / mass), rtol=1e-5)
    end = slide("quadratic_drag", {"drag": 1.5}, [0.0, 2.0], seconds=t)
    np.testing.assert_allclose(end[1], 2 / (1 + 2 * 1.5 * t / mass), rtol=1e-4)


def test_a_spring_swings_with_its_period_about_its_rest():
    stiffness, mass = 8.0, 2.0
    period = 2 * np.pi * np.sqrt(mass / stiffness)
    end = slide(
        "spring", {"stiffness": stiffness, "rest_position": 0.1}, [0.6, 0.0], seconds=period, h=period / 2000
    )
    np.testing.assert_allclose(end, [0.6, 0.0], atol=1e-4)


def test_gates_limit_effects_in_space_and_time():
    inside = Gate(region={"q": (0.0, 1.0)})
    assert slide("constant_force", {"force": 1.0}, [-5.0, 0.0], gate=inside)[1] == 0.0
    np.testing.assert_allclose(slide("constant_force", {"force": 1.0}, [0.2, 0.0], gate=inside)[1], 0.5)
    np.testing.assert_allclose(
        slide("constant_force", {"force": 1.0}, [0, 0.0], gate=Gate(since=0.6))[1], 0.2, atol=0.003
    )


def test_coefficient_solves_force_and_load_together():
    """The thesis's cart-pole: friction of the normal force, which the friction itself changes (Florian 2007)."""
    cartpole = make_simulator("cartpole")
    p, mu = cartpole.defaults(), 0.9
    rng = np.random.default_rng(0)
    state, action = rng.normal(size=(30, 4)) * [1, 2, 0.5, 2], rng.normal(size=(30, 1)) * 10
    chain = Chain(
        cartpole,
        p,
        (Term("coulomb_friction", "x", {"coefficient": mu}, variant="coefficient"),),
        "euler",
        0.02,
    )
    step = np.full(30, 0.02)
    after = chain.advance(state, action, [{"coefficient": np.full(30, mu)}], step, np.zeros(30))
    x_acc, theta_acc = cartpole.measured_rates(state, after, step).T
    m, l_, total = p["pole_mass"], p["pole_half_length"], p["cart_mass"] + p["pole_mass"]
    sin, cos, spin = np.sin(state[:, 2]), np.cos(state[:, 2]), state[:, 3] ** 2
    normal = total * p["gravity"] - m * l_ * (theta_acc * sin + spin * cos)
    push = action[:, 0] + m * l_ * (spin * sin - theta_acc * cos) - mu * normal * np.sign(state[:, 1])
    np.testing.assert_allclose(x_acc, push / total, atol=1e-10)
    np.testing.assert_allclose(4 / 3 * l_ * theta_acc, p["gravity"] * sin - x_acc * cos, atol=1e-10)


def test_vehicle_effects():
    one = lambda v: np.array([v])  # noqa: E731
    twist = lambda family, **values: [  # noqa: E731
        float(x[0])
        for x in FAMILIES[family].twist(one(2.0), one(0.0), one(3.0), {k: one(v) for k, v in values.items()})
    ]
    assert twist("minimum_turning_radius", radius=1.0) == [2.0, 0.0, 2.0]
    assert twist("understeer", gradient=0.5) == [2.0, 0.0, 1.0]
    assert twist("steering_bias", curvature=0.25) == [2.0, 0.0, 3.5]
    assert twist("lateral_slip", slip=0.1) == pytest.approx([2.0, -0.6, 3.0])


def test_every_family_says_what_it_needs_on_every_simulator():
    for name in SIMULATORS:
        simulator = make_simulator(name)
        for effect in FAMILIES.values():
            for on in effect.places(simulator):
                place = Place(on, "N", loaded=True)
                for variant in effect.variants:
                    declared = effect.parameters(place, variant)
                    assert declared
                    for p in declared:
                        assert p.low <= min(p.starts) <= max(p.starts) <= p.high, (effect.family, p)


@pytest.mark.parametrize(
    ("force", "length", "expected"),
    [
        ("kN", "m", ["kN s/m", "kN s^2/m^2", "kN/m", "m", "m/s"]),
        ("N", "mm", ["N s/mm", "N s^2/mm^2", "N/mm", "mm", "mm/s"]),
        ("N m", "rad", ["N m s/rad", "N m s^2/rad^2", "N m/rad", "rad", "rad/s"]),
        ("N", "", ["N s/m", "N s^2/m^2", "N/m", "m", "m/s"]),
        ("N m", "", ["N m s/rad", "N m s^2/rad^2", "N m/rad", "rad", "rad/s"]),
    ],
)
def test_units_of_forces_follow_from_the_position_they_depend_on(force, length, expected):
    """A length unit that nobody gave is guessed from the force's, as for the built-in systems."""
    place = Place("q", force, length=length)
    units = {
        family: {p.name: p.unit for p in FAMILIES[family].parameters(place)}
        for family in ("viscous_friction", "quadratic_drag", "spring", "stribeck_friction")
    }
    assert [
        units["viscous_friction"]["damping"],
        units["quadratic_drag"]["drag"],
        units["spring"]["stiffness"],
        units["spring"]["rest_position"],
        units["stribeck_friction"]["stribeck_velocity"],
    ] == expected


def test_the_registry_refuses_duplicates_and_names_the_alternatives():
    with pytest.raises(ValueError, match="twice"):
        register([FAMILIES["spring"], FAMILIES["spring"]])


def test_a_family_says_what_its_law_is_a_function_of():
    class Silent(ForceEffect):
        family = "silent"

        def parameters(self, place, variant=""):
            return ()

    with pytest.raises(ValueError, match=r"'silent' does not define function_of for its law"):
        register([Silent()])


def test_what_a_law_is_a_function_of_is_all_that_moves_it():
    """A friction is the same everywhere, a spring at every speed."""
    q, v = np.array([-0.7, 0.2, 0.9]), np.array([-1.3, 0.4, 0.8])
    of_one = [
        e for e in FAMILIES.values() if isinstance(e, ForceEffect) and e.function_of in ("speed", "position")
    ]
    for effect in of_one:
        values = {p.name: np.full(3, p.starts[0]) for p in effect.parameters(Place("q", "N"))}
        of = effect.force if not effect.dry else lambda x, s, given: effect.friction_limit(x, s, given, None)  # noqa: B023
        moved = of(q + 0.3, v, values) if effect.function_of == "speed" else of(q, v + 0.3, values)
        np.testing.assert_array_equal(of(q, v, values), moved, err_msg=effect.family)
    with pytest.raises(UsageError, match="gpsim effects list"):
        Term("no_such_effect", "q").effect  # noqa: B018


def test_terms_survive_json():
    term = Term("spring", "q", {"stiffness": 2.0, "rest_position": 0.1}, Gate({"q": (0.0, 1.0)}, 3.0))
    assert from_json(to_json(term)) == term
    with pytest.raises(UsageError, match="an effect needs"):
        from_json({"family": "spring"})


@pytest.mark.parametrize("family", FAMILIES)
def test_every_family_states_its_law_its_units_and_where_it_comes_from(family):
    """A reference has a year; what is plain arithmetic says that it is a definition."""
    effect = FAMILIES[family]
    law, _, source = (type(effect).__doc__ or "").partition("\n\n")
    assert law
    assert re.search(r"\b1[6-9]\d\d\b|\b20\d\d\b|Definition:|section", source), source
    assert type(effect).parameters.__doc__
    simulators = [make_simulator(name) for name in SIMULATORS]
    on = next((place for simulator in simulators for place in effect.places(simulator)), None)
    if on is None:  # of models of bodies (tests/mjcf), or of a user's simulator of the first order
        on = "q"
        assert effect.acts_on or family in ("overflow", "spillover")
    assert all(p.unit for p in effect.parameters(Place(on, "N")))


@pytest.mark.parametrize("family", [f for f, e in FAMILIES.items() if isinstance(e, ActuatorEffect)])
def test_a_family_says_that_it_drifts_if_its_law_knows_the_time(family):
    effect, commands = FAMILIES[family], np.array([[1.0, -2.0, 3.0]])
    values = {p.name: np.array([[p.starts[0]]]) for p in effect.parameters(Place("u", "N"))}
    step = np.full((1, 3), H)
    said = [
        effect.actuate(commands, values, effect.begin(1, 0.5, H), step, late + H * np.arange(3.0)[None])
        for late in (0.0, 3.0)
    ]
    assert (not np.array_equal(*said)) == effect.drifts


def test_a_patch_names_the_law_that_it_is_a_piece_of():
    """Inside its region a patch grips as its family does everywhere, and it makes sense in a region only."""
    patches = {f: e.patch_of for f, e in FAMILIES.items() if e.patch_of is not None}
    assert patches == {"local_friction_patch": "coulomb_friction"}
    assert [f for f in FAMILIES if has_patch(f)] == ["coulomb_friction"]
    q, values = np.zeros(2), {"force": np.array([1.5, 2.0])}
    for family, whole in patches.items():
        assert FAMILIES[family].needs_region
        grips = [effect_of(f).friction_limit(q, q + 1.0, values, None) for f in (family, whole)]
        np.testing.assert_array_equal(*grips)


def test_a_delay_says_the_same_step_by_step_and_all_at_once():
    """Its past is in a ring when it is asked step by step, and in order when it is not."""
    rng, law, step = np.random.default_rng(0), effect_of("actuator_delay"), np.full((6, 300), 0.01)
    commands, t = rng.normal(size=(6, 300)), np.cumsum(step, axis=1) - step
    values = {
        "delay": np.array([0.0, 0.004, 0.05, 0.123, 0.3, 0.5])[:, None]
    }  # the last one beyond what it remembers
    whole = law.actuate(commands, values, law.begin(6, 0.3, 0.01), step, t)
    memory, parts, sizes = law.begin(6, 0.3, 0.01), [], [1] * 70 + [50] + [1] * 9 + [2] + [1] * 169
    for first, size in zip(np.cumsum([0, *sizes]), sizes, strict=False):
        part = slice(first, first + size)
        parts.append(law.actuate(commands[:, part], values, memory, step[:, part], t[:, part]))
    np.testing.assert_array_equal(np.concatenate(parts, axis=1), whole)


class Drift(RateEffect):
    """A rate that the first state channel and the first command drive."""

    family = "drift"

    def parameters(self, place, variant=""):
        return ()

    def added(self, simulator, state, action, parameters, values, on):
        out = np.zeros((len(state), len(simulator.rate)))
        out[:, -1] = values["k"] * state[:, 0] + action[:, 0]
        return out


@dataclass(frozen=True)
class DriftTerm(Term):
    @property
    def effect(self):
        return Drift()


@pytest.mark.parametrize("scheme", ["fine", "euler"])
def test_what_is_added_to_the_rates_moves_what_they_move(scheme):
    """Of a slider, against q'' = (u + k q m) / m + u; of a vehicle, whose rates else stay the same within a step."""
    slider, mass = make_simulator("slider"), 2.0
    term = DriftTerm("drift", "q_acc", {"k": -4.0})
    chain = Chain(slider, {"mass": mass}, (term,), scheme, 0.01)
    state, h, u = np.array([[1.0, 0.0]]), 1e-4, np.array([[0.5]])
    for i in range(10000):
        state = chain.advance(state, u, [{"k": np.array([-4.0])}], np.array([h]), np.array([i * h]))
    rest = 0.5 * (1 / mass + 1) / 4.0
    assert state[0, 0] == pytest.approx(rest + (1 - rest) * np.cos(2.0), abs=2e-3)
    unicycle = make_simulator("unicycle")
    turning = Chain(unicycle, {}, (DriftTerm("drift", "w", {"k": 1.0}),), "fine", 0.1)
    moved = turning.advance(
        np.array([[0.0, 0.0, 0.0]]),
        np.array([[1.0, 0.0]]),
        [{"k": np.array([1.0])}],
        np.array([0.1]),
        np.array([0.0]),
    )
    assert moved[0, 2] == pytest.approx(0.1 + 0.1**2 / 2, rel=1e-2)  # w = v + x, and x grows
