"""The gradient of PPO's loss on a mini-batch, written out for two tanh networks of a few dozen units.

stable-baselines3 builds a graph of some sixty nodes for every mini-batch and walks it back: for networks this small
that is four fifths of a training. Here are the same operations in the same order, without the graph: the same numbers.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import torch
from torch import Tensor, nn

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
