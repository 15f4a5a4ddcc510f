"""Damage that nothing complains about: found where it is, and what only looks odd is left alone."""

from dataclasses import replace

import numpy as np
import pytest
from bags import drive, write_bag
from by_hand import UNICYCLE, Drive, imported, series

from gpsim.errors import UsageError
from gpsim.recordings import find_bad_rows, open_log, parse_mapping

PLAN = parse_mapping({**UNICYCLE, "checks": {"max_rate": {"x": 3.0}}})
T = np.arange(0, 2, 0.01)


def broken(field, row, value):
    pose = Drive().pose(T)
    values = pose.fields[field].copy()
    values[row] = value
    return replace(pose, fields={**pose.fields, field: values})


def position(values, t=T, **mapping):
    """A topic whose field looks like a position's, as the reader's own checks see it, and a mapping of it."""
    plan = {"system": "s", "rate": 20, "state": {"q": {"field": "position.0", "unit": "rad", "topic": "/q"}}}
    return series("/q", t, position__0=values), parse_mapping({**plan, **mapping})


def test_sound_logs_have_no_findings(tmp_path):
    assert not find_bad_rows("log", Drive().pose(T), PLAN)
    log = open_log(write_bag(tmp_path / "drive.bag", "ros1", drive(4.0)))
    for one in log.series({t.name: t.fields for t in log.topics()}).values():
        assert not find_bad_rows("log", one, PLAN)


@pytest.mark.parametrize(
    ("pose", "reason", "rows"),
    [
        (broken("p.x", 7, np.nan), "not finite", [7]),
        (broken("p.y", 9, np.inf), "not finite", [9]),
        (broken("q.w", 30, 2.0), "no rotation", [30]),
        (broken("p.x", 31, 1e200), "absurd magnitude", [31]),
        (broken("p.y", 31, 1e-300), "absurd magnitude", [31]),
        (broken("p.x", 50, 1e9), "faster than checks.max_rate", [50]),
        (broken("p.x", 0, -4.0), "faster than checks.max_rate", [0]),
    ],
)
def test_silent_damage_is_refused_or_salvaged_and_counted(pose, reason, rows):
    with pytest.raises(UsageError, match=f"log: /pose, row {rows[0]}.*--salvage"):
        find_bad_rows("log", pose, PLAN)
    found = find_bad_rows("log", pose, PLAN, salvage=True)
    assert {key: value.tolist() for key, value in found.items()} == {reason: rows}


def test_a_position_that_leaves_its_neighbours_is_damage():
    values = np.sin(3.0 * T)
    assert not find_bad_rows("log", *position(values))
    values[77] += 40.0
    with pytest.raises(UsageError, match=r"/q, row 77, field position\.0: leaves its neighbours"):
        find_bad_rows("log", *position(values))


def test_a_stamp_far_from_its_arrival_is_damage_and_a_stamp_never_set_is_none():
    pose = Drive().pose(T)
    header = T.copy()
    header[5] -= 1e9
    with pytest.raises(UsageError, match="row 5: the header stamp is far from its arrival"):
        find_bad_rows("log", replace(pose, header=header), PLAN)
    assert not find_bad_rows("log", replace(pose, header=T - 1.7e9), PLAN)


def test_rotations_and_angles_that_come_round_are_sound():
    """A driver that keeps w positive flips all parts where the yaw passes half a turn, back and forth under noise."""
    rng = np.random.default_rng(0)
    yaw = np.linspace(0.0, 20.0, len(T)) + 0.004 * rng.normal(size=len(T))
    w, z = np.cos(yaw / 2), np.sin(yaw / 2)
    sign = np.where(w < 0, -1.0, 1.0)
    fields = {
        "orientation.x": 0 * w,
        "orientation.y": 0 * w,
        "orientation.z": sign * z,
        "orientation.w": sign * w,
    }
    assert not find_bad_rows("log", replace(Drive().pose(T), fields=fields), PLAN)
    wrapped = (np.linspace(0.0, 12.0, len(T)) + 0.05 * rng.normal(size=len(T)) + np.pi) % (2 * np.pi) - np.pi
    state = {"q": {"field": "position.0", "unit": "rad", "topic": "/q", "wraps": True}}
    assert not find_bad_rows("log", *position(wrapped, state=state))


def test_clocks_of_another_pace_or_unit_are_sound():
    long = np.arange(len(T)) * 1.0  # a second a message: hundreds of seconds
    for header in (0.5 * long, np.zeros(len(long))):  # simulated time, and a stamp that is never set
        pose = replace(Drive().pose(T), receive=long, header=header)
        assert not find_bad_rows("log", pose, parse_mapping(UNICYCLE))
    ticks = series("/q", T, position__0=np.sin(T), stamp=1.7e15 + 1e6 * long)
    _, plan = position(T, time={"field": "stamp", "scale": 1e-6})
    assert not find_bad_rows("log", ticks, plan)
    with pytest.raises(UsageError, match="magnitude"):
        find_bad_rows("log", ticks, PLAN)


TURNING = {
    "system": "pendulum",
    "rate": 50,
    "time": {"field": "t"},
    "state": {"theta": {"field": "a", "unit": "rad"}},
    "action": {"torque": {"field": "u", "unit": "N m"}},
}
LONG = 0.013 * np.arange(400)
WRAPPED = (3.0 * LONG + np.pi) % (2.0 * np.pi) - np.pi
DERIVED = {**TURNING["state"], "theta_dot": {"derivative_of": "theta", "unit": "rad/s"}}


def table(a, **more):
    return {"table": series("table", np.full(len(LONG), np.nan), t=LONG, a=a, u=np.cos(LONG), **more)}


@pytest.mark.parametrize(
    "changes",
    [{}, {"rate": "source", "state": DERIVED}, {"rate": "source", "smoothing": {"channels": ["theta"]}}],
)
def test_an_angle_that_wraps_unsaid_is_refused_where_values_are_made_across(changes):
    with pytest.raises(UsageError, match=r"hand: theta steps by -6\..*state\.theta\.wraps=true") as caught:
        imported(table(WRAPPED), TURNING, **changes)
    assert "\n" not in str(caught.value)


def test_said_to_wrap_it_is_taken_the_short_way_round():
    state = {"theta": {**TURNING["state"]["theta"], "wraps": True}}
    recording, report = imported(table(WRAPPED), TURNING, state=state)
    (episode,) = recording.episodes
    error = episode.states[:, 0] - 3.0 * episode.t
    assert np.abs((error + np.pi) % (2.0 * np.pi) - np.pi).max() < 1e-9
    assert not report.warnings


@pytest.mark.parametrize(
    ("angle", "rate"),
    [(WRAPPED, "source"), (WRAPPED, 1.0 / 0.013), (WRAPPED + 20.0 * np.sin(LONG), 50)],
    ids=["source", "its own rate", "many turns"],
)
def test_where_no_value_lies_across_it_is_a_warning(angle, rate):
    _, report = imported(table(angle), TURNING, rate=rate)
    assert [line for line in report.warnings if "nearly a turn" in line]


def test_a_reset_between_two_episodes_is_no_step():
    angle = np.where(LONG < 2.6, 3.1, -3.1) + 0.01 * np.sin(9.0 * LONG)
    rule = {"by": "column", "field": "trial"}
    recording, report = imported(table(angle, trial=(LONG >= 2.6).astype(float)), TURNING, episodes=rule)
    assert len(recording.episodes) == 2
    assert not report.warnings
