"""Does the importer tell the same story as the authors' own log? The DART drive in three files.

    GPSIM_RECORDINGS=... python benchmarks/import_agreement.py

prints, for the ROS 1 bag, its ROS 2 twin and the authors' CSV of the same drive, how far the recordings differ.
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from gpsim.channels import FloatArray, wrap_angle
from gpsim.recordings import Episode, Recording
from gpsim.stages.import_log import read_logs

FOLDER = Path(os.environ.get("GPSIM_RECORDINGS", "../shared/recordings")) / "dart_jetracer"
BAG = FOLDER / "bags" / "4_sept_random_driving_slow.bag"
TWIN = FOLDER / "bags" / "slow_ros2_sqlite3"
LOG = FOLDER / "csv" / "90_model_validation_long_term_predictions"
# The authors logged the commands as the car echoed them, not as they were sent.
ECHOED = (
    "action.v_cmd.topic=/sensors_and_input_1",
    "action.v_cmd.field=data.8",
    "action.steering.topic=/sensors_and_input_1",
    "action.steering.field=data.9",
)


def recorded(source: Path, mapping: str, *words: str) -> Recording:
    """Import without writing."""
    return read_logs([source], mapping, words)[0]


def absolute(recording: Recording) -> tuple[FloatArray, Episode]:
    """Seconds since 1970 of the first episode's samples, and the episode."""
    origin = recording.provenance["sources"]["0"]
    episode = recording.episodes[0]
    return origin["epoch_s"] + origin["start_s"] + episode.t, episode


def same(first: Recording, second: Recording) -> bool:
    """Whether two recordings hold the same bytes in every channel."""
    pairs = zip(first.episodes, second.episodes, strict=True)
    return all(
        np.array_equal(a.t, b.t)
        and np.array_equal(a.states, b.states)
        and np.array_equal(a.actions, b.actions)
        for a, b in pairs
    )


def pose_difference(recording: Recording, log: Recording) -> FloatArray:
    """(3,) largest |x| [m], |y| [m], |yaw| [rad] difference, the log interpolated at the recording's times."""
    t, episode = absolute(recording)
    own, reference = absolute(log)
    inside = (t >= own[0]) & (t <= own[-1])
    x, y, yaw = reference.states.T
    states = [np.interp(t[inside], own, column) for column in (x, y, np.unwrap(yaw))]
    error = episode.states[inside] - np.stack(states, axis=1)
    error[:, 2] = wrap_angle(error[:, 2])
    return np.asarray(np.abs(error).max(axis=0))


def command_agreement(recording: Recording, log: Recording) -> FloatArray:
    """(2,) share of the steps at which the command is the log's, to half its resolution."""
    t, episode = absolute(recording)
    own, reference = absolute(log)
    t = t[:-1]
    inside = (t >= own[0]) & (t <= own[-2])
    row = np.searchsorted(own, t[inside] + 1e-6, side="right") - 1
    return np.asarray((np.abs(episode.actions[inside] - reference.actions[row]) < 1e-6).mean(axis=0))


def main() -> None:
    """Print the figures."""
    bag, twin = recorded(BAG, "dart_jetracer"), recorded(TWIN, "dart_jetracer")
    print(
        f"ROS 1 bag and ROS 2 twin: {'the same recording, bit for bit' if same(bag, twin) else 'DIFFERENT'}"
    )
    log = recorded(LOG, "dart_csv", "rate=source", "episodes.by=file")
    for name, rate in (("at the poses' own stamps", "source"), ("on the 50 Hz grid", "50")):
        x, y, yaw = pose_difference(recorded(BAG, "dart_jetracer", f"rate={rate}"), log)
        print(
            f"bag against the authors' log {name}: |x| {x:.2e} m, |y| {y:.2e} m, |yaw| {yaw:.2e} rad at most"
        )
    receive = recorded(BAG, "dart_jetracer", "clock.topics./vicon/jetracer1=receive")
    x, y, yaw = pose_difference(receive, log)
    print(f"the same on receive time (the wrong clock): |x| {x:.2e} m, |y| {y:.2e} m, |yaw| {yaw:.2e} rad")
    for name, source in (("as sent", bag), ("as echoed by the car", recorded(BAG, "dart_jetracer", *ECHOED))):
        throttle, steering = command_agreement(source, log)
        print(f"commands {name}: throttle equal at {throttle:.1%} of the steps, steering at {steering:.1%}")


if __name__ == "__main__":
    main()
