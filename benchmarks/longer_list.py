"""What the newer families cost where they are not there: processor seconds with them on offer, over those without.

    gpsim prove conceal --trials 14 --seed 77 --out runs/list
    python benchmarks/longer_list.py runs/list/public [--at-most 9]

Every recording is diagnosed twice by the same code on one core, one after the other, in turn which comes first.
"""

from __future__ import annotations

import argparse
import os
import resource
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

from gpsim.recordings import read_recording
from gpsim.trials.catalogue import WORDS

GPSIM = Path(sys.executable).parent / "gpsim"


def seconds(recording: Path, words: list[str]) -> float:
    """Processor seconds of one diagnosis."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run(
            [GPSIM, "diagnose", recording, "--out", Path(folder) / "d", "--cores", "1", "--quiet", *words],
            check=True,
            capture_output=True,
            env=os.environ | {"OMP_NUM_THREADS": "1"},
        )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("recordings", type=Path)
    parser.add_argument("--at-most", type=int, default=9)
    given = parser.parse_args()
    recordings, ratios = sorted(p for p in given.recordings.iterdir() if p.is_dir()), []
    for turn, recording in enumerate(recordings[: given.at_most]):
        system = read_recording(recording).system
        newer = ",".join(family for family, word in WORDS.items() if system in word.systems)
        without = [f"diagnose.families.without=[{newer}]"]
        sides = [without, []] if turn % 2 else [[], without]
        first, second = (seconds(recording, words) for words in sides)
        longer, shorter = (second, first) if turn % 2 else (first, second)
        ratios.append(longer / shorter)
        print(f"{recording.name}: {longer:.1f} s, without {shorter:.1f} s, {ratios[-1]:.2f}", flush=True)
    print(f"median {statistics.median(ratios):.2f}, {min(ratios):.2f} to {max(ratios):.2f}")


if __name__ == "__main__":
    main()
