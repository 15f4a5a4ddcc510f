"""What policies that never see the target earn there as they are trained, before and after they solve their simulator.

PPO in the simulator (source) and in the one of domain randomisation (randomised), as the loop trains them; before
every update the most probable actions are tried on 200 starts of the training simulator and on the 400 tuning starts
of the target. Shown are the steps after which the first policy lasts on all of the 200, and the mean return on the
target then, at some steps on the way, and at the end.

python benchmarks/drift_once_solved.py [--seeds 48 49 50 51 52]
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import argparse

import numpy as np
from gpsim.cli.configuration import resolve

from gpsim.channels import FloatArray
from gpsim.environments import BatchedEnv
from gpsim.evaluation import episode_returns
from gpsim.policies import Policy
from gpsim.policies.training.ppo import train_ppo
from gpsim.policies.training.settings import PpoSettings
from gpsim.simulators import Plant
from gpsim.stages.building import base_plant, make_task, randomised_plant, target_plant, training_settings
from gpsim.stages.stage import derived_seed

CONFIG = resolve(["experiment=cartpole"], None)
TASK, TARGET = make_task(CONFIG), target_plant(CONFIG)
PLANTS: dict[str, Plant] = {"source": base_plant(CONFIG), "randomised": randomised_plant(CONFIG)}
OWN = TASK.start(200, np.random.default_rng(777))
TUNING = TASK.start(400, np.random.default_rng(12345))
SHOWN = (50_000, 75_000, 100_000, 150_000, 200_000, 250_000)


def followed(variant: str, seed: int) -> FloatArray:
    """(updates, 3): steps, lowest return on the training simulator, mean return on the target."""
    settings, rows = training_settings(CONFIG), []
    assert isinstance(settings, PpoSettings)

    def watch(steps: int, policy: Policy) -> None:
        own = episode_returns(PLANTS[variant], TASK, policy.act, OWN, np.random.default_rng(5))
        earned = episode_returns(TARGET, TASK.on_target(), policy.act, TUNING, np.random.default_rng(5))
        rows.append((steps, own.min(), earned.mean()))

    places, weights = (
        derived_seed(seed, f"train-source/{variant}/{part}") for part in ("environment", "policy")
    )
    env = BatchedEnv(PLANTS[variant], TASK, settings.n_envs, places)
    train_ppo(env, settings, weights, lambda *_: None, watch)
    return np.array(rows)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", type=int, nargs="+", default=[48, 49, 50, 51, 52])
    seeds = parser.parse_args().seeds
    print(f"{'trained in':>10} {'seed':>5} {'solved after':>13} {'earns then':>11}", end="")
    print("".join(f"{steps // 1000:>5d} k" for steps in SHOWN) + f"{'end':>7}")
    for variant in PLANTS:
        for seed in seeds:
            rows = followed(variant, seed)
            solved = rows[rows[:, 1] >= TASK.max_steps]
            first = f"{solved[0, 0]:13.0f} {solved[0, 2]:11.0f}" if len(solved) else f"{'never':>13} {'':>11}"
            way = [rows[np.abs(rows[:, 0] - steps).argmin(), 2] for steps in SHOWN]
            print(
                f"{variant:>10} {seed:5d} {first}"
                + "".join(f"{earned:7.0f}" for earned in [*way, rows[-1, 2]])
            )


if __name__ == "__main__":
    main()
