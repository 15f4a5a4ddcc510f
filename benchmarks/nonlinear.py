"""Sets of the nonlinear system identification benchmark, by their own rule: the error of one simulation of a record.

    GPSIM_RECORDINGS=... python benchmarks/nonlinear.py --out runs/nonlinear

learns from the estimation record, then simulates the test record from its commands alone. Where the simulation starts
(what nobody measured, too) is fitted to the first samples, which do not count. It writes OUT/nonlinear.md: the root
mean square error of the bare simulator, of the account, of the account with a Gaussian process on what it leaves, of
PySINDy (de Silva et al. 2020) on the same record (a polynomial of degree 2 of past readings and commands, the threshold
chosen by simulation of the estimation record), and of what is published.

Of EMPS the test record is not among the recordings: its last fifth, which no fit saw, stands in its place.
"""

from __future__ import annotations

import argparse
import os
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

import gpsim
from gpsim import CorrectedSimulator
from gpsim.channels import FloatArray
from gpsim.corrected import EffectsPlant
from gpsim.recordings import Recording
from gpsim.simulators import make_simulator
from gpsim.stages.import_log import read_logs

ROOT = Path(__file__).resolve().parents[1]
FOLDER = Path(os.environ.get("GPSIM_RECORDINGS", ROOT.parent / "shared" / "recordings"))
TANKS = f"{ROOT / 'docs' / 'examples' / 'cascaded_tanks.py'}:CascadedTanks"
WINDOW = (
    50  # samples that a simulation's start is fitted to, as the benchmark's own package has it for the tanks
)
LAGS, DEGREE = 3, 2  # of PySINDy: past readings and commands, degree of their polynomial
RUNS_AWAY = 100.0  # times the readings' standard deviation: such a simulation says nothing
THRESHOLDS = (1e-4, 3e-4, 1e-3, 3e-3, 1e-2)
Simulate = Callable[[FloatArray, FloatArray], FloatArray]
"""From a start (S,) and commands (K, A), the readings (K + 1,) of the channel that counts."""


@dataclass(frozen=True)
class Set:
    """A set: where it lies, its channel that counts, a simulator of one's own, what is published and where."""

    name: str
    source: str
    mapping: str
    channel: str
    unit: str
    published: str
    simulator: str | None = None


SETS = (
    Set(
        "cascaded tanks", "cascaded_tanks/dataBenchmark.csv", "cascaded_tanks", "lower", "V",
        "0.34 (nonlinear state space), 0.45 (polynomial state space), 0.54 (Volterra), 0.76 (linear): Hammerstein "
        "Box-Jenkins System Identification of the Cascaded Tanks Benchmark System, 2021, table 2, which calls them "
        "mean squares; their roots are 0.59, 0.67, 0.73 and 0.87 V",
        TANKS,
    ),
    Set("EMPS slide", "emps/DATA_EMPS.mat", "emps", "q", "m", "none for this part of the record"),
)  # fmt: skip


def parts(found: Recording) -> tuple[Recording, FloatArray, FloatArray]:
    """What is learnt from, and the readings (K + 1, S) and commands (K, A) of the test record."""
    first, last = found.episodes[0], found.episodes[-1]
    if len(found.episodes) > 1:
        return replace(found, episodes=(first,), held_out=None), last.states, last.actions
    cut = 4 * len(first.actions) // 5
    learnt = replace(
        first, t=first.t[: cut + 1], states=first.states[: cut + 1], actions=first.actions[:cut], weights=None
    )
    return replace(found, episodes=(learnt,), held_out=None), first.states[cut:], first.actions[cut:]


def by(simulator: CorrectedSimulator, channel: str) -> Simulate:
    """A corrected simulator as a function."""
    column = list(simulator.state).index(channel)
    return lambda start, actions: simulator.rollout(start, actions, measured=True)[:, column]


def simulated(run: Simulate, start: FloatArray, readings: FloatArray, actions: FloatArray) -> float:
    """Root mean square error after the window, from the start that fits the window best."""
    scale = np.maximum(np.abs(start), 1e-3)

    def missed(share: FloatArray) -> FloatArray:
        return np.nan_to_num(run(start + share * scale, actions[: WINDOW - 1]) - readings[:WINDOW], nan=1e6)

    best = least_squares(missed, np.zeros(len(start)), diff_step=1e-3)
    error = run(start + best.x * scale, actions)[WINDOW:] - readings[WINDOW:]
    return float(np.sqrt(np.mean(error**2)))


