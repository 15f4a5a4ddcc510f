from __future__ import annotations

import numpy as np
import pytest
from by_hand import imported, series

from gpsim.errors import UsageError

MAPPING = {
    "system": "pendulum",
    "rate": 50,
    "time": {"field": "t"},
    "state": {"theta": {"field": "a", "unit": "rad"}},
    "action": {"torque": {"field": "u", "unit": "N m"}},
}
T = 0.013 * np.arange(400)
WRAPPED = (3.0 * T + np.pi) % (2.0 * np.pi) - np.pi


def table(a, t=T, **more):
    return {"table": series("table", np.full(len(t), np.nan), t=t, a=a, u=np.cos(t), **more)}


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {
            "rate": "source",
            "state": {**MAPPING["state"], "theta_dot": {"derivative_of": "theta", "unit": "rad/s"}},
        },
        {"rate": "source", "smoothing": {"channels": ["theta"]}},
    ],
)
def test_an_angle_that_wraps_unsaid_is_refused_where_values_are_made_across(changes):
    with pytest.raises(UsageError, match=r"hand: theta steps by -6\..*state\.theta\.wraps=true") as caught:
        imported(table(WRAPPED), MAPPING, **changes)
    assert "\n" not in str(caught.value)


def test_said_to_wrap_it_is_taken_the_short_way_round():
    state = {"theta": {**MAPPING["state"]["theta"], "wraps": True}}
    recording, report = imported(table(WRAPPED), MAPPING, state=state)
    (episode,) = recording.episodes
    error = episode.states[:, 0] - 3.0 * episode.t
    assert np.abs((error + np.pi) % (2.0 * np.pi) - np.pi).max() < 1e-9
    assert not report.warnings


@pytest.mark.parametrize("rate", ["source", 1.0 / 0.013])
def test_where_no_value_lies_across_it_is_a_warning(rate):
    _, report = imported(table(WRAPPED), MAPPING, rate=rate)
    assert [line for line in report.warnings if "state.theta.wraps=true" in line]


def test_an_angle_of_many_turns_that_steps_fast_is_a_warning():
    _, report = imported(table(WRAPPED + 20.0 * np.sin(T)), MAPPING)
    assert [line for line in report.warnings if "nearly a turn" in line]


@pytest.mark.parametrize("unit", ["rad", "m"])
def test_what_does_not_wrap_is_left_alone(unit):
    mapping = {**MAPPING, "state": {"theta": {"field": "a", "unit": unit}}}
    values = WRAPPED if unit == "m" else 3.0 * np.sin(2.0 * T)
    assert not imported(table(values), mapping)[1].warnings


def test_a_reset_between_two_episodes_is_no_step():
    angle = np.where(T < 2.6, 3.1, -3.1) + 0.01 * np.sin(9.0 * T)
    rule = {"by": "column", "field": "trial"}
    recording, report = imported(table(angle, trial=(T >= 2.6).astype(float)), MAPPING, episodes=rule)
    assert len(recording.episodes) == 2
    assert not report.warnings
