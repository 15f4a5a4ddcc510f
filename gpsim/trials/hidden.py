"""Forces outside the catalogue that remember: what a law with a hidden state must say."""

from __future__ import annotations

from collections.abc import Mapping

from gpsim.channels import FloatArray

Values = Mapping[str, float]


class Hidden:
    """A force with a hidden state z (B, 2) of its own."""

    def begin(self, q: FloatArray, v: FloatArray) -> FloatArray:
        """(B, 2) at the start."""
        raise NotImplementedError

    def force(self, k: Values, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        """(B,) on its coordinate."""
        raise NotImplementedError

    def drift(self, k: Values, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        """(B, 2): dz / dt."""
        raise NotImplementedError
