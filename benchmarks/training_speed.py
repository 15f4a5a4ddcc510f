"""Is the correction free? PPO in the GP environment beside PPO in the plain one, alternating in one process.

PPO, the Gaussian processes' inputs and their number of rows are what `gpsim train-gp-policy experiment=cartpole` takes.

python benchmarks/training_speed.py [--steps 20480] [--repeats 5]
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import argparse
import json
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from gpsim.cli.configuration import resolve

from gpsim.corrected import CorrectedPlant, Features, GpCorrection
from gpsim.environments import BatchedEnv, collect_episodes, random_actor
from gpsim.gp import FitSettings, Predictor, fit_outputs
from gpsim.policies.training.ppo import train_ppo
from gpsim.recordings import Recording
from gpsim.residuals import build_residuals
from gpsim.simulators import Plant, SimulatorPlant, make_simulator
from gpsim.stages.building import training_settings
from gpsim.stages.fit_gp import input_names
from gpsim.stages.stage import Request
from gpsim.targets import FrictionCartPole
from gpsim.tasks import Balance

REQUEST = Request(resolve(["experiment=cartpole"], None))


def plants(n_train: int) -> dict[str, Plant]:
    simulator, rng = make_simulator("cartpole"), np.random.default_rng(0)
    parameters, task = simulator.defaults(), Balance()
    episodes = collect_episodes(
        FrictionCartPole(parameters, 0.9, 0.02), task, random_actor(task, rng), 60, rng
    )
    recording = Recording("cartpole", simulator.state, simulator.action, episodes, 0.02)
    data = build_residuals(recording, simulator, parameters, "euler", test_fraction=0.0, rng=rng)
    features, rows = Features.of(input_names(REQUEST), data.channels), data.training_rows(n_train)
    gps = fit_outputs(features(data.inputs[rows]), data.values[rows], FitSettings(restarts=0), rng)
    predictor = Predictor(gps)
    found: dict[str, Plant] = {"plain": SimulatorPlant(simulator, parameters, "euler", 0.02)}
    for prediction in ("mean", "sample"):
        correction = GpCorrection(predictor, features, prediction, True)
        found[prediction] = CorrectedPlant(simulator, parameters, "euler", 0.02, correction)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--steps", type=int, default=20_480)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--n-train", type=int, default=int(REQUEST.config["gp"]["n_train"]))
    parser.add_argument("--out", type=Path)
    arguments = parser.parse_args()
    candidates = plants(arguments.n_train)
    settings = replace(training_settings(REQUEST.config), total_steps=arguments.steps)
    seconds: dict[str, list[float]] = {name: [] for name in candidates}
    for repeat in range(arguments.repeats + 1):  # the first round warms up
        for name, plant in candidates.items():
            env = BatchedEnv(plant, Balance(), 10, seed=repeat)
            started = time.process_time()
            train_ppo(env, settings, repeat, lambda done, total, note: None)
            if repeat:
                seconds[name].append(time.process_time() - started)
    result = {}
    for name, values in seconds.items():
        ratio = np.array(values) / np.array(seconds["plain"])
        result[name] = {"seconds": float(np.median(values)), "ratio": float(np.median(ratio))}
        print(
            f"{name:>7}: {np.median(values):6.2f} processor s for {arguments.steps} steps, "
            f"{np.median(ratio):.3f} of plain ({ratio.min():.3f} to {ratio.max():.3f})"
        )
    if arguments.out:
        arguments.out.write_text(json.dumps(result, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
