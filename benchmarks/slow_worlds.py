"""How long the slow worlds of a blind test take on several cores, one at a time.

    python benchmarks/slow_worlds.py DIR [--above 60] [--cores 2]

DIR is where `gpsim prove` has diagnosed each trial on one core beside others. Those of standard length that took longer
than `--above` seconds are diagnosed again with `--cores`, nothing else running: the command's wall seconds, start of
the interpreter included, and whether the answer is the same. Kept in
DIR/slow_worlds_CORES.csv: the same command carries on.
"""

from __future__ import annotations

import argparse
import csv
import json
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

GPSIM = Path(sys.executable).with_name("gpsim")
COLUMNS = ("trial", "stratum", "transitions", "seconds beside others", "seconds", "same answer")


def slow(folder: Path, above: float) -> list[dict[str, Any]]:
    """The scores of the trials to time, the slowest first; those of long recordings are no standard ones."""
    scores = [json.loads(p.read_text(encoding="utf-8")) for p in sorted((folder / "scores").glob("*.json"))]
    found = [s for s in scores if not s["long"] and s["seconds"] > above and answer(folder, s).is_file()]
    return sorted(found, key=lambda s: -s["seconds"])


def answer(folder: Path, score: dict[str, Any]) -> Path:
    """Where the kept diagnosis of a trial lies; there is none where it failed."""
    return folder / "diagnoses" / f"{int(score['trial']):04d}" / "diagnosis" / "diagnosis.json"


def timed(folder: Path, score: dict[str, Any], cores: int) -> tuple[str, ...]:
    """One trial again."""
    name = f"{int(score['trial']):04d}"
    with tempfile.TemporaryDirectory() as room:
        out = Path(room) / "diagnosis"
        command = [
            str(GPSIM),
            "diagnose",
            str(folder / "public" / name),
            "--out",
            str(out),
            "--cores",
            str(cores),
        ]
        begun = time.monotonic()
        done = subprocess.run(command, capture_output=True, check=False)
        seconds = time.monotonic() - begun
        again = b"" if done.returncode else (out / "diagnosis.json").read_bytes()
    before = answer(folder, score).read_bytes()
    once, twice = f"{score['seconds']:.1f}", f"{seconds:.1f}"
    return name, score["stratum"], str(score["transitions"]), once, twice, "yes" if again == before else "no"


def main() -> None:
    """Time them and print the median, the longest and how many took more than a minute."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--above", type=float, default=60.0)
    parser.add_argument("--cores", type=int, default=2)
    given = parser.parse_args()
    out = given.folder / f"slow_worlds_{given.cores}.csv"
    if not out.is_file():
        out.write_text(",".join(COLUMNS) + "\n", encoding="utf-8")
    with out.open(newline="", encoding="utf-8") as file:
        rows = [tuple(row) for row in list(csv.reader(file))[1:]]
    known = {row[0] for row in rows}
    for score in slow(given.folder, given.above):
        if f"{int(score['trial']):04d}" in known:
            continue
        rows.append(timed(given.folder, score, given.cores))
        with out.open("a", newline="", encoding="utf-8") as file:
            csv.writer(file).writerow(rows[-1])
        print(*rows[-1], sep="  ", flush=True)
    seconds = [float(row[4]) for row in rows]
    if seconds:
        more, middle = sum(s > 60.0 for s in seconds), statistics.median(seconds)
        print(f"{len(seconds)} worlds: median {middle:.1f} s, longest {max(seconds):.1f} s, {more} over 60 s")


if __name__ == "__main__":
    main()
