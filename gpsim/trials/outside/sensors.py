"""Sensors that read something else than what is there."""

from __future__ import annotations

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials.outside.kind import VEHICLE, Distortion, SensorWithMemory
from gpsim.trials.worlds import SYSTEMS, Dial, Scales, System, rounded, waves


class EccentricEncoder(Distortion):
    """An encoder mounted off its axis: y + A sin(k y + phase)."""

    name = "eccentric_encoder"
    since = 0

    def read(self, y: FloatArray) -> FloatArray:
        k = self.k
        return np.asarray(y + k["amplitude"] * np.sin(k["wave_number"] * y + k["phase"]))

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        return {
            "amplitude": rounded(d.size(0.04, 0.2) * min(s.reach(on), 1.0)),
            **({"wave_number": 1.0, "phase": d.any(0, 6.28)} if on == "yaw" else waves(s, on, d, 2, 4)),
        }


class FisheyeCamera(Distortion):
    """Positions by a camera at height H above the origin whose orthographic fisheye was taken for a pinhole.

    It sees the radius H sin(atan(r / H)) = r / sqrt(1 + (r / H)^2).
    """

    name = "fisheye_camera"
    since = 2028
    systems = VEHICLE
    on = ("pose",)

    def read(self, y: FloatArray) -> FloatArray:
        far = (y**2).sum(axis=1) / self.k["height"] ** 2
        return np.asarray(y / np.sqrt(1.0 + far)[:, None])

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        far = float(np.sqrt(np.mean(s.column("x") ** 2 + s.column("y") ** 2)))
        return {"height": rounded(far / np.sqrt(d.size(0.04, 0.4)))}


class CoarseEncoder(Distortion):
    """An encoder of few lines: multiples of its step."""

    name = "coarse_encoder"
    since = 2030

    def read(self, y: FloatArray) -> FloatArray:
        step = self.k["step"]
        return np.asarray(step * np.floor(y / step + 0.5))

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        return {"step": rounded(d.size(0.03, 0.3) * min(s.reach(on), 1.0))}


class SlowSensor(SensorWithMemory):
    """A sensor that reads less often than recorded: what was at its last tick; ticks begin with the episode."""

    name = "slow_sensor"
    since = 2028

    @classmethod
    def places(cls, system: System, velocities: str | None) -> list[str]:
        """None where velocities are differentiated: a reading that repeats is no speed of 0."""
        return [] if velocities == "differentiated" else super().places(system, velocities)

    def read(self, past: FloatArray, h: float) -> FloatArray:
        period, index = self.k["period"], len(past) - 1
        ticks = np.floor((index + 0.5) * h / period)
        return np.asarray(past[min(int(ticks * period / h + 0.5), index)])

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        return {"period": rounded(d.size(1.3, 5.0) * s.world.dt)}


class LooseMarker(SensorWithMemory):
    """A marker on a springy stalk: p'' = w^2 (q - p) + 2 zeta w (q' - p'), what is read is p.

    Base excitation (Inman, Engineering Vibration, section 2.4): the sum of its responses to a past of small moves,
    each taken half a fine step after it began.
    """

    name = "loose_marker"
    since = 2029

    def read(self, past: FloatArray, h: float) -> FloatArray:
        k = self.k
        turn = 2 * np.pi * k["frequency"]
        decay, ring = k["damping_ratio"] * turn, turn * np.sqrt(1.0 - k["damping_ratio"] ** 2)
        age = h * (np.arange(len(past) - 1)[::-1] + 0.5)
        behind = np.exp(-decay * age) * (np.cos(ring * age) - decay / ring * np.sin(ring * age))
        moves = np.diff(past, axis=0)
        return np.asarray(past[-1] - (behind[:, None] * moves).sum(axis=0))

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        """The slower it sways the more; a vehicle, which is slower, carries a longer stalk."""
        period = d.size(0.1, 0.5) * (4.0 if SYSTEMS[s.world.system].vehicle else 1.0)
        return {"frequency": rounded(1.0 / period), "damping_ratio": d.any(0.1, 0.3)}


class WarmingSensor(SensorWithMemory):
    """A zero that moves as the sensor warms up: y + A (1 - e^(-t / T)), t s after the episode's start."""

    name = "warming_sensor"
    since = 2030

    def read(self, past: FloatArray, h: float) -> FloatArray:
        return np.asarray(past[-1] - self.k["offset"] * np.expm1(-h * (len(past) - 1) / self.k["time"]))

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        """Warm before the episode ends; a vehicle's heading goes round, so that its range says nothing."""
        size = d.size(0.05, 0.4) * (1.0 if SYSTEMS[s.world.system].vehicle else s.reach(on))
        return {
            "offset": rounded(d.sign() * size),
            "time": rounded(d.any(0.1, 0.4) * s.world.steps * s.world.dt),
        }


class EncoderPlay(SensorWithMemory):
    """An encoder behind a gear with play: it reads on only when an end of the gap, `gap` to either side, pushes it.

    What lies between the gap's lower end and the body, a path held between 0 and 2 gap: Kruk, Lehoczky, Ramanan and
    Shreve (2007), An explicit formula for the Skorokhod map on [0, a]. In the middle of the gap at the start.
    """

    name = "encoder_play"
    since = 2031

    def read(self, past: FloatArray, h: float) -> FloatArray:
        gap = self.k["gap"]
        free = past - past[0] + gap
        held = free + np.maximum(np.maximum.accumulate(-free), 0.0)
        least = np.minimum.accumulate(held[::-1])[::-1]  # from every moment until now
        over = np.minimum(np.maximum(held - 2.0 * gap, 0.0), least).max(axis=0)
        return np.asarray(past[-1] - (held[-1] - over - gap))

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        return {"gap": rounded(d.size(0.03, 0.25) * min(s.reach(on), 1.0))}


class StuckBit(Distortion):
    """An encoder with a bit that is always 0: where it should be 1, the reading is too small by the bit's worth."""

    name = "stuck_bit"
    since = 2040

    def read(self, y: FloatArray) -> FloatArray:
        step = self.k["step"]
        return np.asarray(y - step * (np.floor(y / step) % 2.0))

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        return {"step": rounded(d.size(0.03, 0.3) * min(s.reach(on), 1.0))}


KINDS = (
    EccentricEncoder,
    FisheyeCamera,
    CoarseEncoder,
    SlowSensor,
    LooseMarker,
    WarmingSensor,
    EncoderPlay,
    StuckBit,
)
