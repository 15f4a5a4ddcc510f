"""Which recordings teach a Gaussian process the friction well enough for the hardest starts?

Where the pole falls the way the cart moves, a rescue on the chattering target passes windows of speed of 0.01 m/s: a
simulator that is a little beside it lets the cart turn round a step early or late. A search rescues such starts of the
tuning starts on the target; its pushes are then played in simulators corrected by the GPs' mean, each fitted to a
recording of another driver. Shown are the share of rescues whose cart moves the same way in each of the first 15
steps, the share whose pole is still up after 25, and the errors of one step along them.

python benchmarks/manoeuvre_recordings.py [--seeds 60 61 62] [--n-train 250 500] [--drivers random]
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import argparse
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from gpsim.cli.configuration import resolve

from gpsim.channels import Channels, FloatArray, IntArray
from gpsim.corrected import CorrectedPlant, Features, GpCorrection
from gpsim.environments import Act, BatchedEnv, collect_episodes, dithered_actor, policy_actor, random_actor
from gpsim.gp import Predictor, fit_outputs
from gpsim.policies import Beam, Policy
from gpsim.policies.training.ppo import train_ppo
from gpsim.recordings import Recording
from gpsim.residuals import Residuals, build_residuals
from gpsim.simulators import Memory, Plant
from gpsim.stages.building import base_plant, expert_search, make_task, target_plant, training_settings
from gpsim.stages.fit_gp import fit_settings, input_names
from gpsim.stages.stage import Request

REQUEST = Request(resolve(["experiment=cartpole", "policy=expert"], None))
TASK, BASE, TARGET = make_task(REQUEST.config), base_plant(REQUEST.config), target_plant(REQUEST.config)
WIDTH, SEARCHED = 96, 40  # states kept, and steps
TURNS, UP = 15, 25  # steps compared for their sign, and survived
LEAN = 0.03  # rad of the unstable mode, from which a start counts as hard
DRIVERS = ("source", "dithered", "random")


@dataclass(frozen=True)
class Diary:
    """A plant that notes in its memory which pushes led to a state."""

    plant: Plant
    step_number: int = 0

    @property
    def state(self) -> Channels:
        return self.plant.state

    def step(
        self, state: FloatArray, action: FloatArray, memory: Memory, rng: np.random.Generator
    ) -> FloatArray:
        memory["pushes"][:, self.step_number] = action[:, 0]
        return self.plant.step(state, action, {}, rng)


def rescues() -> tuple[FloatArray, FloatArray]:
    """Hard starts (N, 4) that the search rescues on the target, and its pushes (N, SEARCHED) [N]."""
    starts = TASK.start(400, np.random.default_rng(12345)).states
    search, rng = expert_search(REQUEST.config, WIDTH), np.random.default_rng(0)
    parameters = BASE.parameters
    omega = np.sqrt(parameters["gravity"] / (4.0 / 3.0 * parameters["pole_half_length"]))
    mode = starts[:, 2] + starts[:, 3] / omega
    starts = starts[(mode * starts[:, 1] > 0) & (np.abs(mode) > LEAN)]
    beam = Beam(starts.copy(), {"pushes": np.zeros((len(starts), SEARCHED))}, np.arange(len(starts)))
    for step in range(SEARCHED):
        diary = Diary(TARGET, step)
        beam = search.grown(diary, TASK, beam, np.empty((len(starts), 0)), rng)  # type: ignore[arg-type]
    best: dict[int, int] = {}
    for row in np.argsort(search.cost(beam.states)).tolist():
        best.setdefault(int(beam.owner[row]), row)
    owners = sorted(best)
    return starts[owners], beam.memory["pushes"][[best[owner] for owner in owners]]


@cache
def source_policy(seed: int) -> Policy:
    """PPO's in the simulator, on the observations of `policy=expert`."""
    settings = replace(training_settings(REQUEST.config), expert_rounds=0)  # type: ignore[type-var]
    return train_ppo(BatchedEnv(BASE, TASK, 10, seed), settings, seed, lambda *_: None)[0]  # type: ignore[arg-type]


