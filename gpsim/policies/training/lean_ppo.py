"""stable-baselines3's PPO with its two inner loops written out: the same draws, the same numbers, sooner.

For two networks of 64 units nearly all of a training is overhead: distributions that are built and checked, modules
called, graphs walked. `collect_rollouts` and `train` do here what the library's do, in plain tensor operations;
everything else, schedules, buffers, returns, callbacks and logs, is the library's. They hold for what gpsim trains:
discrete actions, flat observations, a tanh network each for actor and critic, on the processor.

The gradient of PPO's loss on a mini-batch, written out for two tanh networks of a few dozen units.

stable-baselines3 builds a graph of some sixty nodes for every mini-batch and walks it back: for networks this small
that is four fifths of a training. Here are the same operations in the same order, without the graph: the same numbers.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any, NamedTuple, cast

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.buffers import RolloutBuffer
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.utils import explained_variance
from stable_baselines3.common.vec_env import VecEnv
from torch import Tensor, nn
from torch.optim.adam import adam

SPREAD = 1e-8  # stable-baselines3's guards: where all advantages are equal,
NORM = 1e-6  # and where all gradients are zero
HALF = torch.tensor(0.5)


class Batch(NamedTuple):
    """What N steps of a rollout hold: observations (N, O), the rest (N,)."""

    observations: Tensor
    actions: Tensor  # whole numbers
    log_probs: Tensor  # of the actions, by the policy that took them
    advantages: Tensor
    returns: Tensor

    def split(self, size: int) -> Iterator[Batch]:
        """Mini-batches of so many steps, in order."""
        return (Batch(*parts) for parts in zip(*(torch.split(part, size) for part in self), strict=True))


class Network:
    """Linear layers with tanh between them, and the loss by their weights."""

    def __init__(self, layers: Sequence[nn.Linear]) -> None:
        self._layers = [(layer.weight.detach(), layer.bias.detach()) for layer in layers]
        self._slopes = [(torch.zeros_like(weight), torch.zeros_like(bias)) for weight, bias in self._layers]
        for layer, (weight, bias) in zip(layers, self._slopes, strict=True):
            layer.weight.grad, layer.bias.grad = weight, bias

    def __call__(self, inputs: Tensor) -> Tensor:
        """(N, units of the last layer)."""
        return self.forward(inputs)[-1]

    def forward(self, inputs: Tensor) -> list[Tensor]:
        """What goes into each layer, and at the end what comes out of the last."""
        passed = [inputs]
        for weight, bias in self._layers[:-1]:
            passed.append(torch.addmm(bias, passed[-1], weight.t()).tanh_())
        weight, bias = self._layers[-1]
        passed.append(torch.addmm(bias, passed[-1], weight.t()))
        return passed

    def backward(self, passed: Sequence[Tensor], slope: Tensor) -> None:
        """Write down the loss by every weight and bias, as their `.grad`.

        slope (N, units): the loss by what came out of the last layer.
        """
        for i in reversed(range(len(self._layers))):
            by_weight, by_bias = self._slopes[i]
            torch.sum(slope, 0, out=by_bias)
            torch.mm(slope.t(), passed[i], out=by_weight)
            if i:
                slope = torch.ops.aten.tanh_backward(slope.mm(self._layers[i][0]), passed[i])


class Terms(NamedTuple):
    """What the loss was made of: log_probs (N, A) of all actions, the rest (N,)."""

    log_probs: Tensor
    log_ratio: Tensor  # of the probabilities of the actions taken, now to then
    free: Tensor  # advantage times ratio,
    held: Tensor  # and times the clipped ratio
    missed: Tensor  # by how much the critic is too high


def write_gradients(
    actor: Network, critic: Network, batch: Batch, clip: float, entropy: float, value: float
) -> Terms:
    """PPO's loss (Schulman et al. 2017, equations 7 and 9) by all weights; to be called without a graph.

    clip: how far the ratio of probabilities may leave 1; entropy, value: weights of these terms beside the policy's.
    """
    count, chosen = len(batch.actions), batch.actions[:, None]
    through, judged = actor.forward(batch.observations), critic.forward(batch.observations)
    logits = through[-1]
    log_probs = logits - logits.logsumexp(dim=-1, keepdim=True)
    probs = log_probs.exp()
    log_ratio = log_probs.gather(-1, chosen).squeeze(-1) - batch.log_probs
    ratio = log_ratio.exp()
    advantages = batch.advantages
    if count > 1:
        advantages = (advantages - advantages.mean()) / (advantages.std() + SPREAD)
    limited = ratio.clamp(1.0 - clip, 1.0 + clip)
    free, held = advantages * ratio, advantages * limited
    # Beyond the limit the clipped term is flat. Where it is the smaller one the loss does not depend on the ratio;
    # where both round to the same number, each counts half.
    share = torch.where(limited == ratio, 1.0, torch.heaviside(held - free, HALF))
    slope = share * (advantages * (-1.0 / count)) * ratio
    by_logits = (slope[:, None] * -probs).scatter_add_(1, chosen, slope[:, None])
    if entropy:
        surprise = log_probs - (probs * log_probs).sum(-1, keepdim=True)
        by_logits += (entropy / count) * probs * surprise
    actor.backward(through, by_logits)
    missed = judged[-1].flatten() - batch.returns
    critic.backward(judged, (missed * (2.0 / count) * value)[:, None])
    return Terms(log_probs, log_ratio, free, held, missed)


def limit_norm(gradients: Sequence[Tensor], most: float) -> None:
    """Scale gradients so that their common norm is no more than `most`."""
    total = torch.linalg.vector_norm(torch.stack([torch.linalg.vector_norm(part) for part in gradients]))
    share = (most / (total + NORM)).clamp(max=1.0)
    for part in gradients:
        part.mul_(share)


ADAM_EPSILON = 1e-5  # stable-baselines3's own choice for PPO


class FusedAdam:
    """Adam (Kingma and Ba 2015, arXiv:1412.6980) by torch's fused kernel, in stable-baselines3's hands.

    Making a torch.optim.Optimizer imports torch's compiler: a second of every process that trains.
    """

    def __init__(self, parameters: Iterable[nn.Parameter], lr: float) -> None:
        self._parameters = [part.detach() for part in parameters]
        self._mean = [torch.zeros_like(part) for part in self._parameters]
        self._square = [torch.zeros_like(part) for part in self._parameters]
        self._steps = [torch.zeros(()) for _ in self._parameters]
        self.param_groups: list[dict[str, Any]] = [{"lr": lr}]  # where stable-baselines3 writes the rate

    def step(self, gradients: list[Tensor]) -> None:
        """Go one step against the gradients, one a parameter."""
        adam(
            self._parameters,
            gradients,
            self._mean,
            self._square,
            [],
            self._steps,
            fused=True,
            amsgrad=False,
            beta1=0.9,
            beta2=0.999,
            lr=self.param_groups[0]["lr"],
            weight_decay=0.0,
            eps=ADAM_EPSILON,
            maximize=False,
        )


class LeanPPO(PPO):
    """PPO whose rollouts and updates go without distributions, modules and graphs."""

    def _networks(self) -> tuple[Network, Network]:
        """Actor and critic; they share the policy's weights."""
        policy = self.policy
        hidden = policy.mlp_extractor.policy_net, policy.mlp_extractor.value_net
        last = policy.action_net, policy.value_net
        actor, critic = (
            Network([part for part in (*layers, end) if isinstance(part, nn.Linear)])
            for layers, end in zip(hidden, last, strict=True)
        )
        return actor, critic

    @torch.no_grad()
    def collect_rollouts(
        self, env: VecEnv, callback: BaseCallback, rollout_buffer: RolloutBuffer, n_rollout_steps: int
    ) -> bool:
        """Fill the buffer with steps of the policy as it is; False where the callback ended it."""
        observations, starts = self._last_obs, self._last_episode_starts
        assert isinstance(observations, np.ndarray)
        assert starts is not None
        actor, critic = self._networks()
        rollout_buffer.reset()
        callback.on_rollout_start()
        for _ in range(n_rollout_steps):
            seen = torch.from_numpy(observations)
            logits = actor(seen)
            log_probs = logits - logits.logsumexp(dim=-1, keepdim=True)
            actions = torch.multinomial(log_probs.softmax(dim=-1), 1, True)
            found, rewards, dones, infos = env.step(actions[:, 0].numpy())
            assert isinstance(found, np.ndarray)
            self.num_timesteps += env.num_envs
            if not callback.on_step():
                return False
            for i in np.flatnonzero(dones):
                if infos[i]["TimeLimit.truncated"]:  # the critic says what would have come
                    last = torch.from_numpy(infos[i]["terminal_observation"])
                    rewards[i : i + 1] += (self.gamma * critic(last[None]))[0].numpy()
            rollout_buffer.add(
                observations,
                actions.numpy(),
                rewards,
                starts,
                critic(seen),
                log_probs.gather(-1, actions)[:, 0],
            )
            observations, starts = found, dones
        self._last_obs, self._last_episode_starts = observations, starts
        rollout_buffer.compute_returns_and_advantage(critic(torch.from_numpy(observations)), starts)
        callback.on_rollout_end()
        return True

    @torch.no_grad()
    def train(self) -> None:
        """Some epochs over the buffer, in mini-batches."""
        self._update_learning_rate(self.policy.optimizer)
        optimizer = cast(FusedAdam, self.policy.optimizer)
        clip = self.clip_range(self._current_progress_remaining)  # type: ignore[operator]
        actor, critic = self._networks()
        gradients = [part.grad for part in self.policy.parameters() if part.grad is not None]
        record = _Record(self, clip)
        for _ in range(self.n_epochs):
            for batch in self._shuffled().split(self.batch_size):
                terms = write_gradients(actor, critic, batch, clip, self.ent_coef, self.vf_coef)
                limit_norm(gradients, self.max_grad_norm)
                optimizer.step(gradients)
                record.add(terms)
            self._n_updates += 1
        record.write()

    def _shuffled(self) -> Batch:
        """All steps of the buffer, in an order drawn anew."""
        (steps,) = self.rollout_buffer.get()
        actions = steps.actions.long().flatten()
        return Batch(steps.observations, actions, steps.old_log_prob, steps.advantages, steps.returns)


