"""Who keeps up what floats or stands: controllers that go by the noisy readings and the model as it is believed.

Each is stirred so that what may be missing shows: paths that wind, turns, steps of the legs.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials.robots.models import layout_of, spec_of
from gpsim.trials.worlds import World

Pilot = Callable[[float, FloatArray], FloatArray]
"""pilot(t, reading (S,)) -> command (A,), before it is clipped; a negative t is before the recording."""
NOMINAL = {"hopper": np.array([-0.15, -0.55, 0.3]), "dog": np.tile([0.0, 0.75, -1.5], 4)}
"""Joints as they stand, in the order of the channels."""
LEAN = -0.4  # rad, of a hopper's torso, so that its weight is above the foot
HOVERS = np.array([0.0, 0.0, 1.0])  # m, where a quadrotor's path winds about
TAU = 2.0 * np.pi


def pilot_of(world: World, rng: np.random.Generator) -> Pilot:
    """The controller of one episode."""
    names, model = layout_of(world.system).names, spec_of(world.system).compile()
    at = {name: i for i, name in enumerate(names)}
    return PILOTS[world.system](model, at, rng)


def turned(quaternion: FloatArray) -> FloatArray:
    """(3, 3) the body's axes in the world; (4,) real part first."""
    w, x, y, z = quaternion / np.linalg.norm(quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def _quadrotor(model: Any, at: Mapping[str, int], rng: np.random.Generator) -> Pilot:
    """Tracks a Lissajous path on SO(3) (Lee, Leok and McClamroch 2010), its torques stirred."""
    amplitude = rng.uniform(0.6, 1.3, 3) * [1.0, 1.0, 0.4]
    rate, phase = rng.uniform(0.1, 0.35, 4), rng.uniform(0.0, TAU, 3)
    mass, inertia = float(model.body_mass[1]), np.array(model.body_inertia[1])
    gear, place = np.array(model.actuator_gear), np.array(model.site_pos)
    mixed = np.stack([gear[:, 2], gear[:, 2] * place[:, 1], -gear[:, 2] * place[:, 0], gear[:, 5]])
    pose = [at[f"base.{part}"] for part in ("x", "y", "z")]
    quaternion = [at[f"base.{part}"] for part in ("qw", "qx", "qy", "qz")]
    linear, angular = ([at[f"base.{kind}{a}"] for a in "xyz"] for kind in "vw")

    def command(t: float, s: FloatArray) -> FloatArray:
        path = HOVERS + amplitude * np.sin(TAU * rate[:3] * t + phase)
        wanted = 4.0 * (path - s[pose]) - 2.5 * s[linear] + [0.0, 0.0, 9.81]
        axes, yaw = turned(s[quaternion]), 0.8 * np.sin(TAU * rate[3] * t)
        up = wanted / np.linalg.norm(wanted)
        side = np.cross(up, [np.cos(yaw), np.sin(yaw), 0.0])
        side /= np.linalg.norm(side)
        goal = np.stack([np.cross(side, up), side, up], axis=1)
        off = 0.5 * (goal.T @ axes - axes.T @ goal)
        turn = -90.0 * np.array([off[2, 1], off[0, 2], off[1, 0]]) - 14.0 * s[angular]
        turn[:2] += 3.0 * rng.normal(size=2)
        return np.asarray(np.linalg.solve(mixed, [mass * wanted @ axes[:, 2], *inertia * turn]))

    return command


def _boat(model: Any, at: Mapping[str, int], rng: np.random.Generator) -> Pilot:
    """Keeps to a speed and a turn, each held for a second and a half to five."""
    quaternion = [at[f"base.{part}"] for part in ("qw", "qx", "qy", "qz")]
    linear, yaw = [at[f"base.v{a}"] for a in "xyz"], at["base.wz"]
    mass, inertia = float(model.body_mass[1]), float(model.body_inertia[1, 2])
    held = {"until": -1.0, "speed": 0.0, "turn": 0.0}

    def command(t: float, s: FloatArray) -> FloatArray:
        if t >= held["until"]:
            held["until"] = t + rng.uniform(1.5, 5.0)
            held["speed"], held["turn"] = rng.uniform(-0.2, 1.0), rng.uniform(-0.8, 0.8)
        ahead = float(turned(s[quaternion])[:, 0] @ s[linear])
        push, torque = mass * (held["speed"] - ahead), 1.5 * inertia * (held["turn"] - s[yaw])
        return np.array([0.5 * push - torque / 0.2, 0.5 * push + torque / 0.2])

    return command


def _hopper(model: Any, at: Mapping[str, int], rng: np.random.Generator) -> Pilot:
    """Squats and sways on its foot by torques that hold its joints."""
    joints = [at[f"{j}_joint"] for j in ("thigh", "leg", "foot")]
    rates = [i + 1 for i in joints]
    size, rate = rng.uniform(0.02, 0.12, 3), rng.uniform(0.4, 2.0, 3)
    phase, gear = rng.uniform(0.0, TAU, 3), np.array(model.actuator_gear)[:, 0]

    def command(t: float, s: FloatArray) -> FloatArray:
        wanted = NOMINAL["hopper"] + size * [1.0, 2.0, 1.0] * np.sin(TAU * rate * t + phase)
        torque = 600.0 * (wanted - s[joints]) - 50.0 * s[rates]
        return np.asarray(torque / gear)

    return command


def _dog(model: Any, at: Mapping[str, int], rng: np.random.Generator) -> Pilot:
    """Trots on the spot by torques towards winding references of its joints."""
    joints = [i for name, i in at.items() if f"{name}_dot" in at]
    rates = [i + 1 for i in joints]
    stride, lift = rng.uniform(1.2, 2.2), rng.uniform(0.08, 0.26)
    size, rate, phase = rng.uniform(0.02, 0.13, 12), rng.uniform(0.4, 1.5, 12), rng.uniform(0.0, TAU, 12)

    def command(t: float, s: FloatArray) -> FloatArray:
        begun = float(np.clip((t + SETTLES) / SETTLES, 0.0, 1.0))
        wanted = NOMINAL["dog"] + begun * size * np.sin(TAU * rate * t + phase)
        up = np.maximum(np.sin(TAU * stride * t + np.array([0.0, np.pi, np.pi, 0.0])), 0.0) * begun * lift
        wanted[1::3] += 1.2 * up
        wanted[2::3] -= 2.4 * up
        return np.asarray(60.0 * (wanted - s[joints]) - 1.2 * s[rates])

    return command


SETTLES = 0.5  # s that legs stand before they are recorded
PILOTS: Mapping[str, Callable[[Any, Mapping[str, int], np.random.Generator], Pilot]] = {
    "quadrotor": _quadrotor,
    "boat": _boat,
    "hopper": _hopper,
    "dog": _dog,
}
