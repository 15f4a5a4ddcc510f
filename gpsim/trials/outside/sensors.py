"""Sensors that read something else than what is there."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials.outside.kind import VEHICLE, Distortion, Draw, SensorWithMemory, seconds
from gpsim.trials.worlds import SYSTEMS, Dial, Scales, System, waves


class EccentricEncoder(Distortion):
    """An encoder mounted off its axis: y + A sin(k y + phase)."""

    since = 0

    def read(self, y: FloatArray) -> FloatArray:
        return np.asarray(y + self.k["amplitude"] * np.sin(self.k["wave_number"] * y + self.k["phase"]))

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        once = {"wave_number": 1.0, "phase": d.any(0, 6.28)} if on == "yaw" else waves(s, on, d, 2, 4)
        return {"amplitude": d.size(0.04, 0.2) * min(s.reach(on), 1.0), **once}


class FisheyeCamera(Distortion):
    """Positions by a camera at height H above the origin whose orthographic fisheye was taken for a pinhole.

    It sees the radius H sin(atan(r / H)) = r / sqrt(1 + (r / H)^2).
    """

    since = 2028
    systems = VEHICLE
    on = ("pose",)

    def read(self, y: FloatArray) -> FloatArray:
        far = (y**2).sum(axis=1) / self.k["height"] ** 2
        return np.asarray(y / np.sqrt(1.0 + far)[:, None])

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        far = float(np.sqrt(np.mean(s.column("x") ** 2 + s.column("y") ** 2)))
        return {"height": far / np.sqrt(d.size(0.04, 0.4))}


class CoarseEncoder(Distortion):
    """An encoder of few lines: multiples of its step."""

    since = 2030
    strength: ClassVar[Draw] = lambda s, on, d: {"step": d.size(0.03, 0.3) * min(s.reach(on), 1.0)}

    def read(self, y: FloatArray) -> FloatArray:
        return np.asarray(self.k["step"] * np.floor(y / self.k["step"] + 0.5))


class StuckBit(Distortion):
    """An encoder with a bit that is always 0: where it should be 1, the reading is too small by the bit's worth."""

    since = 2040
    strength: ClassVar[Draw] = CoarseEncoder.strength

    def read(self, y: FloatArray) -> FloatArray:
        return np.asarray(y - self.k["step"] * (np.floor(y / self.k["step"]) % 2.0))


class SlowSensor(SensorWithMemory):
    """A sensor that reads less often than recorded: what was at its last tick; ticks begin with the episode."""

    since = 2028
    strength: ClassVar[Draw] = lambda s, on, d: {"period": d.size(1.3, 5.0) * s.world.dt}

    @classmethod
    def places(cls, system: System, velocities: str | None) -> list[str]:
        """None where velocities are differentiated: a reading that repeats is no speed of 0."""
        return [] if velocities == "differentiated" else super().places(system, velocities)

    def read(self, past: FloatArray, h: float) -> FloatArray:
        period, index = self.k["period"], len(past) - 1
        ticks = np.floor((index + 0.5) * h / period)
        return np.asarray(past[min(int(ticks * period / h + 0.5), index)])


class LooseMarker(SensorWithMemory):
    """A marker on a springy stalk: p'' = w^2 (q - p) + 2 zeta w (q' - p'), what is read is p.

    Base excitation (Inman, Engineering Vibration, section 2.4): the sum of its responses to a past of small moves,
    each taken half a fine step after it began.
    """

    since = 2029

    def read(self, past: FloatArray, h: float) -> FloatArray:
        turn, zeta = 2 * np.pi * self.k["frequency"], self.k["damping_ratio"]
        decay, ring = zeta * turn, turn * np.sqrt(1.0 - zeta**2)
        age = h * (np.arange(len(past) - 1)[::-1] + 0.5)
        behind = np.exp(-decay * age) * (np.cos(ring * age) - decay / ring * np.sin(ring * age))
        return np.asarray(past[-1] - (behind[:, None] * np.diff(past, axis=0)).sum(axis=0))

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        """The slower it sways the more; a vehicle, which is slower, carries a longer stalk."""
        period = d.size(0.1, 0.5) * (4.0 if SYSTEMS[s.world.system].vehicle else 1.0)
        return {"frequency": 1.0 / period, "damping_ratio": d.any(0.1, 0.3)}


class WarmingSensor(SensorWithMemory):
    """A zero that moves as the sensor warms up: y + A (1 - e^(-t / T)), t s after the episode's start."""

    since = 2030

    def read(self, past: FloatArray, h: float) -> FloatArray:
        return np.asarray(past[-1] - self.k["offset"] * np.expm1(-h * (len(past) - 1) / self.k["time"]))

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        """Warm before the episode ends; a vehicle's heading goes round, so that its range says nothing."""
        size = d.size(0.05, 0.4) * (1.0 if SYSTEMS[s.world.system].vehicle else s.reach(on))
        return {"offset": d.sign() * size, "time": seconds(s, d.any(0.1, 0.4))}


class EncoderPlay(SensorWithMemory):
    """An encoder behind a gear with play: it reads on only when an end of the gap, `gap` to either side, pushes it.

    What lies between the gap's lower end and the body, a path held between 0 and 2 gap: Kruk, Lehoczky, Ramanan and
    Shreve (2007), An explicit formula for the Skorokhod map on [0, a]. In the middle of the gap at the start.
    """

    since = 2031
    strength: ClassVar[Draw] = lambda s, on, d: {"gap": d.size(0.03, 0.25) * min(s.reach(on), 1.0)}

    def read(self, past: FloatArray, h: float) -> FloatArray:
        gap = self.k["gap"]
        free = past - past[0] + gap
        held = free + np.maximum(np.maximum.accumulate(-free), 0.0)
        least = np.minimum.accumulate(held[::-1])[::-1]  # from every moment until now
        over = np.minimum(np.maximum(held - 2.0 * gap, 0.0), least).max(axis=0)
        return np.asarray(past[-1] - (held[-1] - over - gap))
