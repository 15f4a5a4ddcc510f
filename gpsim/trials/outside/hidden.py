"""Physics outside the catalogue that remembers: what a law with a hidden state must say."""

from __future__ import annotations

from collections.abc import Mapping

from gpsim.channels import FloatArray

Values = Mapping[str, float]


class Hidden:
    """A force, and perhaps an inertia, with a hidden state z (B, 2) of its own."""

    def begin(self, q: FloatArray, v: FloatArray) -> FloatArray:
        """(B, 2) at the start."""
        raise NotImplementedError

    def force(self, k: Values, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        """(B,) on its coordinate."""
        raise NotImplementedError

    def drift(self, k: Values, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        """(B, 2): dz / dt."""
        raise NotImplementedError

    def inertia(self, k: Values, z: FloatArray) -> FloatArray | None:
        """(B,) by how much its coordinate's inertia differs from the base's; None: it does not."""
        return None


class HiddenTwist:
    """A change of a vehicle's twist with a hidden state z (B, 1) of its own."""

    def begin(self, s: FloatArray) -> FloatArray:
        """(B, 1) at the start."""
        raise NotImplementedError

    def twist(
        self, k: Values, v: FloatArray, w: FloatArray, z: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """v, w and dz / dt (B, 1)."""
        raise NotImplementedError
