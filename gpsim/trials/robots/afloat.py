"""What floats, flies or stands: which robot a world is of, and what it lacks, in sizes as of real machines.

- Quadrotor: rotors drag by 0.2 to 0.6 N s/m a kilogram along the body (0.54 and 0.39 identified by Faessler, Franchi
  and Scaramuzza 2018), less across; the frame by 0.01 to 0.03 N s^2/m^2, which is 200 to 500 cm^2 at a drag coefficient
  of one. A wind of 2 to 6 m/s pushes it by 0.05 to 0.4 N. Batteries and cameras are 5 to 20 % of the mass, moments of
  inertia of a drawing are off by 10 to 30 %. A chipped or worn propeller gives 3 to 15 % less thrust, another kind
  more. Rotors follow within 12 to 50 ms (RotorS has 12.5 up and 25 down, Furrer et al. 2016), radios are late by 5 to
  30 ms.
- Boat: half to twice the damping of CyberShip II (Skjetne, Smogeli and Fossen 2004), of which 0.72, 0.89 N s/m and
  1.9 N m s are linear and 1.33, 36.5 N s^2/m^2 and 0.75 N m s^2 quadratic, in surge, sway and yaw. Wind of 0.1 to 0.6 N
  is 3 to 6 m/s on 400 cm^2. Thrusters lag by 0.1 to 0.4 s, a link is late by 50 to 200 ms.
- Hopper and dog: one joint or another rubs as those of `whole` do, in proportion to its drive's torque, or has a
  rotor; a trunk that is loaded; a floor as slippery as wet tiles; commands late by 3 to 15 ms.

A quarter of the worlds lacks nothing. Half of what floats is read by a motion capture alone: no twist.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping

import numpy as np

from gpsim.trials.drawing import digits
from gpsim.trials.robots.floating import STEPS
from gpsim.trials.robots.models import AFLOAT, layout_of, robot_of
from gpsim.trials.worlds import FROM, TrueEffect, World, log_even, numbered, rounded

FLOATING = ("quadrotor", "boat")  # nothing touches them
MOST = 5  # effects of a world
SECONDS = {"quadrotor": 8.0, "boat": 24.0, "hopper": 4.0, "dog": 4.0}  # of an episode
TRANSITIONS, EPISODES = 3200, 6  # at least
PLACES, TILTS = (3e-4, 2e-3), (np.deg2rad(0.1), np.deg2rad(0.5))  # noise of a motion capture, m and rad
SPEEDS, RATES = (5e-3, 2e-2), (5e-3, 2e-2)  # of a filter, m/s and of a gyroscope, rad/s
ENCODERS, ENCODER_SPEEDS = (1e-4, 5e-4), (2e-3, 1e-2)  # rad and rad/s
Drawn = Callable[[np.random.Generator], float]


def _size(low: float, high: float) -> Drawn:
    """Evenly in the logarithm."""
    return lambda rng: rounded(log_even(rng, low, high))


def _signed(low: float, high: float) -> Drawn:
    return lambda rng: rounded(float(rng.choice([-1.0, 1.0])) * _size(low, high)(rng))


def _off(low: float, high: float, less: float = 0.5) -> Drawn:
    """A ratio that far from one; less: how often below."""
    return lambda rng: rounded(1.0 + _size(low, high)(rng) * (-1.0 if rng.random() < less else 1.0))


def _late(low: float, high: float, step: float) -> Drawn:
    """A whole number of the truth's steps."""
    return lambda rng: round(round(_size(low, high)(rng) / step) * step, 9)


Item = tuple[str, tuple[str, ...], str, Drawn]
"""Family, places (all of them alike), the parameter's name, its size."""


def items_of(name: str) -> list[Item]:
    """What a robot may lack."""
    actions = tuple(layout_of(name).action)

    def late(lag: tuple[float, float] | None, delay: tuple[float, float]) -> list[Item]:
        lags: list[Item] = [("actuator_lag", actions, "time_constant", _size(*lag))] if lag else []
        return [*lags, ("actuator_delay", actions, "delay", _late(*delay, STEPS[name]))]

    def gains(low: float, high: float) -> list[Item]:
        return [("actuator_gain", (a,), "gain", _off(low, high, less=0.7)) for a in actions]

    def axes(family: str, parameter: str, sizes: Mapping[str, tuple[float, float]]) -> list[Item]:
        drawn = _signed if family == "constant_force" else _size
        return [(family, (f"base.{axis}",), parameter, drawn(*size)) for axis, size in sizes.items()]

    def body(on: str, mass: tuple[float, float], inertia: tuple[float, float] | None = None) -> list[Item]:
        sizes = {"mass": mass, "inertia": inertia} if inertia else {"mass": mass}
        return [("parameter_offset", (f"{on}.{what}",), "ratio", _off(*s)) for what, s in sizes.items()]

    def joints(
        dry: tuple[float, float], viscous: tuple[float, float], rotor: tuple[float, float]
    ) -> list[Item]:
        laws = {"coulomb_friction": ("force", dry), "viscous_friction": ("damping", viscous)}
        laws["armature"] = ("inertia", rotor)
        moved = layout_of(name).driven.values()
        return [(f, (j,), p, _size(*size)) for f, (p, size) in laws.items() for j in moved]

    if name == "quadrotor":
        along = {"surge": (0.14, 0.43), "sway": (0.14, 0.43), "heave": (0.05, 0.2)}
        return [
            *axes("viscous_friction", "damping", along),
            *axes("quadratic_drag", "drag", dict.fromkeys(("surge", "sway", "heave"), (0.01, 0.03))),
            *axes("constant_force", "force", dict.fromkeys("xy", (0.05, 0.4))),
            *body("frame", (0.05, 0.2), (0.1, 0.3)),
            *gains(0.03, 0.15),
            *late((0.012, 0.05), (0.005, 0.03)),
        ]
    if name == "boat":
        along = {"surge": (0.36, 1.44), "sway": (0.45, 1.8), "yaw": (0.95, 3.8)}
        return [
            *axes("viscous_friction", "damping", along),
            *axes("quadratic_drag", "drag", {"surge": (0.66, 2.7), "sway": (18.0, 73.0), "yaw": (0.38, 1.5)}),
            *axes("constant_force", "force", dict.fromkeys("xy", (0.1, 0.6))),
            *body("hull", (0.05, 0.25), (0.1, 0.3)),
            *gains(0.05, 0.2),
            *late((0.1, 0.4), (0.05, 0.2)),
        ]
    if name == "hopper":
        rows = joints((2.0, 12.0), (0.7, 4.0), (0.1, 0.5))
        return [*rows, *body("torso", (0.1, 0.4)), *late(None, (0.003, 0.015))]
    floor: list[Item] = [("parameter_offset", ("floor.friction",), "ratio", _off(0.3, 0.6, less=1.0))]
    rows = joints((0.24, 1.4), (0.05, 0.3), (0.003, 0.015))
    return [*rows, *body("trunk", (0.05, 0.3)), *floor, *late(None, (0.003, 0.015))]


