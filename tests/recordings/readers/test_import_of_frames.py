from __future__ import annotations

import numpy as np
import pytest
from bags import drive, write_bag

from gpsim.stages.import_log import read_logs

MAPPING = """
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
    bag = write_bag(tmp_path / f"drive.{'bag' if kind == 'ros1' else 'mcap'}", kind, drive(seconds=4.0))
    (tmp_path / "mine.yaml").write_text(MAPPING)
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
