"""A trained policy as plain arrays: acts in NumPy, without the library that trained it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from gpsim.errors import UsageError
from gpsim.tasks import Actions

Weights = Mapping[str, NDArray[np.float32]]
Activation = Literal["tanh", "relu"]
FORMAT = "gpsim.policy/1"
LOG_STD_RANGE = (-20.0, 2.0)
"""Where stable-baselines3's SAC clips the logarithm of the spread."""
_ACTIVATIONS: Mapping[str, Callable[[NDArray[Any]], NDArray[Any]]] = {
    "tanh": np.tanh,
    "relu": lambda x: np.maximum(x, np.float32(0.0)),
}


@dataclass(frozen=True)
class Policy:
    """A multilayer perceptron from scaled observations to what decides the action.

    weights: `layer.<i>.weight` (out, in) and `layer.<i>.bias` (out,) in order; scale: (O,) the observation is divided
    by it before the first layer. bounds: None for discrete actions, whose logits the last layer gives; else (2, A),
    low and high, and the last layer gives mean and log std (2 A,) of a Gaussian that tanh squashes into the bounds.
    """

    weights: Weights
    scale: NDArray[np.float32]
    bounds: NDArray[np.float32] | None = None
    activation: Activation = "tanh"

    def logits(self, observations: NDArray[np.float32]) -> NDArray[np.float32]:
        """(B, out): the last layer; unnormalised log probabilities, or mean and log std before squashing."""
        hidden = observations / self.scale
        last = self.layers - 1
        for layer in range(last + 1):
            hidden = hidden @ self.weights[f"layer.{layer}.weight"].T + self.weights[f"layer.{layer}.bias"]
            if layer < last:
                hidden = _ACTIVATIONS[self.activation](hidden)
        return hidden

    @property
    def layers(self) -> int:
        """Number of layers."""
        return len(self.weights) // 2

    def act(self, observations: NDArray[np.float32], rng: np.random.Generator | None = None) -> Actions:
        """(B,) or (B, A) actions: the most probable (the squashed mean), or drawn when `rng` is given."""
        out = self.logits(observations)
        if self.bounds is None:
            if rng is not None:  # the Gumbel-max trick draws from softmax(logits)
                out = out + rng.gumbel(size=out.shape).astype(np.float32)
            return np.asarray(np.argmax(out, axis=1))
        mean, log_std = np.split(out, 2, axis=1)
        if rng is not None:
            spread = np.exp(np.clip(log_std, *LOG_STD_RANGE))
            mean = mean + spread * rng.standard_normal(mean.shape).astype(np.float32)
        low, high = self.bounds
        return np.asarray(low + 0.5 * (np.tanh(mean) + 1.0) * (high - low))

    def probabilities(self, observations: NDArray[np.float32]) -> NDArray[np.float64]:
        """(B, out) of each discrete action."""
        logits = self.logits(observations).astype(np.float64)
        shares = np.exp(logits - logits.max(axis=1, keepdims=True))
        return np.asarray(shares / shares.sum(axis=1, keepdims=True))

    def to_arrays(self) -> tuple[dict[str, NDArray[np.float32]], dict[str, Any]]:
        """Arrays and JSON-able metadata for disk."""
        arrays = {**self.weights, "scale": self.scale}
        if self.bounds is not None:
            arrays["bounds"] = self.bounds
        return arrays, {"format": FORMAT, "layers": self.layers, "activation": self.activation}

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[Any]], metadata: Mapping[str, Any]) -> Policy:
        """The inverse of `to_arrays`; raises UsageError for another format."""
        named = {k: v for k, v in arrays.items() if k.startswith("layer.")}
        activation = metadata.get("activation")
        if (
            metadata.get("format") != FORMAT
            or "scale" not in arrays
            or activation not in ("tanh", "relu")
            or metadata.get("layers") != len(named) / 2
        ):
            raise UsageError(
                f"not a policy of format {FORMAT}: {metadata.get('format')!r}, {len(arrays)} arrays"
            )
        return cls(named, arrays["scale"], arrays.get("bounds"), activation)
