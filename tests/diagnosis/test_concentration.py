"""The part of state, action or time in which a mismatch lives."""

import numpy as np
import pytest

from gpsim.diagnosis import diagnose
from gpsim.diagnosis.assessment.location import concentrated
from gpsim.reports.diagnosis_text import where
from gpsim.simulators import make_simulator

from .worlds import World, record

RNG = np.random.default_rng(0)
N = 4000
X, V, T = RNG.uniform(-1, 1, N), RNG.normal(size=N), np.linspace(0, 60, N)
NOISE = RNG.normal(size=N)


def part(law):
    return concentrated({"x": X, "v": V, "t": T}, (NOISE + law) ** 2, 1.0)


@pytest.mark.parametrize(
    ("law", "channel", "inside", "low", "high"),
    [
        (6.0 * ((X > -0.3) & (X < 0.2)), "x", True, -0.3, 0.2),
        (6.0 * (np.abs(V) > 1.3), "v", False, -1.3, 1.3),
        (6.0 * (T > 45), "t", True, 45, 60),
    ],
)
def test_the_part_is_found(law, channel, inside, low, high):
    found = part(law)
    assert (found.channel, found.inside) == (channel, inside)
    assert found.low == pytest.approx(low, abs=0.06 * (1 if channel != "t" else 60))
    assert found.high == pytest.approx(high, abs=0.06 * (1 if channel != "t" else 60))
    assert found.share >= 0.9
    assert found.samples < 0.35


@pytest.mark.parametrize(
    ("law", "channel", "inside", "low", "high"),
    [
        (3.0 * (T > 24), "t", True, 24, 60),
        (3.0 * (T > 30), "t", True, 30, 60),
        (3.0 * (T < 42) * np.sign(V), "t", True, 0, 42),
        (3.0 * (V > 0), "v", True, 0, V.max()),
        (3.0 * (np.abs(X) > 0.5), "x", False, -0.5, 0.5),
        (2.0 * X * (T > 30), "t", True, 30, 60),  # the mismatch grows along x as well, and begins in time
    ],
)
def test_a_part_with_many_samples_is_found_where_its_edges_are_sharp(law, channel, inside, low, high):
    found = part(law)
    assert (found.channel, found.inside) == (channel, inside)
    reach = {"t": 60.0, "v": 4.0, "x": 1.0}[channel]
    assert found.low == pytest.approx(low, abs=0.06 * reach)
    assert found.high == pytest.approx(high, abs=0.06 * reach)
    assert 0.35 < found.samples <= 0.8


@pytest.mark.parametrize("law", [0.0 * X, 6.0 * V, 5.0 + 0.0 * X, 4.0 * X, 0.1 * T, 6.0 * np.sqrt(T / 60)])
def test_what_acts_everywhere_lives_nowhere_in_particular(law):
    assert part(law) is None


@pytest.mark.slow  # test_named.py asks for where unknown physics sits, too, on reversal
def test_physics_outside_the_catalogue_is_located():
    """A magnet under the track: nothing that is known, but it sits somewhere."""

    def magnet(q, v, t):
        return 8.0 * np.exp(-(((q - 0.15) / 0.05) ** 2)) * np.sin(40 * q)

    recording = record(World("slider", forces={0: magnet}), seed=2, episodes=6, steps=300)
    report = diagnose(
        recording, make_simulator("slider"), recording.parameters, np.random.default_rng(0)
    ).diagnosis
    place = report.location.concentrated
    assert (place.channel, place.where) == ("q", "inside")
    low, high = place.interval
    assert low == pytest.approx(0.05, abs=0.1)
    assert high > 0.15  # the last bin, where few samples lie, reaches far
    assert place.share_of_samples <= 0.35
    if not report.location.region:
        assert "lies inside q" in where(report)
