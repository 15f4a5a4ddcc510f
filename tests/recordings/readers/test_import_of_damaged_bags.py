"""Damaged bags through the whole import: a sound recording or one clear line, never a raw exception."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from bags import KINDS, MCAP_KINDS, drive, write_bag
from mutations import mutate

from gpsim.errors import UsageError
from gpsim.stages.import_log import read_logs

MAPPING = """
system: unicycle
rate: 10
state:
  x: {topic: /pose, field: pose.position.x, unit: m}
  y: {topic: /pose, field: pose.position.y, unit: m}
  yaw: {topic: /pose, quaternion: pose.orientation, angle: yaw, unit: rad, wraps: true}
action:
  v_cmd: {topic: /cmd_vel, field: linear.x, unit: m/s}
  w_cmd: {topic: /cmd_vel, field: angular.z, unit: rad/s}
held_out: none
"""


def import_damaged(folder: Path, kind: str, numbers: range) -> dict[str, int]:
    suffix = ".bag" if kind.startswith("ros1") else ".mcap" if kind in MCAP_KINDS else ""
    source = write_bag(folder / f"sound{suffix}", kind, drive(2.0))
    mapping = folder / "mapping.yaml"
    mapping.write_text(MAPPING)
    counts = {"imported": 0, "refused": 0}
    for number in numbers:
        target = folder / f"damaged-{number}{suffix}"
        mutate(source, target, number)
        for salvage in (False, True):
            try:
                recording, _, _ = read_logs([target], str(mapping), (), salvage)
            except UsageError as error:
                assert "\n" not in str(error)
                counts["refused"] += 1
                continue
            assert all(
                np.isfinite(e.states).all() and np.isfinite(e.actions).all() for e in recording.episodes
            )
            counts["imported"] += 1
        shutil.rmtree(target) if target.is_dir() else target.unlink()
    return counts


@pytest.mark.parametrize("kind", ["ros1", "sqlite3", "mcap"])
def test_a_few_damaged_bags_import_or_are_refused(tmp_path: Path, kind: str) -> None:
    counts = import_damaged(tmp_path, kind, range(6))
    assert counts["refused"] > 0


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_many_damaged_bags_import_or_are_refused(tmp_path: Path, kind: str) -> None:
    counts = import_damaged(tmp_path, kind, range(100, 160))
    print(f"\n{kind}: {counts}")
    assert min(counts.values()) > 0
