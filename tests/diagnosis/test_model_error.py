"""Model error: intervals are as wide as what has no name may have moved a size."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsim.diagnosis import diagnose
from gpsim.diagnosis.assessment.estimates import model_error, with_model_error
from gpsim.diagnosis.run import Run
from gpsim.diagnosis.settings import IntervalSettings, Known, read_settings
from gpsim.effects import EffectParameter
from gpsim.simulators import make_simulator

from .worlds import World, record

SIZE = EffectParameter("stiffness", "N/m", 0.0, 100.0, (1.0,), 1.0)
GAIN = EffectParameter("gain", "1", -5.0, 5.0, (0.9,), 0.2, none=1.0)
PLACE = EffectParameter("rest_position", "m", -5.0, 5.0, (0.0,), 1.0, place=True)
Z90 = 1.6448536


def widened(bounds, values, declared, error=0.1):
    return with_model_error(np.array(bounds), np.array(values), declared, error, 0.9)


def test_a_size_that_the_data_know_well_is_as_sure_as_the_model():
    low, high = widened([[1.999, 2.001]], [2.0], [SIZE])[0]
    assert (2.0 - low, high - 2.0) == pytest.approx((0.2 * Z90, 0.2 * Z90), rel=1e-3)


def test_a_gain_is_told_from_one():
    low, high = widened([[0.9, 0.9]], [0.9], [GAIN])[0]
    assert (low, high) == pytest.approx((0.9 - 0.01 * Z90, 0.9 + 0.01 * Z90))


def test_where_something_rests_is_widened_as_its_stiffness_is():
    stiffness, rest = widened([[1.9, 2.1], [-0.01, 0.03]], [2.0, 0.0], [SIZE, PLACE])
    times = (stiffness[1] - 2.0) / 0.1
    assert rest == pytest.approx((-0.01 * times, 0.03 * times))
    assert times > 3


def test_bounds_are_kept_and_independent_errors_add_in_squares():
    assert widened([[0.0, 90.0]], [60.0], [SIZE], error=0.5)[0] == pytest.approx((0.0, 100.0))
    low, _ = widened([[1.7, 2.3]], [2.0], [SIZE])[0]
    assert 2.0 - low == pytest.approx(np.hypot(0.3, 0.2 * Z90))


@given(st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_the_more_is_left_the_less_sure_a_size_is(one, other):
    errors = [model_error(left, IntervalSettings()) for left in sorted((one, other))]
    assert 0.0 <= errors[0] <= errors[1] <= IntervalSettings().model_error


@pytest.mark.parametrize(("cubic", "widest"), [(0.0, 0.02), (2.0, 0.5)])
def test_physics_without_a_name_widens_what_has_one(cubic, widest):
    """Viscous friction beside a cubic spring: with it the damping's interval is several times as wide, and holds."""
    world = World("slider", forces={0: lambda q, v, t: -1.0 * v - cubic * q**3})
    recording = record(world, seed=6, episodes=6, steps=120)
    run = Run(read_settings({"curves": {"most": 0}}), Known(only=("viscous_friction",)))
    slider = make_simulator("slider")
    found = diagnose(recording, slider, recording.parameters, np.random.default_rng(0), run=run)
    (effect,) = found.diagnosis.effects
    damping = effect.parameters["damping"]
    half = (damping.high - damping.low) / 2
    assert found.judgement.structured == (cubic > 0.0)
    assert damping.low < 1.0 < damping.high
    assert widest / 10 < half < widest
