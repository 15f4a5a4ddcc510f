"""Why some policies that never saw friction go on balancing on the target: what they make of the cart's speed.

A cart-pole policy pushes right where theta + a theta_dot + b x + c x_dot > 0. First such lines themselves, c swept:
mean return in the simulator and on both targets. Then, with --runs, every policy of finished loops, with the default
settings, that never saw the target: b and c of the line that fits what it does in the simulator (least squares on
the difference of its logits), beside its return on the target; and the rank correlation of c and return.

python benchmarks/cart_speed_weight.py [--runs runs] [--starts 200]
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import argparse
import json
from pathlib import Path

import numpy as np
from gpsim.cli.configuration import resolve
from scipy.stats import spearmanr

from gpsim.channels import FloatArray
from gpsim.environments import Act, Episodes
from gpsim.evaluation import episode_returns
from gpsim.policies import Policy
from gpsim.simulators import Plant
from gpsim.stages.building import base_plant, make_task, target_plant
from gpsim.stages.policy_files import read_policy
from gpsim.tasks import Start

CONFIG = resolve(["experiment=cartpole"], None)
TASK = make_task(CONFIG)
PLANTS: dict[str, Plant] = {
    "simulator": base_plant(CONFIG),
    "target": target_plant(CONFIG),
    "sticking target": target_plant(resolve(["experiment=cartpole", "target=sticking"], None)),
}
RATE, POSITION = 0.25, (0.1, 0.2, 0.3)  # s and rad/m: what trained policies have
SPEED = (0.05, 0.10, 0.125, 0.15, 0.175, 0.20, 0.225, 0.25, 0.30, 0.40)  # rad/(m/s)
SETTLED, LAST = 100, 300  # steps in the simulator between which a policy's line is fitted


def line(position: float, speed: float) -> Act:
    """Push right where the line is positive."""
    normal = np.array([position, speed, 1.0, RATE], dtype=np.float32)
    return lambda observations: (observations @ normal > 0).astype(np.int64)


def mean_return(plant: Plant, act: Act, start: Start) -> float:
    return float(episode_returns(plant, TASK, act, start, np.random.default_rng(0)).mean())


def weights(policy: Policy, start: Start) -> tuple[float, float]:
    """b [rad/m] and c [rad/(m/s)]: of the line through the logits' difference where the policy keeps to."""
    running = Episodes(PLANTS["simulator"], TASK, len(start.states), np.random.default_rng(0))
    observations, seen = running.begin(start), []
    for step in range(LAST):
        if step >= SETTLED:
            seen.append(observations)
        running.step(policy.act(observations))
        observations = running.observe()
    inputs = np.concatenate(seen)
    logits = policy.logits(inputs)
    columns = np.column_stack([inputs, np.ones(len(inputs))]).astype(np.float64)
    fitted: FloatArray = np.linalg.lstsq(columns, (logits[:, 1] - logits[:, 0]).astype(np.float64))[0]
    return float(fitted[0] / fitted[2]), float(fitted[1] / fitted[2])


def trained(runs: Path, start: Start) -> dict[str, FloatArray]:
    """(seeds, 3) b, c and return of every policy that `train-source` made without seeing the target."""
    found: dict[str, list[tuple[int, float, float, float]]] = {"source": [], "randomised": []}
    for manifest in sorted(runs.glob("cartpole/train-source/v*/manifest.json")):
        made = json.loads(manifest.read_text(encoding="utf-8"))
        variant, config = made["config"]["variant"], made["config"]
        if variant not in found or any(config[key] != CONFIG[key] for key in ("policy", "simulator", "task")):
            continue
        policy = read_policy(manifest.parent)
        earned = mean_return(PLANTS["target"], policy.act, start)
        found[variant].append((int(made["seeds"]["seed"]), *weights(policy, start), earned))
    return {variant: np.array([row[1:] for row in sorted(rows)]) for variant, rows in found.items() if rows}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--runs", type=Path)
    parser.add_argument("--starts", type=int, default=200)
    arguments = parser.parse_args()
    start = TASK.start(arguments.starts, np.random.default_rng(12345))
    print("Mean return of a switching line, weight of the cart's speed c [rad/(m/s)] and position b [rad/m]")
    print(f"{'b':>5} {'c':>6} " + " ".join(f"{name:>15}" for name in PLANTS))
    for position in POSITION:
        for speed in SPEED:
            earned = [mean_return(plant, line(position, speed), start) for plant in PLANTS.values()]
            print(f"{position:5.2f} {speed:6.3f} " + " ".join(f"{value:15.0f}" for value in earned))
    if arguments.runs is None:
        return
    found = trained(arguments.runs, start)
    for variant, rows in found.items():
        means, spread = rows.mean(axis=0), rows.std(axis=0)
        print(
            f"{variant}: b {means[0]:.2f} +- {spread[0]:.2f}, c {means[1]:.3f} +- {spread[1]:.3f}, "
            f"return {means[2]:.0f} +- {spread[2]:.0f} over {len(rows)} seeds; c and return of each: "
            + ", ".join(f"{c:.2f} {earned:.0f}" for _, c, earned in rows)
        )
    if found:
        both = np.concatenate(list(found.values()))
        rank = spearmanr(both[:, 1], both[:, 2]).statistic
        print(f"rank correlation of c and return: {rank:.2f}, n = {len(both)}")


if __name__ == "__main__":
    main()
