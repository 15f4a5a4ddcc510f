"""Inputs of a Gaussian process: what a person may write, what is refused, and channels of any name."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsim.channels import Channels
from gpsim.corrected import Feature, Features
from gpsim.errors import UsageError

CHANNELS = Channels.of({"x": "m", "x_dot": "m/s", "theta": "rad"})
ODD = Channels.of(
    {"x (m)": "m", "x pos": "m", "sin(x (m))": "1", "sign(a)": "1", "$v_{x}^2$": "m/s", "a=b, 'c'": ""}
)
NAMES = st.lists(st.text(min_size=1, max_size=200), min_size=1, max_size=5, unique=True)
FUNCTIONS = st.sampled_from([None, "sign", "sin", "cos"])


@pytest.mark.parametrize("name", ["x_dot)", "sign(x_dot", "(x_dot)", "sign(x_dot))", "abs(x_dot)", ""])
def test_what_is_mistyped_is_refused(name):
    with pytest.raises(UsageError, match=r"gp\.inputs: '.*' is neither a channel nor one of sign, sin, cos"):
        Features.of([name], CHANNELS)


def test_channels_and_functions_of_them_are_columns():
    found = Features.of(["x_dot", "sign(x_dot)", "sin( theta )"], CHANNELS)
    values = np.array([[1.0, -2.0, 0.5]])
    np.testing.assert_array_equal(found(values), [[-2.0, -1.0, np.sin(0.5)]])


@pytest.mark.parametrize(
    ("written", "channel", "function"),
    [
        ("x (m)", "x (m)", None),
        (" x pos ", "x pos", None),
        ("sign(x (m))", "x (m)", "sign"),
        ("cos( x pos )", "x pos", "cos"),
        ("sin(x (m))", "sin(x (m))", None),  # a channel of exactly that name comes first
        ("sin(sin(x (m)))", "sin(x (m))", "sin"),
        ("sign(sign(a))", "sign(a)", "sign"),
        ("$v_{x}^2$", "$v_{x}^2$", None),
        ("cos(a=b, 'c')", "a=b, 'c'", "cos"),
    ],
)
def test_a_person_may_write_channels_of_any_name(written, channel, function):
    assert Feature.parse(written, ODD) == Feature(channel, function)


def test_the_refusal_names_the_channels():
    with pytest.raises(UsageError, match=r"'x \(cm\)' is neither .*; channels: x \(m\), x pos"):
        Features.of(["x (cm)"], ODD)


@given(names=NAMES, function=FUNCTIONS)
def test_inputs_come_back_as_they_were_whatever_channels_are_called(names, function):
    channels = Channels.of(dict.fromkeys(names, "m"))
    for name in names:
        feature = Feature(name, function)
        assert Feature.from_json(json.loads(json.dumps(feature.to_json()))) == feature
        read = Feature.parse(feature.text, channels)
        assert read == (Feature(feature.text) if feature.text in names else feature)


@given(names=NAMES)
def test_structured_inputs_take_the_columns_of_their_channels(names):
    channels = Channels.of(dict.fromkeys(names, "m"))
    found = Features.of([*map(Feature, names), *(Feature(name, "sign") for name in names)], channels)
    values = np.arange(1.0, 1.0 + len(names))[None]
    np.testing.assert_array_equal(found(-values), np.hstack([-values, -np.ones_like(values)]))
