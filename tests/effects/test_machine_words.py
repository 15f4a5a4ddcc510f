"""Families that machines need: against independent integrators, at their edges, and found again in a short world."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

import gpsim
from gpsim.diagnosis import diagnose
from gpsim.diagnosis.run import Run
from gpsim.diagnosis.settings import Known
from gpsim.diagnosis.setup.log_facts import stands, telling, unread
from gpsim.diagnosis.setup.sizes import pushed_back, ripples
from gpsim.effects import FAMILIES, Chain, Place, Term
from gpsim.recordings import Episode, Recording
from gpsim.simulators import make_simulator
from gpsim.trials import catalogue
from gpsim.trials.drawing import bare_world, with_effects
from gpsim.trials.shares import visibilities
from gpsim.trials.truth import run
from gpsim.trials.worlds import SYSTEMS, Scales

MASS, SECONDS, H = 2.0, 1.0, 0.0025
SLIDER = make_simulator("slider")
VALUES = {
    "cubic_spring": {"stiffness": 3.0, "cubic": 40.0, "rest_position": 0.1},
    "cogging_force": {"amplitude": 2.0, "period": 0.2, "phase": 0.7},
    "end_stop": {"low": -0.1, "high": 0.15, "stiffness": 300.0, "damping": 4.0},
    "load_friction": {"share": 0.3},
    "torque_speed_limit": {"stall": 5.0, "no_load_speed": 1.2},
    "actuator_dead_band": {"width": 1.0},
}


def push(t):
    """A command [N] that is held for 0.05 s."""
    return 6.0 * np.sin(5.0 * 0.05 * np.floor(t / 0.05 + 1e-9))


def expected(family, k):
    """q and q_dot of the slider after SECONDS, by scipy."""

    def stops(q, v):
        if q > k["high"]:
            return -max(k["stiffness"] * (q - k["high"]) + k["damping"] * v, 0.0)
        return max(k["stiffness"] * (k["low"] - q) - k["damping"] * v, 0.0) if q < k["low"] else 0.0

    def motor(u, v):
        high = k["stall"] * min(max(1 - v / k["no_load_speed"], 0.0), 1.0)
        low = -k["stall"] * min(max(1 + v / k["no_load_speed"], 0.0), 1.0)
        return min(max(u, low), high)

    laws = {
        "cubic_spring": lambda q, v, u: (
            u - k["stiffness"] * (q - k["rest_position"]) - k["cubic"] * (q - k["rest_position"]) ** 3
        ),
        "cogging_force": lambda q, v, u: (
            u + k["amplitude"] * np.sin(2 * np.pi * q / k["period"] + k["phase"])
        ),
        "end_stop": lambda q, v, u: u + stops(q, v),
        "load_friction": lambda q, v, u: u - k["share"] * abs(u) * np.tanh(v / 1e-5),
        "torque_speed_limit": lambda q, v, u: motor(u, v),
        "actuator_dead_band": lambda q, v, u: np.sign(u) * max(abs(u) - k["width"], 0.0),
    }
    state = np.array([0.0, 0.0])
    for step in range(round(SECONDS / 0.05)):
        u = push(step * 0.05)
        found = solve_ivp(
            lambda t, s, u=u: [s[1], laws[family](*s, u) / MASS],
            (0.0, 0.05),
            state,
            "LSODA",
            rtol=1e-8,
            atol=1e-10,
        )
        state = found.y[:, -1]
    return state


@pytest.mark.parametrize("family", VALUES)
def test_a_law_moves_a_slider_as_scipy_does(family):
    k = VALUES[family]
    on = "force" if FAMILIES[family].site == "actuator" else "q"
    chain = Chain(SLIDER, {"mass": MASS}, (Term(family, on, k),), "fine", 0.02)
    values = [{name: np.array([value]) for name, value in k.items()}]
    state, step, memory = np.zeros((1, 2)), np.array([H]), chain.actuation.rest(1, H)
    for i in range(round(SECONDS / H)):
        t = np.array([i * H])
        acts = chain.command(np.array([[push(i * H)]]), state, values, memory, step, t)
        state = chain.advance(state, acts, values, step, t)
    np.testing.assert_allclose(state[0], expected(family, k), rtol=4e-3, atol=2e-3)


def test_a_drive_brakes_with_what_it_has_at_standstill_and_gives_nothing_beyond_its_fastest():
    law = FAMILIES["torque_speed_limit"]
    u, v = np.array([9.0, 9.0, 9.0, 9.0, -9.0, 1.0]), np.array([0.0, 0.5, 2.0, -3.0, 0.5, 0.5])
    k = {"stall": np.full(6, 4.0), "no_load_speed": np.full(6, 1.0)}
    np.testing.assert_allclose(law.delivered(u, v, k), [4.0, 2.0, 0.0, 4.0, -4.0, 1.0])


def test_friction_under_load_holds_a_body_that_is_pushed_by_no_more():
    """Whatever its command, a gear that eats all of it stays at rest."""
    chain = Chain(SLIDER, {"mass": MASS}, (Term("load_friction", "q", {"share": 1.01}),), "fine", 0.02)
    state, step = np.zeros((1, 2)), np.array([0.01])
    for force in (0.5, 50.0, -3.0):
        state = chain.advance(state, np.array([[force]]), [{"share": np.array([1.01])}], step, np.zeros(1))
        assert not state.any()


def test_a_stop_never_pulls_and_one_alone_leaves_the_other_side_free():
    law = FAMILIES["end_stop"]
    q, v = np.array([0.3, 0.3, -9.0]), np.array([0.0, -100.0, 0.0])
    k = {"high": np.full(3, 0.2), "stiffness": np.full(3, 50.0), "damping": np.full(3, 2.0)}
    np.testing.assert_allclose(law.force(q, v, k), [-5.0, 0.0, 0.0], atol=1e-12)
    names = {variant: [p.name for p in law.parameters(Place("q", "N"), variant)] for variant in law.variants}
    assert names == {
        "": ["low", "high", "stiffness", "damping"],
        "lower": ["low", "stiffness", "damping"],
        "upper": ["high", "stiffness", "damping"],
    }


def test_what_drives_what_is_read_off_the_rates():
    found = {name: make_simulator(name).driven() for name in ("slider", "pendulum", "cartpole", "unicycle")}
    assert found == {
        "slider": {"force": "q"},
        "pendulum": {"torque": "theta"},
        "cartpole": {"force": "x"},
        "unicycle": {},
    }


@pytest.mark.parametrize(("wraps", "period"), [(False, 0.37), (True, 2 * np.pi / 7)])
def test_the_scan_finds_a_period_among_other_forces(wraps, period):
    rng = np.random.default_rng(2)
    q = rng.uniform(-np.pi, np.pi, 1500) if wraps else np.cumsum(rng.normal(0, 0.02, 1500))
    v, u = rng.normal(size=1500), rng.normal(size=(1500, 1))
    force = (
        0.4 * np.sin(2 * np.pi * q / period + 1.0) - 2.0 * v + 3.0 * u[:, 0] - q**2 + rng.normal(0, 0.3, 1500)
    )
    best, phase = ripples(q, v, force, u, 0.01, wraps)[0]
    assert best == pytest.approx(period, rel=0.02)
    assert np.cos(2 * np.pi * 0.1 * (1 / best - 1 / period) + phase - 1.0) > 0.8 or not wraps


WORLDS = {
    "torque_speed_limit": "pendulum",
    "load_friction": "slider",
    "cornering_drag": "unicycle",
    "wheel_saturation": "unicycle",
}
CALM = {"lugre_friction": 0.1, "cornering_drag": 0.1}
"""Of the noise: bristles bend by less than a heavy one; three seconds of slow curves cost little speed."""


def test_a_car_slows_down_in_a_curve_and_stays_on_its_circle():
    """A circle of radius v / w is driven at v / (1 + k (v w)^2): its centre and the angle driven say so."""
    car, k, v, w, seconds = make_simulator("unicycle"), 0.4, 1.5, 0.8, 2.0
    chain = Chain(car, {}, (Term("cornering_drag", "vehicle", {"drag": k}),), "fine", 0.02)
    state, step = np.zeros((1, 3)), np.array([0.01])
    for i in range(round(seconds / 0.01)):
        state = chain.advance(
            state, np.array([[v, w]]), [{"drag": np.array([k])}], step, np.array([i * 0.01])
        )
    angle, radius = w / (1 + k * (v * w) ** 2) * seconds, v / w
    np.testing.assert_allclose(
        state[0], [radius * np.sin(angle), radius * (1 - np.cos(angle)), angle], atol=1e-6
    )


def test_wheels_that_are_clipped_drive_the_circle_of_their_speeds():
    """An outer wheel at its limit L and an inner one at r: the centre drives at (L + r) / 2 and turns at (L - r) / b."""
    law, k = FAMILIES["wheel_saturation"], {"limit": np.full(3, 1.0), "track": np.full(3, 0.4)}
    v, w = np.array([0.9, 0.3, -2.0]), np.array([2.0, 1.0, 0.0])
    ahead, _, turning = law.twist(v, np.zeros(3), w, k)
    np.testing.assert_allclose(ahead, [(1.0 + 0.5) / 2, 0.3, -1.0])
    np.testing.assert_allclose(turning, [(1.0 - 0.5) / 0.4, 1.0, 0.0])


def test_readings_tell_a_range_and_a_dead_zone():
    rng = np.random.default_rng(6)
    y = np.sin(np.linspace(0.0, 40.0, 2000)) + rng.normal(0, 0.01, 2000)
    assert stands(y) == (False, False)
    assert stands(np.round(y, 2)) == (False, False)  # a coarse signal turns round at its ends
    assert stands(np.minimum(y, 0.8)) == (False, True)
    assert stands(np.clip(y, -0.7, 0.8)) == (True, True)
    assert stands(np.zeros(50)) == (False, False)
    assert unread(y) == unread(np.round(y, 2)) == ()
    least, apart = unread(np.where(np.abs(y) < 0.2, 0.0, y))
    assert 0.2 <= least < 0.2 + 10 * apart < 0.22


def test_readings_alone_tell_how_wide_a_dead_zone_is():
    """Nine intervals of ten hold the width, of readings that come at random; noise comes before the zone."""
    rng, held = np.random.default_rng(8), []
    for width in rng.uniform(0.05, 0.3, 300):
        y = rng.normal(0.0, 0.5, 1500)
        place = Place("q_dot", "m/s", silent=unread(np.where(np.abs(y) < width, 0.0, y)))
        (found,) = FAMILIES["sensor_dead_zone"].parameters(place)
        held.append(found.exact[0] <= width <= found.exact[1])
        assert found.low <= found.starts[0] <= found.high
    assert 0.85 < np.mean(held) < 0.95


def test_a_rollout_begins_in_no_reading_that_a_range_or_a_zone_hides():
    t = np.linspace(0.0, 40.0, 2000)
    true = np.sin(t)[:, None] + np.random.default_rng(6).normal(0, 0.01, (2000, 1))
    read = np.where(np.abs(true) < 0.2, 0.0, np.minimum(true, 0.8))
    speed, force = np.gradient(true[:, 0], t), np.zeros((1999, 1))
    seen, free = (
        telling(Recording("slider", SLIDER.state, SLIDER.action, (episode,), 0.02, {}, "rk4"))[0]
        for episode in (Episode("0", t, np.column_stack([q[:, 0], speed]), force) for q in (read, true))
    )
    np.testing.assert_array_equal(seen, ((np.abs(true) >= 0.2) & (true < 0.8))[:, 0])
    assert free.all()


@pytest.mark.parametrize("family", ["sensor_saturation", "sensor_dead_zone"])
def test_a_world_counts_what_only_readings_show(family):
    system, rng = SYSTEMS["pendulum"], np.random.default_rng(4)
    world = bare_world(11, 3, 1, "words", False, system, "measured", [(family, "theta")], rng)
    world = replace(world, episodes=4, steps=100, dt=0.02)
    scales = Scales(world, run(world, (), 0.005))
    world = with_effects(world, [(family, "theta")], scales, (0.9, 0.9), rng)
    (effect,) = world.effects
    (seen,) = visibilities(world, run(world, (effect,), 0.002))
    assert seen.share > 0.05


@pytest.mark.slow
@pytest.mark.parametrize("family", [f for f, word in catalogue.WORDS.items() if not word.ages])
def test_a_short_world_of_each_is_named_with_its_sizes(family):
    """The truth is an integrator and a law of their own. What needs a clock that runs on has a test of its own."""
    system = SYSTEMS[WORLDS.get(family, "slider")]
    rng = np.random.default_rng(4)
    place = catalogue.places_of(family, system)[0]
    world = bare_world(
        11, 3, 1, "words", False, system, None if system.vehicle else "measured", [(family, place)], rng
    )
    noise = {name: sd * CALM.get(family, 1.0) for name, sd in world.noise.items()}
    world = replace(world, episodes=8, steps=150, dt=0.02, excitation="steps", integrator="rk4", noise=noise)
    scales = Scales(world, run(world, (), 0.005))
    world = with_effects(world, [(family, place)], scales, (0.7, 0.7), rng)
    (effect,) = world.effects
    found = run(world, (effect,), 0.002)
    t = world.dt * np.arange(world.steps + 1)
    simulator = make_simulator(system.name)
    episodes = tuple(
        Episode(str(e), t, found.measured[:, e], found.commands[:, e]) for e in range(world.episodes)
    )
    recording = Recording(
        system.name, simulator.state, simulator.action, episodes, world.dt, world.parameters, "rk4",
        noise=world.noise,
    )  # fmt: skip
    beside = ("understeer",) if system.vehicle else ("viscous_friction", "spring")
    known = Known(only=(family, "actuator_gain", *beside))
    answer = diagnose(recording, simulator, simulator.defaults(world.parameters), rng, run=Run(known=known))
    (said,) = answer.diagnosis.effects
    assert (said.family, said.place) == (family, place)
    for name, value in effect.values.items():
        if name != "phase":
            assert said.parameters[name].value == pytest.approx(value, rel=0.1, abs=0.02 * abs(value) + 0.01)


def test_an_edge_is_where_something_begins_to_push_back():
    rng = np.random.default_rng(3)
    q, noise = rng.uniform(-1.0, 1.0, 1000), rng.normal(0.0, 0.3, 1000)
    assert pushed_back(q, noise) == pushed_back(q, noise - 20.0 * q) == (None, None)
    upper = noise - 50.0 * np.maximum(q - 0.9, 0.0)
    assert pushed_back(q, upper) == (None, pytest.approx(0.9, abs=0.02))
    assert pushed_back(-q, -upper) == (pytest.approx(-0.9, abs=0.02), None)
    both = upper + 50.0 * np.maximum(-0.93 - q, 0.0)
    assert pushed_back(q, both) == (pytest.approx(-0.93, abs=0.02), pytest.approx(0.9, abs=0.02))
    assert pushed_back(q, -both) == (None, None)  # what pulls outward is no stop
    far_inside = noise - 50.0 * np.maximum(q - 0.5, 0.0)
    assert pushed_back(q, far_inside) == (None, None)


def test_noise_is_no_ripple():
    rng = np.random.default_rng(5)
    q, v, u = np.cumsum(rng.normal(0, 0.02, 1500)), rng.normal(size=1500), rng.normal(size=(1500, 1))
    assert ripples(q, v, rng.normal(size=1500) - 2.0 * v, u, 0.01, False) == ()


def test_a_family_is_a_class_its_truth_and_a_test():
    """What names it elsewhere: an export that is no matter of the law, a kind that it was before, whole machines, what it costs."""
    elsewhere = {
        "mjcf/robot_template.py", "mjcf/patching.py", "trials/out_of_catalogue_forces.py", "trials/machines.py",
        "trials/out_of_catalogue_chain.py", "diagnosis/ladder/laws.py",
    }  # fmt: skip
    room = Path(gpsim.__file__).parent
    texts = {p.relative_to(room).as_posix(): p.read_text() for p in room.rglob("*.py")}
    for family in catalogue.WORDS:
        files = {name for name, text in texts.items() if f'"{family}"' in text} - elsewhere
        (own,) = files - {"trials/catalogue.py"}
        assert own.startswith("effects/families/")


def tank(seconds: float, rim: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A level that drains with 0.05 of itself a second, filled by steps of 20 s, and stands at its rim when full."""
    rng, dt = np.random.default_rng(8), 1.0
    t = np.arange(0.0, seconds + dt, dt)
    inflow = np.repeat(rng.uniform(0.0, 1.0, len(t) // 20 + 1), 20)[: len(t) - 1]
    level = [2.0]
    for u in inflow:
        x = level[-1]
        for _ in range(1000):  # the level itself is held: no flow over a rim is modelled
            x = min(x + dt / 1000 * (u - 0.05 * x), rim)
        level.append(x)
    return t, np.array(level), inflow


def drained(state, action, p):
    """The tank without its rim."""
    return {"level": action["inflow"] - p["outflow"] * state["level"]}


@pytest.mark.slow
def test_a_vessel_that_is_full_is_said_to_overflow():
    t, level, inflow = tank(2400.0, 12.0)
    base = gpsim.load_simulator(
        drained,
        state={"level": "m"},
        action={"inflow": "m/s"},
        parameters={"outflow": ("1/s", 0.05, 0.0, 1.0)},
    )
    noisy = np.minimum(level + np.random.default_rng(9).normal(0, 0.01, len(t)), 12.0)
    recording = gpsim.recording_from_frame(
        pd.DataFrame({"t": t, "level": noisy, "inflow": np.append(inflow, inflow[-1])}),
        {"level": "m", "inflow": "m/s"},
        base,
        dt=1.0,
    )
    found = gpsim.diagnose(
        recording, base, families={"only": ["overflow", "sensor_saturation", "parameter_offset"]}
    )
    # The readings are cut off there, too.
    assert [e.family for e in found.effects] in (["overflow"], ["overflow", "sensor_saturation"])
    assert found.effects[0].parameters["rim"].value == pytest.approx(12.0, abs=0.02)


def vessels(state, action, p):
    """Two vessels, the upper of which drains into the lower one."""
    upper, lower = (np.sqrt(np.maximum(state[name], 0.0)) for name in ("upper", "lower"))
    return {
        "upper": p["inflow"] * action["pump"] - p["through"] * upper,
        "lower": p["through"] * upper - p["away"] * lower,
    }


def two_vessels():
    numbers = {"inflow": 0.1, "through": 0.1, "away": 0.1}
    return gpsim.load_simulator(
        vessels,
        state={"upper": "m", "lower": "m"},
        action={"pump": "V"},
        parameters={name: ("1", value, 0.0, 1.0) for name, value in numbers.items()},
        start={"upper": 3.0},
    )


@given(
    upper=st.floats(1.0, 9.0), lower=st.floats(0.1, 9.0), pump=st.floats(0.0, 9.0), rim=st.floats(1.0, 9.0)
)
def test_what_spills_into_the_next_vessel_is_lost_to_none(upper, lower, pump, rim):
    """The water of both vessels changes by what comes in and goes away, with a rim as without one."""
    base, numbers = two_vessels(), {"inflow": 0.1, "through": 0.1, "away": 0.1}
    at, command, known = np.array([[upper, lower]]), np.array([[pump]]), {"rim": np.array([rim])}
    for family, lost in (("spillover", False), ("overflow", True)):
        added = FAMILIES[family].added(base, at, command, numbers, known, "upper")
        rising = max(float(base.rates(at, command, numbers)[0, 0]), 0.0)
        assert added[0, 0] == pytest.approx(-rising if upper >= rim else min(added[0, 0], 0.0))
        assert added.sum() == pytest.approx(added[0, 0] if lost else 0.0, abs=1e-9)


@pytest.mark.slow
def test_an_upper_vessel_that_nobody_measured_is_said_to_overflow_into_the_next():
    base, rng, dt, rim = two_vessels(), np.random.default_rng(3), 2.0, 5.0
    pump = np.repeat(rng.uniform(0.0, 4.0, 60), 20)
    upper, lower, read = 2.0, 2.0, [2.0]
    for u in pump:
        for _ in range(200):  # the level is held at the rim, and what comes in too much goes on
            through, away = 0.1 * np.sqrt(upper), 0.1 * np.sqrt(lower)
            risen = upper + dt / 200 * (0.1 * u - through)
            lower += dt / 200 * (through - away) + max(risen - rim, 0.0)
            upper = min(risen, rim)
        read.append(lower)
    noisy = np.array(read) + rng.normal(0.0, 0.01, len(read))
    recording = gpsim.recording_from_frame(
        pd.DataFrame({"t": dt * np.arange(len(read)), "lower": noisy, "pump": np.append(pump, pump[-1])}),
        {"lower": "m", "pump": "V"},
        base,
        dt=dt,
    )
    (found,) = gpsim.diagnose(recording, base).effects
    assert (found.family, found.place) == ("spillover", "upper")
    assert found.parameters["rim"].value == pytest.approx(rim, rel=0.05)
