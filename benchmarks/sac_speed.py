"""Steps and seconds of soft actor-critic to 95 % success on the Limo's source task: our settings beside the library's.

python benchmarks/sac_speed.py [--seeds 3] [--limit 600] [--only defaults]

All train on one core (seconds are the processor's), with the same evaluation (200 starts, most probable actions at
every control step), whose time counts. `ours` is conf/policy/sac.yaml; `defaults` is stable-baselines3's SAC as it
comes, on one environment. The variants behind them change one setting of ours each, to show what the speed comes from.
A run ends at 95 % success or at the limit of seconds.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import argparse
import json
import time
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from gpsim.cli.configuration import resolve

from gpsim.environments import BatchedEnv
from gpsim.policies.training.sac import train_sac
from gpsim.policies.training.settings import SacSettings
from gpsim.stages.building import base_plant, make_task, training_settings

GOAL = 0.95


class ReachedError(Exception):
    """Enough is enough."""


def settings() -> dict[str, SacSettings]:
    ours = training_settings(resolve(["experiment=limo"], None))
    assert isinstance(ours, SacSettings)
    ours = replace(ours, total_steps=10_000_000)
    defaults = SacSettings(
        total_steps=10_000_000, n_envs=1, gradient_steps=1, batch_size=256, buffer_size=1_000_000, learning_starts=100,
        learning_rate=3e-4, anneal=False, gamma=0.99, tau=0.005, action_repeat=1, initial_entropy=1.0,
        target_entropy=-2.0, hidden=(256, 256), checkpoint_every=5000,
    )  # fmt: skip
    return {
        "ours": replace(ours, anneal=False),
        "defaults": defaults,
        "no repeat": replace(ours, anneal=False, action_repeat=1, gamma=0.995),
        "unscaled observation": replace(ours, anneal=False, observation_scale=()),
    }


def run(chosen: SacSettings, seed: int, limit: float) -> tuple[float, float, float]:
    """(decisions, control steps, seconds) until success, infinite where the limit came first."""
    config = resolve(["experiment=limo"], None)
    plant, task = base_plant(config), make_task(config)
    started = time.process_time()
    found = float("inf"), float("inf"), float("inf")

    def progress(done: int, total: int, note: str) -> None:
        nonlocal found
        seconds = time.process_time() - started
        if float(note.split()[1].rstrip(",")) >= GOAL:
            found = float(done), float(done * chosen.action_repeat), seconds
            raise ReachedError
        if seconds > limit:
            raise ReachedError

    env = BatchedEnv(plant, task, chosen.n_envs, seed, chosen.action_repeat)
    with suppress(ReachedError):
        train_sac(env, chosen, seed, progress)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--limit", type=float, default=600.0)
    parser.add_argument("--only", choices=[*settings()], help="one of the variants")
    parser.add_argument("--out", type=Path)
    arguments = parser.parse_args()
    result: dict[str, list[tuple[float, float, float]]] = {}
    for name, chosen in settings().items():
        if arguments.only not in (None, name):
            continue
        result[name] = [run(chosen, seed, arguments.limit) for seed in range(arguments.seeds)]
        for seed, (decisions, steps, seconds) in enumerate(result[name]):
            said = f"{decisions:8.0f} decisions, {steps:8.0f} control steps, {seconds:5.0f} s"
            print(
                f"{name:>20}, seed {seed}: {said if seconds < float('inf') else 'not within the limit'}",
                flush=True,
            )
    if arguments.out:
        arguments.out.write_text(json.dumps(result, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
