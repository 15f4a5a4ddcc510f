"""The truth of a vehicle in the plane: its twist, changed by effects, integrated by Runge-Kutta steps."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials import catalogue, outside
from gpsim.trials.worlds import SYSTEMS, TrueEffect

TWISTS, HIDDEN = outside.at_site(outside.Twist), outside.at_site(outside.HiddenTwist)


class Vehicle:
    """Steps a batch of unicycles: state (x, y, yaw), action (v, w)."""

    def __init__(self, effects: Sequence[TrueEffect]) -> None:
        order = list(catalogue.TWIST)
        self._twist = sorted((e for e in effects if e.family in order), key=lambda e: order.index(e.family))
        self._outside = [TWISTS[e.family](e.values) for e in effects if e.family in TWISTS]
        self._hidden = [HIDDEN[e.family](e.values) for e in effects if e.family in HIDDEN]

    def begin(self, s: FloatArray) -> FloatArray:
        """(B, H) hidden states at the start."""
        parts = [law.begin(s) for law in self._hidden]
        return np.hstack(parts) if parts else np.empty((len(s), 0))

    def step(
        self, s: FloatArray, z: FloatArray, u: FloatArray, t: FloatArray, wall: FloatArray, h: float
    ) -> tuple[FloatArray, FloatArray]:
        """State and hidden state after h s with u (B, 2) acting."""
        width = s.shape[1]
        y = np.hstack([s, z]) if z.shape[1] else s
        k1 = self._slope(y, u, t)
        k2 = self._slope(y + h / 2 * k1, u, t + h / 2)
        k3 = self._slope(y + h / 2 * k2, u, t + h / 2)
        k4 = self._slope(y + h * k3, u, t + h)
        y = y + h / 6 * (k1 + 2 * (k2 + k3) + k4)
        return y[:, :width], y[:, width:]

    def _slope(self, y: FloatArray, u: FloatArray, t: FloatArray) -> FloatArray:
        """(B, S + H) of state and hidden state."""
        s = y[:, :3]
        v, w = u[:, 0], u[:, 1]
        lateral = np.zeros_like(v)
        for effect in self._twist:
            new = catalogue.TWIST[effect.family](effect.values, v, lateral, w)
            if effect.gated:
                gate = effect.acts(s, t, SYSTEMS["unicycle"].names) > 0
                new = tuple(np.where(gate, a, b) for a, b in zip(new, (v, lateral, w), strict=True))  # type: ignore[assignment]
            v, lateral, w = new
        for law in self._outside:
            v, w = law.twist(v, w, s)
        drift = []
        for i, hidden in enumerate(self._hidden):
            v, w, moved = hidden.twist(v, w, y[:, 3 + i : 4 + i])
            drift.append(moved)
        sin, cos = np.sin(s[:, 2]), np.cos(s[:, 2])
        rates = np.stack([v * cos - lateral * sin, v * sin + lateral * cos, w], axis=1)
        return np.hstack([rates, *drift]) if drift else rates
