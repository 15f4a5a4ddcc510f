"""Bags through the whole import: two frames of a topic, and damage, which ends in a sound recording or one line."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from bags import KINDS, called, drive, write_bag
from mutations import mutate

from gpsim.errors import UsageError
from gpsim.stages.import_log import read_logs

FRAMES = """
system: frames
rate: 50
state:
  x: {topic: /tf, field: "transforms[child_frame_id=base_link].transform.translation.x", unit: m}
  turned: {topic: /tf, field: "transforms[child_frame_id=wheel].transform.translation.x", unit: rad}
action:
  v_cmd: {topic: /cmd_vel, field: linear.x, unit: m/s}
"""


@pytest.mark.parametrize("kind", ["ros1", "mcap"])
def test_two_frames_of_one_topic_are_two_tracks(tmp_path, kind):
    bag = write_bag(tmp_path / called(kind), kind, drive(seconds=4.0))
    (tmp_path / "mine.yaml").write_text(FRAMES)
    recording, report, _ = read_logs([bag], str(tmp_path / "mine.yaml"))
    (episode,) = recording.episodes
    x, turned = episode.states.T
    # message i holds the wheel at i, and every second one the base at cos(0.02 i)
    assert x == pytest.approx(np.cos(0.02 * turned), abs=1e-3)  # stamps jitter by 0.5 ms
    assert turned[-1] > 190.0
    counts = {count.part: count for count in report.topics if count.topic == "/tf"}
    assert {part: count.read for part, count in counts.items()} == {
        "transforms[child_frame_id=base_link]": 100,
        "transforms[child_frame_id=wheel]": 200,
    }
    for count in report.topics:
        assert count.read == count.kept + sum(count.dropped.values())
        assert "value missing" not in count.dropped


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
    source = write_bag(folder / called(kind, "sound"), kind, drive(2.0))
    mapping = folder / "mapping.yaml"
    mapping.write_text(MAPPING)
    counts = {"imported": 0, "refused": 0}
    for number in numbers:
        target = folder / f"damaged-{number}{source.suffix}"
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
