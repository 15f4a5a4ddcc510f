"""Intervals: what the data do not determine is not called certain."""

import numpy as np
import pytest

from gpsim.diagnosis.assessment.estimates import _inverse


def test_a_well_determined_one_is_the_inverse():
    units = np.array([1.0, 1e6, 1e-6, 1.0])
    a = np.random.default_rng(0).normal(size=(20, 4))
    inverse = _inverse((a.T @ a) * np.outer(units, units))
    assert inverse * np.outer(units, units) == pytest.approx(np.linalg.inv(a.T @ a), rel=1e-9)


def test_a_direction_without_information_is_wide_open():
    one = np.array([[1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 0.0, 0.0]])
    width = np.sqrt(np.diag(_inverse(100.0 * one)))
    assert np.isfinite(width).all()
    assert (width[:2] > 1e4).all()
    assert width[2] > 1e40