class _Record:
    """What stable-baselines3 notes of an update; gathered only where it is written down."""

    def __init__(self, model: PPO, clip: float) -> None:
        self._model, self._clip, self._wanted = model, clip, bool(model.logger.output_formats)
        self._rows: list[dict[str, float]] = []

    def add(self, terms: Terms) -> None:
        """The terms of one mini-batch's loss."""
        if not self._wanted:
            return
        change = terms.log_ratio.exp() - 1.0
        row = {
            "entropy_loss": (terms.log_probs.exp() * terms.log_probs).sum(-1).mean(),
            "policy_gradient_loss": -torch.min(terms.free, terms.held).mean(),
            "value_loss": terms.missed.square().mean(),
            "approx_kl": (change - terms.log_ratio).mean(),
            "clip_fraction": (change.abs() > self._clip).float().mean(),
        }
        self._rows.append({name: float(value) for name, value in row.items()})

    def write(self) -> None:
        """Their means; of the divergence, as the library, over the last epoch alone."""
        if not self._wanted:
            return
        model, rows, buffer = self._model, self._rows, self._model.rollout_buffer
        said = {name: float(np.mean([row[name] for row in rows])) for name in rows[0]}
        last = rows[-(len(rows) // model.n_epochs) :]
        said["approx_kl"] = float(np.mean([row["approx_kl"] for row in last]))
        said["loss"] = (
            last[-1]["policy_gradient_loss"]
            + model.ent_coef * last[-1]["entropy_loss"]
            + model.vf_coef * last[-1]["value_loss"]
        )
        said["explained_variance"] = float(
            explained_variance(buffer.values.flatten(), buffer.returns.flatten())
        )
        said["clip_range"] = self._clip
        model.logger.record("train/n_updates", model._n_updates, exclude="tensorboard")
        for name, value in said.items():
            model.logger.record(f"train/{name}", value)
