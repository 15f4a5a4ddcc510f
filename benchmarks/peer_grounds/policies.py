"""Policies that are trained in what a recording taught a simulator, and driven on the target.

CartPole (PPO) and Limo (SAC) as in `gpsim run full-loop`. Every peer is given the same recording of the target, the
same simulator, the same number of training steps (SHARE of the experiment's; GPSIM_TRAINING_SHARE says another) with
the same algorithm, settings and seeds of network and environment, and is judged by the same starts:

- domain randomisation: every episode draws each parameter and gain within +-10 % (the experiment's setting, which is
  the thesis's; Tobin et al. 2017, arXiv:1703.06907);
- tuned parameters: the simulator's parameters and a gain of every action, by least squares of one-step rates;
- delta action: a network adds to the action what makes the simulator follow the recording, and the policy is trained
  in that simulator (ASAP, He et al. 2025, arXiv:2502.01143). There a policy of its own is trained to find the added
  action; here, where a step of the simulator is cheap to invert, each transition's best added action is solved for and
  the network regresses on it. It sees what the Gaussian process sees, and the last commands where the robot is late;
- a Gaussian process alone: the thesis's correction, sampled, with the experiment's inputs, delays and lags;
- gpsim: the effects that the diagnosis named, and the Gaussian process on the rest where the diagnosis keeps one; and
  the same with sizes of the effects that are drawn anew for every episode from what the diagnosis leaves open.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from gpsim.cli.configuration import resolve
from numpy.typing import NDArray
from scipy.optimize import least_squares

from gpsim.corrected import Features
from gpsim.corrected.command_filter import mean_rates
from gpsim.environments import policy_actor
from gpsim.evaluation import episode_returns
from gpsim.evaluation.returns import bootstrap_interval
from gpsim.residuals import Residuals
from gpsim.simulators import Memory, Plant, SimulatorPlant
from gpsim.stages import build_residuals, collect, diagnose_loop, fit_gp, train_gp_policy, train_source
from gpsim.stages.building import base_plant, input_names, make_task, randomised_plant, target_plant
from gpsim.stages.certify import evaluation_starts
from gpsim.stages.diagnose import why_no_gp
from gpsim.stages.policy_files import read_policy
from gpsim.stages.stage import Request, generator
from peer_grounds.contract import Answer, Score

Floats = NDArray[np.float64]
SHARE = {"cartpole": 1.0, "limo": 0.25}  # of the training steps: 300 000 steps and 15 000 decisions
PURPOSE = "peers"  # of the seeds: the same for all peers
PAST = {"cartpole": 0, "limo": 5}  # commands before the present one that the delta action sees
WIDTH, ROUNDS, RATE, PATIENCE = 64, 2000, 5e-3, 200  # of its network: units, steps of Adam, learning rate


@dataclass(frozen=True)
class TunedPlant(SimulatorPlant):
    """A simulator with other parameters, and a gain of every action."""

    gains: Floats

    def step(self, state: Floats, action: Floats, memory: Memory, rng: np.random.Generator) -> Floats:
        return super().step(state, self.gains * action, memory, rng)


def tuned(base: SimulatorPlant, data: Residuals) -> tuple[TunedPlant, dict[str, float]]:
    """The parameters and gains with which the simulator's one-step rates come nearest to the recording's."""
    states, actions = np.split(data.inputs, [len(base.state)], axis=1)
    names, spread = list(base.parameters), np.maximum(data.measured.std(axis=0), 1e-12)

    def made(logs: Floats) -> TunedPlant:
        ratios = np.exp(logs)
        parameters = {n: base.parameters[n] * r for n, r in zip(names, ratios, strict=False)}
        return TunedPlant(base.simulator, parameters, base.integrator, base.dt, ratios[len(names) :])

    def errors(logs: Floats) -> Floats:
        plant = made(logs)
        return ((mean_rates(plant, states, plant.gains * actions) - data.measured) / spread).ravel()

    found = least_squares(errors, np.zeros(len(names) + actions.shape[1]), bounds=(-np.log(5.0), np.log(5.0)))
    ratios = dict(
        zip([*names, *(f"gain of {a}" for a in base.action.names)], np.exp(found.x).tolist(), strict=True)
    )
    return made(found.x), ratios


@dataclass(frozen=True)
class DeltaPlant(SimulatorPlant):
    """A simulator whose actions have a network's output added; it remembers the last commands of each episode."""

    features: Features
    past: int
    layers: tuple[tuple[Floats, Floats], ...]
    scale: tuple[Floats, Floats, Floats]  # of the inputs mean and spread, of the outputs spread

    def begin(self, count: int, rng: np.random.Generator) -> Memory:
        return {"commands": np.zeros((count, self.past, len(self.action)))}

    def step(self, state: Floats, action: Floats, memory: Memory, rng: np.random.Generator) -> Floats:
        sent = memory["commands"]
        seen = np.concatenate(
            [self.features(np.hstack([state, action])), sent.reshape(len(state), -1)], axis=1
        )
        if self.past:
            sent[:] = np.concatenate([action[:, None], sent[:, :-1]], axis=1)
        mean, spread, size = self.scale
        out = (seen - mean) / spread
        for k, (weight, bias) in enumerate(self.layers):
            out = out @ weight.T + bias
            out = np.tanh(out) if k < len(self.layers) - 1 else out
        return super().step(state, action + size * out, memory, rng)


