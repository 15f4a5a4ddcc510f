"""Time left of jobs whose steps do not take equally long."""

import pytest
from gpsim.cli.progress import EVEN, Pace, clock

UNEVEN = ((0.0, 0.0), (0.05, 0.1), (0.4, 0.7), (1.0, 1.0))


def test_even_steps_leave_what_they_took():
    pace = Pace(EVEN, 100.0)
    assert pace.left(101.0) is None
    pace.update(25, 100, 110.0)
    assert pace.left(110.0) == pytest.approx(30.0)


def test_uneven_steps_are_weighted_by_what_they_usually_take():
    pace = Pace(UNEVEN, 0.0)
    pace.update(5, 100, 10.0)
    assert pace.left(10.0) == pytest.approx(90.0)
    assert pace.left(40.0) == pytest.approx(60.0)  # the clock runs on though nothing is reported


@pytest.mark.parametrize("slower", [0.7, 1.0, 1.4])
def test_after_the_first_fifth_the_forecast_is_within_a_factor_of_two(slower):
    """The middle step takes another time than usual."""
    ends = [10.0, 10.0 + 60.0 * slower, 40.0 + 60.0 * slower]
    pace, whole = Pace(UNEVEN, 0.0), ends[-1]
    for second in range(1, int(0.9 * whole)):
        for done, end in zip((5, 40, 100), ends, strict=True):
            if second - 1 < end <= second:
                pace.update(done, 100, end)
        left = pace.left(float(second))
        if second > 0.2 * whole:
            assert 0.5 <= left / (whole - second) <= 2.0, second


def test_what_is_done_is_never_taken_back():
    pace = Pace(EVEN, 0.0)
    pace.update(50, 100, 10.0)
    pace.update(40, 100, 12.0)
    assert pace.share == 0.5


@pytest.mark.parametrize(
    ("seconds", "words"), [(1.0, "5 s"), (42.0, "40 s"), (59.0, "1 min"), (200.0, "3 min")]
)
def test_a_forecast_is_no_finer_than_it_is_good_for(seconds, words):
    assert clock(seconds) == words
