"""Reading a bag into columns beside rosbags reading and deserialising the same topics; both from the same file.

    python benchmarks/bag_import.py [--kind ros1|sqlite3|mcap] [--mb 20] [--share 0.25] [--repeats 3] [--out FILE]

The bag is synthetic: poses (500 to 1) and commands in `share` of its bytes, camera images that nobody asks for in the
rest. Runs alternate, each in a process of its own, so that peaks of memory are their own. Times are processor time:
what a free machine would take, however busy this one is. Only messages of the wanted topics count as rows.
"""

from __future__ import annotations

import argparse
import json
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.highlevel import AnyReader
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore

from gpsim.recordings import open_log

EPOCH = 1_700_000_000_000_000_000
WANTED = {
    "/mocap/limo": [
        f"pose.{part}.{axis}"
        for part, axes in (("position", "xyz"), ("orientation", "xyzw"))
        for axis in axes
    ],
    "/cmd_vel": ["linear.x", "angular.z"],
}
TYPES = {
    "/mocap/limo": "geometry_msgs/msg/PoseStamped",
    "/cmd_vel": "geometry_msgs/msg/Twist",
    "/camera": "sensor_msgs/msg/CompressedImage",
}
IMAGE = 50_000
Row = tuple[str, int, bytes]


def rows(megabytes: float, share: float, ros1: bool) -> Iterator[Row]:
    """(topic, time [ns], bytes) until the bag holds so much; images come whenever poses are ahead of their share."""
    store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
    types = store.types
    rng = np.random.default_rng(0)
    picture = rng.integers(0, 256, IMAGE, dtype=np.uint8)
    total, small, i = 0, 0, 0

    def packed(topic: str, message: Any) -> bytes:
        raw = (
            store.serialize_ros1(message, TYPES[topic])
            if ros1
            else store.serialize_cdr(message, TYPES[topic])
        )
        return bytes(raw)

    def header(when: int) -> Any:
        stamp = types["builtin_interfaces/msg/Time"](when // 10**9, when % 10**9)
        return (
            types["std_msgs/msg/Header"](i, stamp, "map")
            if ros1
            else types["std_msgs/msg/Header"](stamp, "map")
        )

    point, quaternion = types["geometry_msgs/msg/Point"], types["geometry_msgs/msg/Quaternion"]
    vector, pose = types["geometry_msgs/msg/Vector3"], types["geometry_msgs/msg/Pose"]
    while total < megabytes * 1e6:
        when = EPOCH + i * 2_000_000
        angle = 0.001 * i
        place = pose(
            point(np.cos(angle), np.sin(angle), 0.05),
            quaternion(0.0, 0.0, np.sin(angle / 2), np.cos(angle / 2)),
        )
        made = [
            (
                "/mocap/limo",
                when,
                packed("/mocap/limo", types[TYPES["/mocap/limo"]](header(when - 5_000_000), place)),
            )
        ]
        if i % 500 == 0:
            twist = types["geometry_msgs/msg/Twist"](vector(0.3, 0.0, 0.0), vector(0.0, 0.0, 0.1))
            made.append(("/cmd_vel", when + 1, packed("/cmd_vel", twist)))
        small += sum(len(data) + 50 for _, _, data in made)
        total += sum(len(data) + 50 for _, _, data in made)
        while small > share * total:
            image = types["sensor_msgs/msg/CompressedImage"](header(when), "jpeg", picture)
            made.append(("/camera", when + 2, packed("/camera", image)))
            total += IMAGE
        yield from made
        i += 1


def write(folder: Path, kind: str, megabytes: float, share: float) -> Path:
    """The bag, as a file or a ROS 2 folder."""
    ros1 = kind == "ros1"
    path = folder / ("drive.bag" if ros1 else "drive")
    store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
    plugin = StoragePlugin.SQLITE3 if kind == "sqlite3" else StoragePlugin.MCAP
    writer: Any = Writer1(path) if ros1 else Writer2(path, version=9, storage_plugin=plugin)
    with writer:
        connections = {
            topic: writer.add_connection(topic, name, typestore=store) for topic, name in TYPES.items()
        }
        for topic, when, data in rows(megabytes, share, ros1):
            writer.write(connections[topic], when, data)
    return path


def read_with_gpsim(path: Path) -> int:
    return sum(series.read for series in open_log(path).series(WANTED).values())


def read_with_rosbags(path: Path) -> int:
    count = 0
    with AnyReader([path]) as reader:
        wanted = [connection for connection in reader.connections if connection.topic in WANTED]
        for connection, _, data in reader.messages(wanted):
            reader.deserialize(data, connection.msgtype)
            count += 1
    return count


READERS = {"gpsim": read_with_gpsim, "rosbags": read_with_rosbags}


def one_run(reader: str, path: Path) -> None:
    """Measure in this process: rows, processor seconds, wall seconds, and by how much memory grew at its peak."""
    before = peak_mb()
    start, wall = time.process_time(), time.perf_counter()
    count = READERS[reader](path)
    seconds, wall = time.process_time() - start, time.perf_counter() - wall
    peak = peak_mb()
    print(
        json.dumps(
            {"rows": count, "seconds": seconds, "wall": wall, "peak_mb": peak, "grown_mb": peak - before}
        )
    )


def peak_mb() -> float:
    """Largest resident memory of this program so far [MB]; ru_maxrss would count what forked it, too."""
    status = Path("/proc/self/status")
    if status.is_file():
        lines = status.read_text(encoding="ascii").splitlines()
        return next(float(line.split()[1]) for line in lines if line.startswith("VmHWM")) / 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def measure(path: Path, repeats: int) -> dict[str, dict[str, float]]:
    """Alternate the readers; medians of rows per second, the largest peaks."""
    runs: dict[str, list[dict[str, float]]] = {name: [] for name in READERS}
    for _ in range(repeats):
        for name in READERS:
            command = [sys.executable, __file__, "--run", name, "--path", str(path)]
            runs[name].append(
                json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
            )
    if len({run["rows"] for several in runs.values() for run in several}) != 1:
        raise SystemExit("error: the readers do not agree on the number of rows")
    return {
        name: {
            "rows": several[0]["rows"],
            "rows_per_second": statistics.median(run["rows"] / run["seconds"] for run in several),
            "wall_seconds": statistics.median(run["wall"] for run in several),
            "peak_mb": max(run["peak_mb"] for run in several),
            "grown_mb": max(run["grown_mb"] for run in several),
        }
        for name, several in runs.items()
    }


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--kind", choices=("ros1", "sqlite3", "mcap"), default="ros1")
    parser.add_argument("--mb", type=float, default=20.0, help="size of the bag [MB]")
    parser.add_argument("--share", type=float, default=0.25, help="share of its bytes in the wanted topics")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument(
        "--folder", type=Path, default=None, help="where the bag is written (and removed again)"
    )
    parser.add_argument("--out", type=Path, default=None, help="write the figures as JSON")
    parser.add_argument("--run", choices=tuple(READERS), default=None, help=argparse.SUPPRESS)
    parser.add_argument("--path", type=Path, default=None, help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    if chosen.run is not None:
        one_run(chosen.run, chosen.path)
        return
    with tempfile.TemporaryDirectory(dir=chosen.folder) as folder:
        path = write(Path(folder), chosen.kind, chosen.mb, chosen.share)
        size = sum(p.stat().st_size for p in (path.rglob("*") if path.is_dir() else [path])) / 1e6
        found = measure(path, chosen.repeats)
    print(
        f"{chosen.kind}, {size:.0f} MB, {found['gpsim']['rows']:.0f} rows, {chosen.repeats} runs each in turn"
    )
    for name, figures in found.items():
        print(
            f"  {name:8s} {figures['rows_per_second']:9.0f} rows/s   peak {figures['peak_mb']:6.0f} MB"
            f" ({figures['grown_mb']:.0f} MB above the start)   {figures['wall_seconds']:.1f} s by the clock"
        )
    ratio = found["rosbags"]["rows_per_second"] / found["gpsim"]["rows_per_second"]
    print(f"  gpsim takes {ratio:.2f} times rosbags' time (goal: at most 1.5)")
    if chosen.out is not None:
        figures = {"kind": chosen.kind, "mb": size, "time_ratio": ratio, "readers": found}
        chosen.out.write_text(json.dumps(figures, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