def wanted_actions(base: SimulatorPlant, data: Residuals) -> Floats:
    """(N, A): what would have to be added to each action for the simulator's rates to be the measured ones.

    Gauss-Newton, each rate on the scale of its spread; a little ridge where an action does nothing.
    """
    states, actions = np.split(data.inputs, [len(base.state)], axis=1)
    spread, reach = (
        np.maximum(data.measured.std(axis=0), 1e-12),
        np.maximum(np.abs(actions).max(axis=0), 1e-9),
    )
    added = np.zeros_like(actions)
    for _ in range(3):
        now = mean_rates(base, states, actions + added)
        slope = np.empty((len(states), now.shape[1], actions.shape[1]))
        for a in range(actions.shape[1]):
            moved = actions + added
            moved[:, a] += 1e-4 * reach[a]
            slope[:, :, a] = (mean_rates(base, states, moved) - now) / 1e-4 / spread[:, None].T
        left = (data.measured - now) / spread
        square = np.einsum("nra,nrb->nab", slope, slope) + 1e-6 * np.eye(actions.shape[1])
        added = (
            added + reach * np.linalg.solve(square, np.einsum("nra,nr->na", slope, left)[..., None])[..., 0]
        )
    return added


def delta(
    base: SimulatorPlant, data: Residuals, features: Features, past: int, seed: int
) -> tuple[DeltaPlant, float]:
    """The simulator with the network, and its error on the last fifth of the episodes, of the targets' spread.

    Two layers of 64 units; the weights of the least error on that fifth are kept.
    """
    import torch

    target = wanted_actions(base, data)
    actions = data.inputs[:, len(base.state) :]
    held = np.zeros((len(actions), past, actions.shape[1]))
    for k in range(past):
        behind = np.arange(len(actions)) - k - 1
        same = (behind >= 0) & (data.episode[np.maximum(behind, 0)] == data.episode)
        held[same, k] = actions[behind[same]]
    inputs = np.concatenate([features(data.inputs), held.reshape(len(actions), -1)], axis=1)
    mean, spread, size = (
        inputs.mean(axis=0),
        np.maximum(inputs.std(axis=0), 1e-9),
        np.maximum(target.std(axis=0), 1e-9),
    )
    late = data.episode >= np.quantile(data.episode, 0.8)
    late = late if late.any() and not late.all() else np.arange(len(actions)) >= 0.8 * len(actions)
    torch.manual_seed(seed)
    net = torch.nn.Sequential(
        torch.nn.Linear(inputs.shape[1], WIDTH), torch.nn.Tanh(),
        torch.nn.Linear(WIDTH, WIDTH), torch.nn.Tanh(), torch.nn.Linear(WIDTH, actions.shape[1]),
    )  # fmt: skip
    x, y = (torch.tensor(part, dtype=torch.float32) for part in ((inputs - mean) / spread, target / size))
    train, judged = torch.tensor(~late), torch.tensor(late)
    optimiser = torch.optim.Adam(net.parameters(), lr=RATE)
    best, kept, since = np.inf, None, 0
    for _ in range(ROUNDS):
        optimiser.zero_grad()
        torch.mean((net(x[train]) - y[train]) ** 2).backward()
        optimiser.step()
        with torch.no_grad():
            error = float(torch.mean((net(x[judged]) - y[judged]) ** 2))
        since += 1
        if error < best:
            best, since = error, 0
            kept = [
                (m.weight.detach().numpy().astype(float), m.bias.detach().numpy().astype(float))
                for m in net
                if hasattr(m, "weight")
            ]
        if since > PATIENCE:
            break
    assert kept is not None
    plant = DeltaPlant(
        base.simulator,
        base.parameters,
        base.integrator,
        base.dt,
        features,
        past,
        tuple(kept),
        (mean, spread, size),
    )
    return plant, float(np.sqrt(best))


