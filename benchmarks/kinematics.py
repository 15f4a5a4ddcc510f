"""How well a geometry is found: python benchmarks/kinematics.py [SEEDS]. Made motion captures of the tests' arms.

A row a world: how often just what is off was named, how often anything else, and how often an interval of 90 % held.
"""

from __future__ import annotations

import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from mjcf_arms import PLANAR, SIX, Capture, arm, seen

from gpsim.kinematics import Calibration, calibrate
from gpsim.mjcf import in_its_columns, open_simulator
from gpsim.residuals import read_table

USUAL = Capture(seconds=20.0, dt=0.02, lost=0.1, leaping=0.02)
Truth = dict[tuple[str, str, str], float]
ZERO, LENGTH = ("joint zero", "j2", ""), ("body place", "l3", "z")
TILT, LATE = ("frame turn", "", "x"), ("delay", "", "")
WORLDS: dict[str, tuple[str, dict[str, float], Capture, Truth]] = {
    "planar arm, nothing": (PLANAR, {}, USUAL, {}),
    "arm of six, nothing": (SIX, {}, USUAL, {}),
    "arm of six, nothing, errors that last 0.4 s": (SIX, {}, replace(USUAL, memory=0.95), {}),
    "planar arm, a zero": (PLANAR, {"zero": -0.01}, USUAL, {("joint zero", "elbow", ""): 0.01}),
    "arm of six, zero, length, tilt, 20 ms late": (
        SIX,
        {"z2": -0.02, "l3": 0.403},
        replace(USUAL, delay=0.02, turned=(0.01, 0.0, 0.0)),
        {ZERO: 0.02, LENGTH: 0.003, TILT: 0.01, LATE: 0.02},
    ),
    "the same, errors that last 0.4 s": (
        SIX,
        {"z2": -0.02, "l3": 0.403},
        replace(USUAL, delay=0.02, turned=(0.01, 0.0, 0.0), memory=0.95),
        {ZERO: 0.02, LENGTH: 0.003, TILT: 0.01, LATE: 0.02},
    ),
}


def calibrated(text: str, numbers: dict[str, float], how: Capture) -> Calibration:
    """What is said of one made recording."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        (folder / "robot.xml").write_text(arm(text), encoding="utf-8")
        seen(arm(text, **numbers), how).to_csv(folder / "log.csv", index=False)
        simulator = open_simulator(str(folder / "robot.xml"))
        found = calibrate(in_its_columns(read_table(folder / "log.csv", simulator), simulator), simulator)
    assert found is not None
    return found


def main(seeds: int) -> None:
    """A row of the table a world."""
    print("| world | all of it named | anything else | intervals that hold | after / noise | processor s |")
    print("|---|---|---|---|---|---|")
    for name, (text, numbers, how, truth) in WORLDS.items():
        whole = more = held = asked = 0
        left, began = [], time.process_time()
        for seed in range(seeds):
            told = calibrated(text, numbers, replace(how, seed=seed)).told
            found = {(f.place.kind, f.place.on, f.place.axis): f.size for f in told.found}
            whole += all(place in found for place in truth)
            # A tilt about the first joint, 0.1 m up, moves the base along y, too.
            more += any(place not in truth and place != ("frame place", "", "y") for place in found)
            for place, value in truth.items():
                if place in found:
                    low, high = found[place].low, found[place].high
                    held, asked = held + (low <= value <= high), asked + 1
            left.append(told.error["tool"].after / told.error["tool"].noise)
        seconds = (time.process_time() - began) / seeds
        cells = [f"{whole} of {seeds}", f"{more} of {seeds}", f"{held} of {asked}"]
        print(f"| {name} | {' | '.join(cells)} | {np.mean(left):.2f} | {seconds:.1f} |", flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 20)
