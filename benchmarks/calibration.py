"""Are 90 % intervals 90 % intervals? Simulation-based calibration of the diagnosis's intervals.

    python benchmarks/calibration.py [--worlds 320] [--seed 90] [--cores 2] [--out FILE]

Worlds of one to three effects are drawn as the blind test draws them (their seed is one for tuning), recorded, and the
true hypothesis is fitted to the recording with every parameter free, gates as they are: how often do the intervals of
several levels hold the truth, and is the truth's place in them uniform (Cook, Gelman and Rubin 2006; Talts et al.
2018)? With --out every finished world is kept, a line of JSON each, and what is there is not computed again.
Nothing is selected by what a diagnosis said: the blind test's coverage beside it is of rightly named effects.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections import defaultdict
from collections.abc import Iterator, Sequence
from concurrent.futures import as_completed
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import chisquare
from scipy.stats import t as student

from gpsim.diagnosis.assessment import intervals
from gpsim.diagnosis.fitting import fit
from gpsim.diagnosis.setup import candidates, prepare
from gpsim.simulators import make_simulator
from gpsim.trials.concealing import conceal
from gpsim.trials.drawing import SIZE, stratum_of
from gpsim.trials.fits import as_hypothesis
from gpsim.trials.intervals import rate
from gpsim.workers import begin_worker, worker_pool

LEVELS = (0.5, 0.8, 0.9, 0.95)
NINETY = LEVELS.index(0.9)
BINS = 10
Row = dict[str, Any]


def chosen(count: int) -> Iterator[int]:
    """Numbers of the first `count` trials with effects of the catalogue, long ones left out."""
    number = found = 0
    while found < count:
        number += 1
        stratum, long, _ = stratum_of(number)
        if SIZE[stratum] > 0 and stratum != "unknown" and not long:
            found += 1
            yield number


def calibrated(seed: int, number: int) -> list[Row]:
    """One row a parameter of a world's true effects."""
    concealed = conceal(seed, number)
    world, recording = concealed.world, concealed.recordings[0]
    simulator = make_simulator(world.system)
    parameters = simulator.defaults(recording.parameters)
    question = prepare(recording, simulator, parameters)
    truth = as_hypothesis(world.effects, candidates(question.recording, simulator, parameters))
    problem = question.everything
    found = fit(problem, truth, problem.windows.measured[:, 0])
    by_level = [intervals(problem, found, level) for level in LEVELS]
    names = [(t.family, p) for t, group in zip(truth.terms, truth.declared, strict=True) for p in group]
    freedom = max(len(problem.windows) - len(truth.theta), 2)
    rows = []
    for i, ((family, p), value) in enumerate(zip(names, truth.theta, strict=True)):
        low, high = by_level[NINETY][i]
        smooth = p.step is None and p.low < low and high < p.high
        scale = (high - low) / 2 / student.ppf(0.95, freedom)
        place = float(student.cdf((value - found.hypothesis.theta[i]) / scale, freedom)) if smooth else None
        inside = [bool(b[i, 0] <= value <= b[i, 1]) for b in by_level]
        rows.append(
            {"trial": number, "family": family, "parameter": p.name, "noise": world.noise_level}
            | {"effects": len(world.effects), "inside": inside, "place": place}
            | {"visible": concealed.visible}
        )
    return rows


def measured(seed: int, numbers: Sequence[int], cores: int, out: Path | None) -> list[Row]:
    """The rows of all these worlds, those that `out` holds read from there."""
    lines = out.read_text(encoding="utf-8").splitlines() if out and out.exists() else []
    kept = {entry["trial"]: entry["rows"] for entry in map(json.loads, lines) if entry["seed"] == seed}
    with worker_pool(cores, begin_worker, os.getpid()) as pool:
        jobs = {pool.submit(calibrated, seed, number): number for number in numbers if number not in kept}
        for job in as_completed(jobs):
            kept[jobs[job]] = job.result()
            if out:
                with out.open("a", encoding="utf-8") as file:
                    file.write(json.dumps({"seed": seed, "trial": jobs[job], "rows": kept[jobs[job]]}) + "\n")
            print(f"  {len(kept)} of {len(numbers)} worlds", end="\r", file=sys.stderr, flush=True)
    return [row for number in numbers for row in kept[number]]


def share(rows: Sequence[Row], level: int) -> str:
    """The coverage of a level with its interval."""
    figures = rate([row["inside"][level] for row in rows], "covered")
    low, high = figures["interval"] or (np.nan, np.nan)
    return f"{100 * figures['share']:5.1f} ({100 * low:.1f} to {100 * high:.1f})"


def table(title: str, groups: dict[str, list[Row]]) -> None:
    """Coverage of every level, one line a group."""
    print(f"\n| {title} | parameters | " + " | ".join(f"{100 * level:.0f} %" for level in LEVELS) + " |")
    print("|---|---|" + "---|" * len(LEVELS))
    for name, rows in sorted(groups.items()):
        print(f"| {name} | {len(rows)} | " + " | ".join(share(rows, i) for i in range(len(LEVELS))) + " |")


def grouped(rows: Sequence[Row], key: str) -> dict[str, list[Row]]:
    """Rows by one of their entries."""
    out: dict[str, list[Row]] = defaultdict(list)
    for row in rows:
        out[str(row[key])].append(row)
    return out


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--worlds", type=int, default=320)
    parser.add_argument("--seed", type=int, default=90)
    parser.add_argument("--cores", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--out", type=Path, help="finished worlds, one a line")
    args = parser.parse_args()
    numbers = list(chosen(args.worlds))
    rows = measured(args.seed, numbers, args.cores, args.out)
    table(f"seed {args.seed}, {len(numbers)} worlds", {"all": rows})
    for key in ("noise", "effects", "visible", "family"):
        table(key, grouped(rows, key))
    places = np.array([row["place"] for row in rows if row["place"] is not None])
    counts = np.histogram(places, bins=BINS, range=(0.0, 1.0))[0]
    p_value = float(chisquare(counts).pvalue)
    print(f"\nPlaces of the truth in its distribution, {len(places)} smooth parameters, {BINS} bins:")
    print("  " + " ".join(f"{count:d}" for count in counts) + f"   uniform: p = {p_value:.3g} (chi squared)")


if __name__ == "__main__":
    main()
