"""Expert iteration: a policy learns from an expert that looks ahead from where the policy itself comes by.

Anthony, Tian and Barber (2017), "Thinking fast and slow with deep learning and tree search", arXiv:1705.08439; the
data are gathered as in DAgger (Ross, Gordon and Bagnell 2011, arXiv:1011.0686), mistakes weigh what they cost (Ross and
Bagnell 2014, arXiv:1406.5979). The expert knows the simulator, not the target.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from gpsim.channels import FloatArray
from gpsim.environments import Episodes
from gpsim.policies import FAILS, Expert, Policy, Visited
from gpsim.policies.training.sb3 import event_log, note
from gpsim.policies.training.settings import Checkpoints, PpoSettings, Progress
from gpsim.simulators import Memory, Plant

EPISODES = 3000  # that a policy plays in each round
FAILED = 300  # episodes that ended early of which it is asked whether they had to:
FORESIGHT = (
    100  # steps, at least, that the expert looks ahead then; a fall from a hopeless start comes sooner
)
BEGINNING, END = 20, 60  # first and last steps that are looked at of an episode that need not have failed,
ANYWHERE = 25  # and of all episodes every so many steps,
ANYHOW = 1 / 3  # the share of these at least
EPOCHS, BATCH, LEARNING_RATE = 20, 512, 2e-3
UNSURE = 0.03  # difference of two actions' costs below which it says nothing: a critic's judgements scatter as much
MOST, TINY = 0.5, 1e-9  # that a mistake weighs, and that all weigh on average at least
FOLLOWED = 0.01  # weight of doing as the first policy did, where the expert sees no difference
FINALISTS, AGAIN = 5, 2  # rounds that play so many times more: their scores differ by less than chance does


@dataclass(frozen=True)
class _Round:
    """What a policy did: alive (T, N) before each step, and the states, observations and memories (T, N, .) then.

    length, score, lasted: (N,) steps of each episode, its return, and whether nothing ended it.
    """

    alive: NDArray[np.bool_]
    states: FloatArray
    observations: NDArray[np.float32]
    memories: list[Memory]
    context: FloatArray
    length: NDArray[np.int64]
    score: FloatArray
    lasted: NDArray[np.bool_]

    def visited(self, steps: NDArray[np.int64], episodes: NDArray[np.int64]) -> Visited:
        """Some of the states; both (M,)."""
        memory = {
            key: np.stack([self.memories[k][key][i] for k, i in zip(steps, episodes, strict=True)])
            for key in self.memories[0]
        }
        return Visited(
            self.states[steps, episodes], memory, self.context[episodes], self.observations[steps, episodes]
        )


def improved(
    policy: Policy,
    plant: Plant,
    expert: Expert,
    settings: PpoSettings,
    seed: int,
    progress: Progress,
    events: Path | None = None,
) -> tuple[Policy, Checkpoints]:
    """The policy of the round of expert iteration that did best on fresh starts in `plant`, and all rounds' scores.

    Same seed, same bytes: one torch thread, draws from generators of its own. events: a folder for event files, whose
    steps are rounds.
    """
    torch.set_num_threads(1)
    rng, shuffle = np.random.default_rng(seed), torch.Generator().manual_seed(seed)
    learner = _Learner(policy, shuffle)
    observed: list[NDArray[np.float32]] = []
    costs: list[FloatArray] = []
    rows: list[tuple[int, float, float, float]] = []
    policies, at = [policy], policy
    with event_log(events) as log:
        for turn in range(settings.expert_rounds + 1):
            done = _played(at, plant, expert, rng)
            said = (len(observed) * settings.expert_states, float(done.score.mean()))
            rows.append((*said, float(done.lasted.mean()), float(done.length.mean())))
            note(log, score=said[1], lasting=rows[-1][2], length=rows[-1][3])
            log.dump(turn)
            progress(turn, settings.expert_rounds, f"expert iteration: {rows[-1][2]:.1%} of episodes last")
            if turn == settings.expert_rounds or done.lasted.all():
                break
            visited = done.visited(*_looked_at(done, settings.expert_states, expert, rng))
            observed.append(visited.observations)
            costs.append(expert.costs(visited, rng))
            at = learner.learn(np.concatenate(observed), np.concatenate(costs))
            policies.append(at)
    found = Checkpoints(*map(np.array, zip(*rows, strict=True)))
    finalists = np.argsort(-found.score, kind="stable")[:FINALISTS]
    return _best([policies[i] for i in finalists], plant, expert, rng), found


def _best(policies: list[Policy], plant: Plant, expert: Expert, rng: np.random.Generator) -> Policy:
    """The one whose mean return is highest over further fresh starts, the same for all."""
    seed = int(rng.integers(2**32))

    def score(policy: Policy) -> float:
        fresh = np.random.default_rng(seed)
        return sum(float(_played(policy, plant, expert, fresh).score.mean()) for _ in range(AGAIN))

    return max(policies, key=score)


def _played(policy: Policy, plant: Plant, expert: Expert, rng: np.random.Generator) -> _Round:
    """Episodes on fresh starts, by the most probable actions."""
    running = Episodes(plant, expert.task, EPISODES, rng)
    observations, context = running.begin(), running.context.copy()  # a restart draws another
    alive, score = np.ones(EPISODES, dtype=np.bool_), np.zeros(EPISODES)
    length = np.full(EPISODES, expert.task.max_steps)
    seen: dict[str, list[Any]] = {"alive": [], "states": [], "observations": [], "memories": []}
    for k in range(expert.task.max_steps):
        for key, value in (("alive", alive), ("states", running.states), ("observations", observations)):
            seen[key].append(value.copy())
        seen["memories"].append({key: values.copy() for key, values in running.memory.items()})
        rewards, terminated, _ = running.step(policy.act(observations))
        score += np.where(alive, rewards, 0.0)
        length[alive & terminated] = k + 1
        alive = alive & ~terminated
        if not alive.any():
            break
        running.restart(terminated)  # what falls on would leave the range of numbers; nobody looks there
        observations = running.observe()
    stacked = {key: np.stack(seen[key]) for key in ("alive", "states", "observations")}
    return _Round(
        **stacked,
        memories=seen["memories"],
        context=context,
        length=length,
        score=score,
        lasted=alive,
    )


def _looked_at(
    done: _Round, most: int, expert: Expert, rng: np.random.Generator
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Steps and episodes (M,), M at most `most`: how episodes that need not have failed did, and a little of all."""
    step = np.arange(len(done.alive))[:, None]
    left = done.length[None] - step
    near = np.zeros_like(done.alive)
    near[:, _needless(done, expert, rng)] = True
    near &= ((step < BEGINNING) | (left <= END)) & done.alive
    chosen = _drawn(near, most - round(ANYHOW * most), rng)
    others = _drawn((step % ANYWHERE == 0) & done.alive & ~near, most - len(chosen[0]), rng)
    return np.concatenate([chosen[0], others[0]]), np.concatenate([chosen[1], others[1]])


