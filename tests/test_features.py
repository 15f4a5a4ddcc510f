"""Inputs of a Gaussian process by name: what is understood, and what is refused."""

import numpy as np
import pytest

from gpsim.channels import Channels
from gpsim.corrected.features import Features
from gpsim.errors import UsageError

CHANNELS = Channels.of({"x": "m", "x_dot": "m/s", "theta": "rad"})


@pytest.mark.parametrize("name", ["x_dot)", "sign(x_dot", "(x_dot)", "sign(x_dot))", "abs(x_dot)", ""])
def test_what_is_mistyped_is_refused(name):
    with pytest.raises(UsageError, match=r"gp\.inputs: '.*' is neither a channel nor one of sign, sin, cos"):
        Features.of([name], CHANNELS)


def test_channels_and_functions_of_them_are_columns():
    found = Features.of(["x_dot", "sign(x_dot)", "sin( theta )"], CHANNELS)
    values = np.array([[1.0, -2.0, 0.5]])
    np.testing.assert_array_equal(found(values), [[-2.0, -1.0, np.sin(0.5)]])
