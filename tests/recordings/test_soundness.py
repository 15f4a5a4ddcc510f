from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from by_hand import UNICYCLE, Drive, series

from gpsim.errors import UsageError
from gpsim.recordings.mapping_files import parse_mapping
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


def test_missing_cells_are_counted_without_salvage():
    values = T.copy()
    values[[3, 4]] = np.nan
    table = replace(series("/cmd", T, v=values, w=T), absent={"v": 2})
    assert find_bad_rows("log", table, PLAN)["value missing"].tolist() == [3, 4]