def _drawn(
    table: NDArray[np.bool_], most: int, rng: np.random.Generator
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Row and column of at most so many places that are True."""
    rows, columns = np.nonzero(table)
    chosen = rng.permutation(len(rows))[:most]
    return rows[chosen], columns[chosen]


def _needless(done: _Round, expert: Expert, rng: np.random.Generator) -> NDArray[np.int64]:
    """Episodes that failed though the expert, from where they began, would not have; no more than FAILED are judged.

    Late in the training nearly all that fail had to. What they came by would crowd out the few mistakes that are left.
    """
    failed = rng.permutation(np.flatnonzero(~done.lasted))[:FAILED]
    began = done.visited(np.zeros_like(failed), failed)
    costs = replace(expert, horizon=max(FORESIGHT, expert.horizon)).costs(began, rng)
    return np.asarray(failed[costs.min(axis=1) < FAILS])


def _mistakes(costs: FloatArray) -> FloatArray:
    """(N,): what the second best action costs more than the best.

    Nothing where that is less than the expert is sure of, or where every sequence fails: how soon is of no use.
    """
    order = np.sort(costs, axis=1)
    return np.where(order[:, 0] < FAILS, np.clip(order[:, 1] - order[:, 0] - UNSURE, 0.0, MOST), 0.0)


class _Learner:
    """The policy's network, taught what the expert would do; `learn` goes on from what was learnt before."""

    def __init__(self, first: Policy, shuffle: torch.Generator) -> None:
        self._first, self._shuffle = first, shuffle
        layers: list[torch.nn.Module] = []
        for i in range(first.layers):
            weight, bias = first.weights[f"layer.{i}.weight"], first.weights[f"layer.{i}.bias"]
            linear = torch.nn.Linear(weight.shape[1], weight.shape[0])
            linear.load_state_dict({"weight": torch.tensor(weight), "bias": torch.tensor(bias)})
            layers += [linear, torch.nn.Tanh()]
        self._network = torch.nn.Sequential(*layers[:-1])

    def learn(self, observations: NDArray[np.float32], costs: FloatArray) -> Policy:
        """The policy after some epochs on all that was gathered: observations (N, O), costs of actions (N, A)."""
        weight = _mistakes(costs)
        scale = max(float(weight.mean()), TINY)
        inputs = torch.tensor(observations / self._first.scale)
        best = torch.tensor(costs.argmin(axis=1))
        weights = torch.tensor((weight / scale).astype(np.float32))
        usual = torch.softmax(torch.tensor(self._first.logits(observations)), dim=1)
        optimiser = torch.optim.Adam(self._network.parameters(), lr=LEARNING_RATE, fused=True)
        for epoch in range(EPOCHS):
            for group in optimiser.param_groups:
                group["lr"] = LEARNING_RATE * (1.0 - epoch / EPOCHS)
            shuffled = torch.randperm(len(inputs), generator=self._shuffle)
            for rows in torch.split(shuffled, BATCH):
                said = torch.log_softmax(self._network(inputs[rows]), dim=1)
                missed = -said.gather(1, best[rows, None])[:, 0] * weights[rows]
                strayed = -(usual[rows] * said).sum(dim=1) * (FOLLOWED / scale)
                optimiser.zero_grad()
                (missed + strayed).mean().backward()  # type: ignore[no-untyped-call]
                optimiser.step()
        return self._policy()

    def _policy(self) -> Policy:
        weights: dict[str, NDArray[np.float32]] = {}
        linear = [part for part in self._network if isinstance(part, torch.nn.Linear)]
        for i, part in enumerate(linear):
            weights[f"layer.{i}.weight"] = part.weight.detach().numpy().copy()
            weights[f"layer.{i}.bias"] = part.bias.detach().numpy().copy()
        return Policy(weights, self._first.scale, None, "tanh")
