"""Measured curves in the place of laws that do not hold: recovered where there is one, none where a law is right.

The worlds are integrated by code that shares nothing with the simulator that explains them (`worlds`).
"""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from gpsim.diagnosis.attribution import attribute
from gpsim.diagnosis.form import closed_form
from gpsim.diagnosis.judgement import Curved, curved, laws_of
from gpsim.diagnosis.judgement.judgement import Judgement, led_by
from gpsim.diagnosis.report import MeasuredCurve
from gpsim.diagnosis.report.codec import read, written
from gpsim.diagnosis.selection.refit import null_of
from gpsim.diagnosis.setup.candidates import candidates

from .laws import explained_by
from .worlds import World

VISCOUS, COULOMB = ("viscous_friction", "q"), ("coulomb_friction", "q")
GAIN = ("actuator_gain", "force")


def odd(v):
    return -3.0 * np.sin(4.0 * v) - 0.8 * v**3


def steep(v):
    return -0.1 * np.sign(v) * np.expm1(3.0 * np.abs(v))


def motor(u):
    return np.where(np.abs(u) < 5.0, u * np.abs(u) / 5.0, 5.0 * np.sign(u))


def sliding(v):
    return 1.0 + 2.0 * np.abs(np.sin(2.0 * v))


def screw(q):
    return 2.0 + 2.0 * np.sin(6.0 * q) * np.cos(2.0 * q)


def read_off(states):
    """Of a worn potentiometer."""
    return states + np.array([1.0, 0.0]) * 0.15 * np.sin(2.0 * states[..., :1])


WORLDS = {
    "odd force": (World("slider", forces={0: lambda q, v, t: odd(v)}), [VISCOUS]),
    "odd force under two names": (World("slider", forces={0: lambda q, v, t: odd(v)}), [VISCOUS, COULOMB]),
    "unnamed": (World("slider", forces={0: lambda q, v, t: odd(v)}), []),
    "motor": (
        World("slider", filters=[lambda u, t, h, m: motor(u)], forces={0: lambda q, v, t: -1.0 * v}),
        [VISCOUS, GAIN],
    ),
    "screw": (
        World("slider", forces={0: lambda q, v, t: screw(q) - 1.0 * v}),
        [VISCOUS, ("constant_force", "q")],
    ),
    "odd friction": (World("slider", grips={0: lambda q, v, n: sliding(v)}), [COULOMB]),
    "motor under other names": (
        World("slider", filters=[lambda u, t, h, m: motor(u)]),
        [("actuator_dead_band", "force"), ("parameter_offset", "mass")],
    ),
    "reading": (
        World("pendulum", sensors=[lambda states, times: read_off(states)]),
        [("constant_force", "theta")],
    ),
    "steep drag under four names": (
        World("slider", forces={0: lambda q, v, t: steep(v)}),
        [("quadratic_drag", "q"), VISCOUS, GAIN, ("parameter_offset", "mass")],
    ),
    "three that are right": (
        World(
            "slider",
            filters=[lambda u, t, h, m: 0.9 * u],
            forces={0: lambda q, v, t: -2.0 * v - 0.5 * v * np.abs(v)},
        ),
        [VISCOUS, ("quadratic_drag", "q"), GAIN],
    ),
    "viscous": (World("slider", forces={0: lambda q, v, t: -2.0 * v}), [VISCOUS]),
    "quadratic": (
        World("slider", forces={0: lambda q, v, t: -2.0 * v * np.abs(v)}),
        [("quadratic_drag", "q")],
    ),
    "coulomb": (World("slider", grips={0: lambda q, v, n: 1.5 + 0.0 * v}), [COULOMB]),
    "nothing": (World("slider"), []),
}


EPISODES = {"steep drag under four names": 60}  # high speeds are rare


@cache
def found(name):
    """What stands once curves were asked for, after a search that ended with the world's named laws."""
    world, laws = WORLDS[name]
    question, leader = explained_by(world, *laws, episodes=EPISODES.get(name, 20))
    problem = question.everything
    null = null_of(problem, leader.hypothesis.scheme)
    leader = leader if laws else null
    nothing = Judgement(leader, null, [], [1.0], [], 1.0, None, np.zeros(1), True)
    judgement = led_by(question, nothing, leader, [])
    attribution = attribute(question, leader, null)
    offers = candidates(question.recording, problem.simulator, problem.parameters)
    named = Curved(judgement, attribution, laws_of(question, judgement, attribution))
    return curved(question, named, offers)


def families(name):
    return sorted(t.family for t in found(name).judgement.leader.hypothesis.terms)


def off(curve, truth):
    """How far a curve is off at most where the recording went, in parts of the truth's range."""
    at, values = np.array(curve.at), np.array(curve.values)
    x = np.linspace(*curve.visited, 400)
    x = x[np.abs(x) > 0.01 * np.ptp(x)]  # beside a jump
    true = truth(x)
    return float(np.abs(np.interp(x, at, values) - true).max() / np.ptp(true))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["odd force", "odd force under two names", "unnamed"])
