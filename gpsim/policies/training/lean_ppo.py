"""stable-baselines3's PPO with its two inner loops written out: the same draws, the same numbers, sooner.

For two networks of 64 units nearly all of a training is overhead: distributions that are built and checked, modules
called, graphs walked. `collect_rollouts` and `train` do here what the library's do, in plain tensor operations;
everything else, schedules, buffers, returns, callbacks and logs, is the library's. They hold for what gpsim trains:
discrete actions, flat observations, a tanh network each for actor and critic, on the processor.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, cast

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.buffers import RolloutBuffer
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.utils import explained_variance
from stable_baselines3.common.vec_env import VecEnv
from torch import Tensor, nn
from torch.optim.adam import adam

from gpsim.policies.training.lean_update import Batch, Network, Terms, limit_norm, write_gradients

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
