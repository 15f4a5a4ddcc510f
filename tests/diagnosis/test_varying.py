"""Laws whose strength varies with what they do not know of, and memories that are another one: seen, and right ones left.

The worlds are integrated by code that shares nothing with the simulator that explains them (`worlds`).
"""

from functools import cache

import numpy as np
import pytest

from gpsim.diagnosis.attribution import attribute
from gpsim.diagnosis.judgement import laws_of
from gpsim.diagnosis.judgement.judgement import Judgement, led_by
from gpsim.diagnosis.selection import varying
from gpsim.diagnosis.selection.refit import null_of
from gpsim.diagnosis.selection.varying import FILTER, _transitions

from .laws import explained_by
from .worlds import World

VISCOUS, LAG = ("viscous_friction", "q"), ("actuator_lag", "force")


def lagged(times):
    """A command behind as many lags in a row, T u' = command - u each."""

    def act(u, t, h, memory):
        state = memory.setdefault("u", [np.zeros_like(u) for _ in times])
        for i, time in enumerate(times):
            state[i] = state[i] + (u - state[i]) * -np.expm1(-h / time)
            u = state[i]
        return u

    return act


WORLDS = {
    "groove": (World("slider", forces={0: lambda q, v, t: -2.0 * v * (1 + 0.5 * np.sin(3 * q))}), VISCOUS),
    "viscous": (World("slider", forces={0: lambda q, v, t: -2.0 * v}), VISCOUS),
    "two lags": (World("slider", filters=[lagged([0.06, 0.06])]), LAG),
    "one lag": (World("slider", filters=[lagged([0.08])]), LAG),
}


@cache
def explained(name):
    world, law = WORLDS[name]
    return explained_by(world, law)


@pytest.mark.parametrize("name", ["viscous", "one lag"])
def test_a_right_law_is_as_strong_everywhere(name):
    question, leader = explained(name)
    assert varying(question.everything, leader, [0]) == {}


def test_friction_that_is_stronger_here_than_there_is_seen_and_how_it_goes():
    question, leader = explained("groove")
    found = varying(question.everything, leader, [0])[0]
    assert found.along == "q"
    assert 0.1 < found.size < 0.6
    times = np.array(found.times) * leader.hypothesis.terms[0].values["damping"] / 2.0
    np.testing.assert_allclose(times[1:-1], 1 + 0.5 * np.sin(3 * np.array(found.at))[1:-1], atol=0.25)


def test_two_lags_are_no_lag():
    question, leader = explained("two lags")
    found = varying(question.everything, leader, [0])[0]
    assert found.along == FILTER
    assert found.at == ()


def test_such_a_law_is_approximate_and_its_strength_is_drawn():
    question, leader = explained("groove")
    null = null_of(question.everything, leader.hypothesis.scheme)
    nothing = Judgement(leader, null, [], [1.0], [], 1.0, None, np.zeros(1), True)
    judgement = led_by(question, nothing, leader, [])
    laws = laws_of(question, judgement, attribute(question, leader, null))
    assert laws.forms == ("approximate",)
    (strength,) = [curve for curve in laws.curves if curve.quantity == "times viscous_friction on q"]
    assert (strength.input, strength.input_unit, strength.unit) == ("q", "m", "1")
    assert max(strength.free) > 1.15 > 0.85 > min(strength.free)


def test_of_sensors_nothing_is_said():
    question, leader = explained_by(
        World("slider", forces={0: lambda q, v, t: -2.0 * v}), ("sensor_scale", "q"), episodes=4
    )
    assert varying(question.everything, leader, [0]) == {}


def test_every_transition_becomes_a_window_with_its_own_past():
    question, _leader = explained("one lag")
    windows = question.everything.windows.take(np.arange(3))
    single = _transitions(windows, windows.measured)
    length, k = windows.length, 4
    assert len(single) == 3 * length
    row = 3 * k + 1  # transition 4 of the second window
    np.testing.assert_array_equal(single.measured[row], windows.measured[1, k : k + 2])
    np.testing.assert_array_equal(single.before_actions[row, -k:], windows.actions[1, :k])
    np.testing.assert_array_equal(single.t[row], windows.t[1, k : k + 2])