def prepared(request: Request) -> None:
    """The recording and all that is learnt of it: made once for all peers of a seed."""
    if collect.waits_for_policy(request):
        train_source.STAGE.make(request.having(variant="source"))
    for stage in (collect.STAGE, build_residuals.STAGE, fit_gp.STAGE, diagnose_loop.STAGE):
        stage.make(request)


def plant_of(request: Request, task: str, peer: str) -> tuple[Plant, dict[str, Any]]:
    """The simulator that a peer trains in, and what is to be said of it."""
    base = base_plant(request.config)
    data = build_residuals.read_residuals(build_residuals.STAGE.need(request))
    if peer == "domain-randomisation":
        return randomised_plant(request.config), {"spread": request.config["randomise"]["spread"]}
    if peer == "tuned-parameters":
        plant, ratios = tuned(base, data)
        return plant, {"ratios": ratios}
    if peer == "delta-action":
        features = Features.of(input_names(request), data.channels)
        made, error = delta(base, data, features, PAST[task], request.seed)
        return made, {"held-out error of the added action": error}
    if peer == "gpsim-gp":
        return train_gp_policy.corrected_plant(request, fit_gp.STAGE.need(request).path), {}
    found = diagnose_loop.STAGE.need(request)
    why = why_no_gp(found.path)
    asked = request.having(correction="effects" if why else "effects+gp")
    said: dict[str, Any] = {"account": diagnose_loop.sentences(found), "no Gaussian process": why}
    if peer == "gpsim-posterior":
        return train_gp_policy.posterior_plant(asked, found), said
    return train_gp_policy.effects_plant(asked, found), said


def request_of(task: str, seed: int, loop: Path) -> Request:
    """The experiment at a share of its training steps, the policy that drives the recording included."""
    share = float(os.environ.get("GPSIM_TRAINING_SHARE", SHARE[task]))
    steps = round(resolve([f"experiment={task}"], None)["policy"]["total_steps"] * share)
    words = [f"experiment={task}", f"seed={seed}", f"runs_dir={loop}", f"policy.total_steps={steps}"]
    return Request(resolve(words, None), tuple(words))


def trained(task: str, peer: str, seed: int, folder: Path) -> Answer:
    """What a policy that a peer's simulator taught earns on the target, from every start."""
    request = request_of(task, seed, folder.parent / "loop")
    prepared(request)
    plant, about = plant_of(request, task, peer)
    goal, start = make_task(request.config), evaluation_starts(request)
    train_source.train(request, plant, goal, PURPOSE, folder)
    act = policy_actor(read_policy(folder))
    rng = generator(request.start_seed, "evaluate/returns")
    returns = episode_returns(target_plant(request.config), goal.on_target(), act, start, rng)
    own = episode_returns(plant, goal, act, start, generator(request.start_seed, "evaluate/own"))
    low, high = bootstrap_interval(returns[None], lambda r: float(r.mean()))
    scores = {
        "return": Score(float(returns.mean()), "", low, high, 0.95),
        "in its own simulator": Score(float(own.mean())),
    }
    steps = int(request.config["policy"]["total_steps"])
    details = {"returns": [round(float(r), 2) for r in returns], "training steps": steps, **about}
    return Answer(scores, tuple(about.get("account", ())), details=details)