def driver(name: str, seed: int, rng: np.random.Generator) -> Act:
    """What `collect.policy=NAME` drives with."""
    if name == "random":
        return random_actor(TASK, rng)
    actor = policy_actor(source_policy(seed), rng)
    return dithered_actor(actor, TASK, 0.3, rng) if name == "dithered" else actor


def recorded(act: Act, rng: np.random.Generator) -> Residuals:
    """Residuals of 20 episodes on the target."""
    episodes = collect_episodes(TARGET, TASK, act, 20, rng)
    recording = Recording("cartpole", BASE.state, BASE.action, episodes, BASE.dt)
    return build_residuals(
        recording, BASE.simulator, BASE.parameters, BASE.integrator, test_fraction=0.2, rng=rng
    )


def corrected(data: Residuals, count: int, rng: np.random.Generator) -> CorrectedPlant:
    """The simulator corrected by the mean of GPs on `count` of the recorded transitions."""
    features, rows = Features.of(input_names(REQUEST), data.channels), data.training_rows(count)
    gps = fit_outputs(features(data.inputs[rows]), data.values[rows], fit_settings(REQUEST), rng)
    correction = GpCorrection(Predictor(gps), features, "mean", True)
    return CorrectedPlant(BASE.simulator, BASE.parameters, BASE.integrator, BASE.dt, correction)


def played(plant: Plant, starts: FloatArray, pushes: FloatArray) -> FloatArray:
    """(steps + 1, N, 4) states under the pushes."""
    states, rng = [starts], np.random.default_rng(0)
    for column in pushes.T:
        states.append(plant.step(states[-1], column[:, None], {}, rng))
    return np.array(states)


def alike(model: Plant, true: FloatArray, pushes: FloatArray) -> tuple[float, float, float, float]:
    """Shares of the rescues that turn alike and that stay up; one step's errors [m/s], root mean square and largest."""
    found = played(model, true[0], pushes)
    turns = np.all(np.sign(found[: TURNS + 1, :, 1]) == np.sign(true[: TURNS + 1, :, 1]), axis=0)
    up = np.all(np.abs(found[: UP + 1, :, 2]) <= TASK.angle_limit, axis=0)  # type: ignore[attr-defined]
    before: FloatArray = true[:TURNS].reshape(-1, 4)
    action = pushes[:, :TURNS].T.reshape(-1, 1)
    after = model.step(before, action, {}, np.random.default_rng(0))
    errors = np.abs(after[:, 1] - true[1 : TURNS + 1].reshape(-1, 4)[:, 1])
    return float(turns.mean()), float(up.mean()), float(np.sqrt(np.mean(errors**2))), float(errors.max())


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", type=int, nargs="+", default=[60, 61, 62])
    parser.add_argument("--n-train", type=int, nargs="+", default=[250, 500])
    parser.add_argument("--drivers", nargs="+", choices=DRIVERS, default=DRIVERS)
    arguments = parser.parse_args()
    starts, pushes = rescues()
    true = played(TARGET, starts, pushes)
    kinds: IntArray = np.sign(true[: TURNS + 1, :, 1]).astype(np.int64)
    print(f"{len(starts)} hard starts rescued; {np.mean(np.diff(kinds, axis=0) != 0) * TURNS:.1f} turns each")
    print(
        f"{'driver':>9} {'seed':>5} {'rows':>10} {'turn alike':>11} {'stay up':>8} {'error rms, largest [m/s]':>26}"
    )
    for name in arguments.drivers:
        for seed in arguments.seeds:
            rng = np.random.default_rng(seed)
            data = recorded(driver(name, seed, rng), rng)
            for count in arguments.n_train:
                rows = len(data.training_rows(count))
                turns, up, error, worst = alike(corrected(data, count, rng), true, pushes)
                print(
                    f"{name:>9} {seed:5d} {rows:4d} of {len(data.values):4d} {turns:11.3f} {up:8.3f} "
                    f"{error:14.1e} {worst:11.1e}",
                    flush=True,
                )


if __name__ == "__main__":
    main()