def dealt(seed: int, rank: int) -> tuple[str, bool, bool]:
    """The robot of a world, whether it lacks nothing, whether its twist is read: each once in every cycle of four.

    In four cycles each robot lacks nothing once.
    """
    cycle, place = divmod(rank, len(AFLOAT))
    rng = np.random.default_rng([seed, FROM["afloat"], cycle // len(AFLOAT)])
    orders = [rng.permutation(len(AFLOAT)) for _ in AFLOAT]
    nothing, speeds = rng.integers(len(AFLOAT), size=len(AFLOAT)), rng.permutation(len(AFLOAT)) % 2
    which, turn = int(orders[cycle % len(AFLOAT)][place]), cycle % len(AFLOAT)
    name = list(AFLOAT)[which]
    return name, bool(nothing[which] == turn), name not in FLOATING or bool(speeds[(turn + which) % 4])


def draw_afloat(seed: int, number: int, attempt: int = 0) -> World:
    """The world of a trial; `attempt` counts worlds that could not be run, or in which an effect did not show."""
    rank = numbered(number)[1] - 1
    name, nothing, speeds = dealt(seed, rank)
    rng = np.random.default_rng([seed, number, attempt, 0])
    dt = float(rng.choice(robot_of(name).steps))
    steps = round(SECONDS[name] / dt)
    return World(
        seed=seed, number=number, attempt=attempt, stratum="afloat", system=name, dt=dt, engine="mujoco",
        effects=() if nothing else _effects(name, rng),
        episodes=max(int(np.ceil(TRANSITIONS / steps)), EPISODES if dt > 0.005 else EPISODES - 2), steps=steps,
        excitation="control", noise=_noise(name, rng), noise_known=bool(rng.random() < 0.5),
        velocities="measured" if speeds else None,
    )  # fmt: skip


def _effects(name: str, rng: np.random.Generator) -> tuple[TrueEffect, ...]:
    """One to five, every family as likely as another, wherever it may act."""

    def clash(one: Item, other: Item) -> bool:
        """Two that act late; two drags along one axis of what flies, whose speeds are too alike to tell them apart."""
        late = {one[0], other[0]} == {"actuator_lag", "actuator_delay"}
        return late or (name == "quadrotor" and one[1] == other[1])

    items, wanted = items_of(name), int(rng.integers(1, MOST + 1))
    many = Counter(family for family, *_ in items)
    likely = [1.0 / many[family] / len(many) for family, *_ in items]
    chosen: list[Item] = []
    for i in rng.choice(len(items), len(items), replace=False, p=likely):
        if len(chosen) < wanted and not any(clash(items[i], other) for other in chosen):
            chosen.append(items[i])
    sized = [(family, places, {parameter: drawn(rng)}) for family, places, parameter, drawn in chosen]
    return tuple(TrueEffect(family, on, values) for family, places, values in sized for on in places)


def _noise(name: str, rng: np.random.Generator) -> dict[str, float]:
    """Of every channel; a quaternion's parts have half of an angle's."""
    layout = layout_of(name)
    place, tilt, speed, turn = (_size(*size)(rng) for size in (PLACES, TILTS, SPEEDS, RATES))
    joint, joint_speed = (_size(*size)(rng) for size in (ENCODERS, ENCODER_SPEEDS))
    captured = {"m": place, "1": 0.5 * tilt, "rad": tilt, "m/s": speed, "rad/s": turn}
    encoded = {"rad": joint, "rad/s": joint_speed}
    read = {c for j in layout.driven.values() for c in (j, f"{j}_dot")}
    sizes = {c: (encoded if c in read else captured)[unit] for c, unit in layout.state.items()}
    return {channel: digits(sd) for channel, sd in sizes.items()}
