"""The chi square distribution whose centre is off: SciPy's as the oracle."""

from __future__ import annotations

import pytest
from scipy.stats import ncx2

from gpsim.diagnosis.selection.chi_square import beyond


@pytest.mark.parametrize("freedom", [1, 4, 16])
@pytest.mark.parametrize("shift", [2e-6, 0.7, 30.0, 900.0])
@pytest.mark.parametrize("square", [0.1, 3.0, 40.0, 400.0, 1500.0])
def test_tail_is_that_of_scipy(square: float, freedom: int, shift: float) -> None:
    # SciPy's tail is the difference from 1 in places, and right to some 1e-13 there.
    assert beyond(square, freedom, shift) == pytest.approx(
        ncx2.sf(square, freedom, shift), rel=1e-9, abs=1e-13
    )


def test_far_out_it_is_not_nothing() -> None:
    assert 0.0 < beyond(1300.0, 2, 1e-6) < 1e-270
