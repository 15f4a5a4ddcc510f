"""One-step error of the Limo's Gaussian processes beside the thesis's Table 4.5, by how transients are treated.

python benchmarks/limo_transients.py [--holds 30 60 100] [--seed 0]

Every row is a sweep of the stand-in through its bag and the importer. `all rows` is the thesis's way: each row
counts, the transient after each change of command included; `settled` keeps rows whose command has stood for a
second; `arrived` also finds each command's delay and lag and puts them before the Gaussian process (gp=arrived, the
default). NRMSE is over the range (max - min) of the residual: on the sweep's own rows, as measured, and on 50 fresh
drives with random commands held for a second in the mean, against the true rates. `bias` is the mean error of |w|
over the grid in the settled state: negative where the simulator turns too little (the thesis's over-correction).
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import argparse
import json
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from gpsim.cli.configuration import resolve

from gpsim.corrected import CorrectedPlant, GpCorrection, arrived_inputs
from gpsim.environments import collect_episodes, random_actor
from gpsim.evaluation import nrmse
from gpsim.recordings import Recording
from gpsim.residuals import Residuals, build_residuals
from gpsim.stages import build_residuals as residual_stage
from gpsim.stages import collect, fit_gp
from gpsim.stages.building import base_plant, make_task, target_plant
from gpsim.stages.stage import Request
from gpsim.stages.train_gp_policy import corrected_plant

WAYS = {
    "all rows": ("gp=sweep",),
    "settled": ("gp=arrived", "gp.filter=false"),
    "arrived": ("gp=arrived",),
}


def fresh_drives(request: Request) -> Residuals:
    rng, base = np.random.default_rng(12345), base_plant(request.config)
    task = make_task(request.config)
    episodes = collect_episodes(target_plant(request.config), task, random_actor(task, rng), 50, rng)
    recording = Recording(base.simulator.name, base.state, base.action, episodes, base.dt)
    return build_residuals(recording, base.simulator, {}, base.integrator, test_fraction=0.0, rng=rng)


def errors(plant: CorrectedPlant, data: Residuals) -> dict[str, float]:
    assert isinstance(plant.correction, GpCorrection)
    inputs, late = arrived_inputs(plant, data)
    predicted = plant.correction.predictor.mean(plant.correction.features(inputs)) + late
    return {
        name: nrmse(predicted[:, i], data.values[:, i])
        for i, name in enumerate(data.rate.names)
        if name != "v_lateral"
    }


def bias(plant: CorrectedPlant, request: Request) -> float:
    """Mean of |w| in the corrected simulator minus |w| of the car, over the sweep's grid, after six seconds."""
    car, rng = target_plant(request.config), np.random.default_rng(0)
    grid = np.stack(np.meshgrid(np.linspace(0.0, 0.2, 10), np.linspace(-0.3, 0.3, 10)), -1).reshape(-1, 2)
    found = []
    for one in (plant, car):
        state, memory = np.zeros((100, 3)), one.begin(100, rng)
        for _ in range(60):
            before, state = state, one.step(state, grid, memory, rng)
        found.append(np.abs(state[:, 2] - before[:, 2]) / one.dt)
    return float(np.mean(found[0] - found[1]))


def row(hold: int, way: str, seed: int, folder: str) -> dict[str, Any]:
    words = ("experiment=limo", f"runs_dir={folder}", f"seed={seed}", f"collect.hold={hold}", *WAYS[way])
    words = (*words, f"gp.n_train={100 * hold}")
    request = Request(resolve(list(words), None), words)
    for stage in (collect.STAGE, residual_stage.STAGE):
        stage.make(request)
    fitted, _ = fit_gp.STAGE.make(request)
    plant = corrected_plant(request.having(prediction="mean"), fitted.path)
    own = residual_stage.read_residuals(residual_stage.STAGE.need(request))
    return {
        "hold": hold,
        "way": way,
        "sweep": errors(plant, own),
        "drives": errors(plant, fresh_drives(request)),
        "bias": bias(plant, request),
    }


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--holds", type=int, nargs="+", default=[30, 60, 100])
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path)
    arguments = parser.parse_args()
    print("hold  rows       NRMSE on the sweep: v, w     on random drives: v, w     bias of |w|")
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for hold in arguments.holds:
            for way in WAYS:
                found = row(hold, way, arguments.seed, folder)
                rows.append(found)
                own, drives = found["sweep"], found["drives"]
                print(
                    f"{hold:4}  {way:9}  {own['v']:12.2%} {own['w']:9.2%} {drives['v']:16.2%} {drives['w']:8.2%}"
                    f" {found['bias']:15.4f} rad/s",
                    flush=True,
                )
    if arguments.out:
        arguments.out.write_text(json.dumps(rows, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
