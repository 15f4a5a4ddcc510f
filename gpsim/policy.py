"""A trained policy as plain arrays: acts in NumPy, without the library that trained it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gpsim.errors import UsageError
from gpsim.tasks.task import Actions

Weights = Mapping[str, NDArray[np.float32]]
FORMAT = "gpsim.policy/1"


@dataclass(frozen=True)
class Policy:
    """A multilayer perceptron with tanh units from scaled observations to the logits of discrete actions.

    weights: `layer.<i>.weight` (out, in) and `layer.<i>.bias` (out,) in order; scale: (O,) the observation is divided
    by it before the first layer.
    """

    weights: Weights
    scale: NDArray[np.float32]

    def logits(self, observations: NDArray[np.float32]) -> NDArray[np.float32]:
        """(B, number of actions): unnormalised log probabilities."""
        hidden = observations / self.scale
        last = len(self.weights) // 2 - 1
        for layer in range(last + 1):
            hidden = hidden @ self.weights[f"layer.{layer}.weight"].T + self.weights[f"layer.{layer}.bias"]
            if layer < last:
                hidden = np.tanh(hidden)
        return hidden

    def act(self, observations: NDArray[np.float32], rng: np.random.Generator | None = None) -> Actions:
        """(B,) actions: the most probable one, or drawn from the policy's distribution when `rng` is given."""
        logits = self.logits(observations)
        if rng is not None:  # the Gumbel-max trick draws from softmax(logits)
            logits = logits + rng.gumbel(size=logits.shape).astype(np.float32)
        return np.asarray(np.argmax(logits, axis=1))

    def to_arrays(self) -> tuple[dict[str, NDArray[np.float32]], dict[str, Any]]:
        """Arrays and JSON-able metadata for disk."""
        layers = len(self.weights) // 2
        return {**self.weights, "scale": self.scale}, {
            "format": FORMAT,
            "layers": layers,
            "activation": "tanh",
        }

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[Any]], metadata: Mapping[str, Any]) -> Policy:
        """The inverse of `to_arrays`; raises UsageError for another format."""
        if metadata.get("format") != FORMAT or len(arrays) != 2 * int(metadata.get("layers", 0)) + 1:
            raise UsageError(
                f"not a policy of format {FORMAT}: {metadata.get('format')!r}, {len(arrays)} arrays"
            )
        return cls({k: v for k, v in arrays.items() if k != "scale"}, arrays["scale"])
