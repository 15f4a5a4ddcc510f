from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from by_hand import UNICYCLE, Drive, pose_series, series

from gpsim.errors import UsageError
from gpsim.recordings.mapping import parse_mapping
from gpsim.recordings.soundness import find_bad_rows

PLAN = parse_mapping({**UNICYCLE, "checks": {"max_rate": {"x": 3.0}}})
T = np.arange(0, 2, 0.01)


def broken(field, row, value):
    pose = Drive().pose(T)
    values = pose.fields[field].copy()
    values[row] = value
    return replace(pose, fields={**pose.fields, field: values})


def test_a_sound_topic_has_no_bad_rows():
    assert not find_bad_rows("log", Drive().pose(T), PLAN)


@pytest.mark.parametrize(
    ("pose", "reason", "rows"),
    [
        (broken("p.x", 7, np.nan), "not finite", [7]),
        (broken("p.y", 9, np.inf), "not finite", [9]),
        (broken("q.w", 30, 2.0), "no rotation", [30]),
        (broken("p.x", 31, 1e200), "absurd magnitude", [31]),
        (broken("p.x", 50, 1e9), "faster than checks.max_rate", [50]),
        (broken("p.x", 0, -4.0), "faster than checks.max_rate", [0]),
    ],
)
def test_silent_damage_is_refused_or_salvaged_and_counted(pose, reason, rows):
    with pytest.raises(UsageError, match=f"log: /pose, row {rows[0]}.*--salvage"):
        find_bad_rows("log", pose, PLAN)
    found = find_bad_rows("log", pose, PLAN, salvage=True)
    assert {key: value.tolist() for key, value in found.items()} == {reason: rows}


def test_a_stamp_far_from_its_arrival_is_damage_and_a_stamp_never_set_is_none():
    pose = Drive().pose(T)
    header = T.copy()
    header[5] -= 1e9
    with pytest.raises(UsageError, match="row 5: the header stamp is far from its arrival"):
        find_bad_rows("log", replace(pose, header=header), PLAN)
    assert not find_bad_rows("log", replace(pose, header=T - 1.7e9), PLAN)


def test_missing_cells_are_no_damage():
    values = T.copy()
    values[[3, 4]] = np.nan
    table = replace(series("/cmd", T, v=values, w=T), absent={"v": 2})
    assert not find_bad_rows("log", table, PLAN)


def test_max_rate_looks_at_angles_of_quaternions_the_short_way_round():
    plan = parse_mapping({**UNICYCLE, "checks": {"max_rate": {"yaw": 3.0}}})
    t = np.arange(0, 10, 0.01)
    yaw = Drive().w * t  # passes pi, and the quaternions change their signs
    assert not find_bad_rows("log", pose_series(t, t, t, yaw, t), plan)
    yaw[50] += 0.2
    broken_pose = pose_series(t, t, t, yaw, t)
    with pytest.raises(UsageError, match="log: /pose, row 50: changes faster than checks.max_rate"):
        find_bad_rows("log", broken_pose, plan)
    found = find_bad_rows("log", broken_pose, plan, salvage=True)
    assert found["faster than checks.max_rate"].tolist() == [50]


def test_max_rate_looks_at_what_a_sparse_column_holds():
    values = np.where(np.arange(200) % 2 == 0, 0.1 * T, np.nan)
    values[50] = 9.0
    state = {"q": {"field": "q", "unit": "m", "topic": "table"}}
    checks = {"max_rate": {"q": 3.0}}
    plan = parse_mapping({"system": "s", "rate": 20, "state": state, "checks": checks})
    table = replace(series("table", T, q=values), absent={"q": 100})
    with pytest.raises(UsageError, match="row 50"):
        find_bad_rows("log", table, plan)