def test_an_odd_force_is_measured_whatever_stood_for_it(name):
    assert families(name) == ["force_curve"]
    (curve,) = found(name).curves.values()
    assert (curve.quantity, curve.input, curve.unit) == ("force on q", "q_dot", "N")
    assert off(curve, odd) < 0.1
    assert found(name).attribution.share.share > 0.999


def test_a_curve_is_told_with_the_laws_that_are_nearest_and_what_each_misses():
    (curve,) = found("odd force").curves.values()
    first, second, _ = curve.nearest
    assert first.effects == (VISCOUS,)
    assert 0.02 < first.misses < 0.15 < second.misses
    low, high = first.differs
    assert curve.visited[0] <= low < high <= curve.visited[1]
    assert curve.found.form == "sine"
    assert curve.found.misses < 0.01


def test_a_motor_curve_stands_beside_the_friction_that_is_right():
    assert families("motor") == ["actuator_curve", "viscous_friction"]
    (curve,) = found("motor").curves.values()
    assert off(curve, motor) < 0.1
    assert found("motor").laws.forms == ("holds", "approximate")


@pytest.mark.parametrize(
    ("name", "family"), [("motor under other names", "actuator_curve"), ("reading", "sensor_curve")]
)
def test_a_curve_alone_takes_the_place_of_laws_at_other_sites(name, family):
    assert families(name) == [family]
    assert found(name).attribution.share.share > 0.9


def test_one_curve_stands_for_four_laws_that_leave_next_to_nothing():
    assert families("steep drag under four names") == ["force_curve"]
    (curve,) = found("steep drag under four names").curves.values()
    assert off(curve, steep) < 0.1


def test_a_constant_force_stays_told_beside_a_curve_of_the_position():
    """Both could not be told apart; the constant is what people look for, and the curve is about it."""
    assert families("screw") == ["constant_force", "force_curve", "viscous_friction"]
    (curve,) = found("screw").curves.values()
    terms = {t.family: t for t in found("screw").judgement.leader.hypothesis.terms}
    assert abs(np.mean(curve.values)) < 0.05
    assert (
        off(replace(curve, values=np.array(curve.values) + terms["constant_force"].values["force"]), screw)
        < 0.1
    )


@pytest.mark.slow
def test_odd_friction_still_holds_at_rest():
    assert families("odd friction") == ["force_curve"]
    (key,) = found("odd friction").curves
    assert key == ("force_curve", "q", "friction")
    (curve,) = found("odd friction").curves.values()
    assert off(curve, lambda v: -np.sign(v) * sliding(v)) < 0.1


def test_the_band_holds_the_truth():
    inside = []
    for name, truth in (("odd force", odd), ("motor", motor)):
        (curve,) = found(name).curves.values()
        true = truth(np.array(curve.at))
        inside.append((np.array(curve.low) <= true) & (true <= np.array(curve.high)))
    assert np.concatenate(inside).mean() > 0.7


@pytest.mark.parametrize("name", ["three that are right", "viscous", "quadratic", "coulomb", "nothing"])
def test_where_a_law_is_right_there_is_no_curve(name):
    assert not found(name).curves
    assert families(name) == sorted(family for family, _ in WORLDS[name][1])


def test_a_curve_is_no_name():
    assert found("odd force").laws.forms == ("approximate",)


def test_a_measured_curve_comes_back_from_its_file():
    (curve,) = found("motor").curves.values()
    again = read(MeasuredCurve, json.loads(json.dumps(written(curve))), "curve")
    assert again == curve
    assert curve.freedom > 2.0


@pytest.mark.parametrize(
    ("form", "law"),
    [
        ("power", lambda x: -2.0 * np.sign(x) * np.abs(x) ** 0.5),
        ("tanh", lambda x: 3.0 * np.tanh(x / 0.2)),
        ("sine", lambda x: 0.5 + 2.0 * np.sin(2.0 * np.pi * x / 0.7)),
        ("exponential", lambda x: 1.0 - 2.0 * np.exp(-x / 0.3)),
    ],
)
def test_closed_forms_are_told_with_their_numbers(form, law):
    x = np.linspace(-1.0, 1.0, 201) if form != "exponential" else np.linspace(0.0, 1.0, 101)
    told = closed_form(x, law(x))
    assert told.form == form
    assert told.misses < 1e-3
    if form == "sine":
        assert abs(told.parameters["period"]) == pytest.approx(0.7, rel=0.01)


def test_what_no_form_follows_has_none():
    rng = np.random.default_rng(0)
    x = np.linspace(-1.0, 1.0, 60)
    assert closed_form(x, np.repeat(rng.normal(size=12), 5)) is None
    assert closed_form(x, np.zeros(60)) is None