def bare(simulator: CorrectedSimulator) -> CorrectedSimulator:
    """The base simulator of a corrected one."""
    assert isinstance(simulator.plant, EffectsPlant)
    return replace(simulator, plant=replace(simulator.plant, terms=(), correction=None))


def sindy(learnt: Recording, column: int, readings: FloatArray, actions: FloatArray) -> float | None:
    """PySINDy's root mean square error; None where it is not installed or its simulations run away."""
    try:
        import pysindy
    except ImportError:
        return None
    y, u = learnt.episodes[0].states[:, column], learnt.episodes[0].actions
    best: tuple[float, object] | None = None
    rows, target = embedded(y, u)
    library = pysindy.PolynomialLibrary(degree=DEGREE).fit(rows)
    features = np.asarray(library.transform(rows))
    for threshold in THRESHOLDS:
        optimizer = pysindy.STLSQ(threshold=threshold, alpha=1e-6, normalize_columns=True)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            weights = np.asarray(optimizer.fit(features, target).coef_).ravel()

        def told(past: FloatArray, commands: FloatArray, weights=weights) -> FloatArray:
            return free_run(past, commands, lambda x: (np.asarray(library.transform(x)) @ weights).item())

        error = float(np.sqrt(np.mean((told(y, u)[WINDOW:] - y[WINDOW:]) ** 2)))
        if np.isfinite(error) and (best is None or error < best[0]):
            best = error, told
    if best is None:
        return None
    error = best[1](readings, actions)[WINDOW:] - readings[WINDOW:]  # type: ignore[operator]
    missed = float(np.sqrt(np.mean(error**2)))
    return missed if missed < RUNS_AWAY * float(np.std(readings)) else None


def embedded(y: FloatArray, u: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(K, LAGS (1 + A)) past readings and commands, and the change (K,) that follows."""
    rows = [
        np.concatenate([y[k - LAGS + 1 : k + 1], u[k - LAGS + 1 : k + 1].ravel()])
        for k in range(LAGS, len(u))
    ]
    return np.array(rows), np.array([y[k + 1] - y[k] for k in range(LAGS, len(u))])


def free_run(y: FloatArray, u: FloatArray, change: Callable[[FloatArray], float]) -> FloatArray:
    """(K + 1,) simulated from the window's readings on."""
    out = np.array(y)
    for k in range(WINDOW - 1, len(u)):
        row = np.concatenate([out[k - LAGS + 1 : k + 1], u[k - LAGS + 1 : k + 1].ravel()])
        out[k + 1] = np.clip(out[k] + change(row[None]), -1e6, 1e6)
    return out


def line(one: Set, out: Path) -> str:
    """The row of a set."""
    found, _, _ = read_logs([FOLDER / one.source], one.mapping)
    learnt, readings, actions = parts(found)
    diagnosis = gpsim.diagnose(learnt, one.simulator, trust=True)
    diagnosis.save(out / one.mapping)
    corrected = {"effects": diagnosis.corrected(), "effects + GP": diagnosis.corrected(gp=True)}
    runs = {"base": bare(corrected["effects"]), **corrected}
    system = make_simulator(one.simulator or found.system)
    measured = list(found.state.names)
    start = np.array(
        [readings[0, measured.index(n)] if n in measured else system.start[n] for n in system.state.names]
    )
    column = measured.index(one.channel)
    errors = [
        f"{simulated(by(simulator, one.channel), start, readings[:, column], actions):.4g}"
        for simulator in runs.values()
    ]
    rival = sindy(learnt, column, readings[:, column], actions)
    told = " + ".join(f"{e.family} on {e.place}" for e in diagnosis.effects) or "nothing"
    cells = [
        one.name,
        *errors,
        "-" if rival is None else f"{rival:.4g}",
        one.unit,
        f"{diagnosis.verdict}: {told}",
    ]
    return f"| {' | '.join([*cells, one.published])} |"


def main() -> None:
    """The table of all sets that are there."""
    options = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    options.add_argument("--out", type=Path, default=Path("runs/nonlinear"))
    options.add_argument("--only", nargs="*", default=[one.mapping for one in SETS])
    chosen = options.parse_args()
    chosen.out.mkdir(parents=True, exist_ok=True)
    rows = [
        line(one, chosen.out) for one in SETS if one.mapping in chosen.only and (FOLDER / one.source).exists()
    ]
    names = ("set", "base", "effects", "effects + GP", "PySINDy", "unit", "account", "published")
    head = f"| {' | '.join(names)} |\n|{'---|' * len(names)}"
    table = "\n".join([head, *rows]) + "\n"
    (chosen.out / "nonlinear.md").write_text(table)
    print(table)


if __name__ == "__main__":
    main()
