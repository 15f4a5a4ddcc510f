"""How a concealed world is driven: an open-loop signal, feedback from what is measured, or a controller that tracks.

Trapezoids of velocity and triangles of position are those of axes (Janot, Gautier and Brunot 2019: the EMPS benchmark);
multisines are those of robots (Swevers et al. 1997).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials.worlds import SYSTEMS, World

Rng = np.random.Generator
BODY_SIGNALS = ("bang_bang", "prbs", "chirp", "sines", "controller")
VEHICLE_SIGNALS = ("sweep", "prbs", "chirp", "sines", "controller")
GRADED_SIGNALS = ("chirp", "sines", "controller", "sweep")
"""Excitations whose commands take many values: what a dead zone or a saturation needs to be seen."""
TRACKING = "tracking"
CLOSED_LOOP = (TRACKING, "controller")
"""Excitations in which what is measured decides what is commanded."""
REFERENCES = ("trapezoid", "triangle", "multisine")
"""Excitations that track a reference of that shape."""
FREE = "free"
"""Nothing is commanded: it swings until it stands."""
PLAYED = "played"
"""By commands that were written down, from rest."""
CENTRED = {"x": 0.8, "q": 0.5}  # m: how far a centring feedback lets a body go
CARTS_PUSH = 10.0  # N
LIFTS = 1.2  # times the weight of a servo's pendulum, that it can hold
SWING = 1.4  # rad, or times the usual spread: from how far a free swing begins
AT_HOME = 0.05  # of the usual spread, where a machine begins that tracks a reference
STROKE = {"slider": (0.08, 0.3), "pendulum": (0.5, 1.3), "cartpole": (0.1, 0.35)}  # m, rad
SPEED = {"slider": (0.2, 0.5), "pendulum": (1.0, 3.0), "cartpole": (0.3, 0.7)}  # m/s, rad/s at the most
RAMP = {"slider": (0.8, 2.0), "pendulum": (4.0, 10.0), "cartpole": (0.8, 2.0)}  # m/s^2, rad/s^2
LATE = 0.35  # rad of phase that delays may cost at the loop's bandwidth
SLOWEST, FASTEST = 0.1, 1.0  # Hz of a multisine
DAMPING_RATIO = 0.6
REACH = {"slider": 0.5, "pendulum": 1.0, "cartpole": 0.6, "unicycle": 1.2}  # m, rad: how far references go
UPRIGHT = 0.4  # of that, with a pole to balance
SLOWEST_TURN = 0.3  # of a vehicle's full speed


Driving = Callable[[int, FloatArray], FloatArray]
"""Whatever drives a world: (E, A) what is commanded from sample k to k + 1, given k and the readings (E, S)."""


def drive(world: World) -> Driving:
    """The world's excitation."""
    system = SYSTEMS[world.system]
    push = 0.0 if system.vehicle else _push(world)
    if world.excitation in REFERENCES:
        return _loop(world, push)
    if world.excitation == TRACKING:
        return _tracked(world, push)
    rng = world.generator(1)
    shape = (world.steps, world.episodes, len(system.action))
    signal = _signal(world.excitation, shape, world.dt, rng, system.vehicle)
    if system.vehicle:
        scale = np.array([rng.uniform(0.5, 1.0), rng.uniform(0.7, 1.5)])
        if world.excitation == "controller":
            return _steered(signal, scale)
        return _played(scale * signal, np.zeros((2, 3)), scale)
    if world.excitation == FREE:
        return played(0.0 * signal)
    gains, share = _feedback(world, push)
    scale = np.array([push * share * rng.uniform(0.6, 1.0)])
    return _played(scale * signal, gains, np.array([push]), world.excitation == "bang_bang")


def starts(world: World) -> FloatArray:
    """(E, S) true states at the episodes' starts, at rest."""
    rng, n = world.generator(2), world.episodes
    out = np.zeros((n, len(SYSTEMS[world.system].state)))
    if world.excitation == PLAYED:
        return out
    swing, upright = world.excitation == FREE, world.posture == "upright"
    if world.system == "cartpole":
        out[:, 0] = rng.uniform(-0.3, 0.3, n)
        spread = 0.06 if upright else SWING if swing else 0.5
        out[:, 2] = rng.uniform(-spread, spread, n) + (0 if upright else np.pi)
    elif world.system == "slider":
        out[:, 0] = rng.uniform(-0.3, 0.3, n)
    elif world.system == "pendulum":
        out[:, 0] = rng.uniform(-1.0, 1.0, n) * (SWING if swing else 1.0)
    else:
        out[:, :2] = rng.uniform(-1.0, 1.0, (n, 2))
        out[:, 2] = rng.uniform(-np.pi, np.pi, n)
    if world.excitation in REFERENCES:  # which begin at zero
        out[:, 0] *= AT_HOME
    return out


def sound(world: World, true: FloatArray) -> FloatArray:
    """(E,) how many samples of the true states (K + 1, E, S) an operator would keep before stopping the run."""
    bad = ~np.isfinite(true).all(axis=2) | (np.abs(true) > 1e3).any(axis=2)
    if world.system == "cartpole":
        bad |= np.abs(true[:, :, 0]) > 4.0
        if world.posture == "upright":
            bad |= np.abs(true[:, :, 2]) > 0.9
    return np.where(bad.any(axis=0), np.argmax(bad, axis=0), len(true))


def _clipped(values: FloatArray, limit: FloatArray | float) -> FloatArray:
    return np.asarray(np.maximum(np.minimum(values, limit), -limit))


def played(commands: FloatArray) -> Driving:
    """Commands (K, E, A) that were written down."""
    return lambda k, measured: commands[k]


def _played(signal: FloatArray, gains: FloatArray, limit: FloatArray, switching: bool = False) -> Driving:
    """A signal (K, E, A) and feedback by gains (A, S), clipped to the limit (A,); its sign alone for bang-bang."""

    def command(k: int, measured: FloatArray) -> FloatArray:
        wanted = signal[k] + measured @ gains.T
        return np.asarray(limit * np.where(wanted >= 0, 1.0, -1.0)) if switching else _clipped(wanted, limit)

    return command


def _turned_to(wanted: FloatArray, yaw: FloatArray) -> FloatArray:
    """(E,) rad by which a vehicle has to turn, the shorter way."""
    return np.asarray((wanted - yaw + np.pi) % (2 * np.pi) - np.pi)


def _steered(signal: FloatArray, limit: FloatArray) -> Driving:
    """Drive on a circle of 1 m about the origin, speed and turn rate dithered by a signal (K, E, 2) in [-1, 1]."""

    def command(k: int, measured: FloatArray) -> FloatArray:
        x, y, yaw = measured.T
        wanted = np.arctan2(y, x) + np.pi / 2 + np.arctan2(np.hypot(x, y) - 1.0, 0.5)
        turn = 1.5 * _turned_to(wanted, yaw) + limit[1] * signal[k, :, 1]
        v = limit[0] * (0.6 + 0.4 * signal[k, :, 0])
        return np.stack([v, _clipped(turn, limit[1])], axis=1)

    return command


def _pursuing(carrot: FloatArray, dither: FloatArray, limit: FloatArray) -> Driving:
    """A vehicle that drives for a carrot (K, E, 2) that moves, the slower the nearer it is; dither: (K, E, 2)."""

    def command(k: int, measured: FloatArray) -> FloatArray:
        away = carrot[k] - measured[:, :2]
        error = _turned_to(np.arctan2(away[:, 1], away[:, 0]), measured[:, 2])
        near = np.maximum(np.minimum(np.hypot(*away.T) + dither[k, :, 0], 1.0), SLOWEST_TURN)
        turn = 1.5 * error + limit[1] * dither[k, :, 1]
        return np.stack([limit[0] * near, _clipped(turn, limit[1])], axis=1)

    return command


def _pid(reference: FloatArray, gains: FloatArray, integral: float, limit: float, dt: float) -> Driving:
    """A PID controller: clip(kp e + kd e' + ki integral of e), e = reference (K, E, S) - reading; gains (S,)."""
    summed = np.zeros(reference.shape[1])  # of the error over time

    def command(k: int, measured: FloatArray) -> FloatArray:
        error = reference[k] - measured
        wanted = error @ gains + integral * summed
        free = np.abs(wanted) < limit  # no winding up while it can do no more
        summed[:] = summed + dt * np.where(free, error[:, 0], 0.0)
        return np.asarray(np.clip(wanted, -limit, limit))[:, None]

    return command


def _push(world: World) -> float:
    """N, N m: the most that is commanded."""
    p = world.parameters
    if world.system == "cartpole":
        return CARTS_PUSH
    if world.system == "slider":
        return 3.0 * p["mass"]
    return (LIFTS if world.machine else 0.6) * p["mass"] * p["gravity"] * p["length"]


def _inertia(world: World) -> float:
    """What a push on the first coordinate has to move."""
    p = world.parameters
    if world.system == "cartpole":
        return p["cart_mass"] + p["pole_mass"]
    return p["mass"] if world.system == "slider" else p["mass"] * p["length"] ** 2


def _balance(push: float) -> FloatArray:
    """Pole placement by hand for a pole of about a metre; found good for the whole range of parameters."""
    return push / 10 * np.array([[1.5, 3.5, 38.0, 8.0]])


def _feedback(world: World, push: float) -> tuple[FloatArray, float]:
    """Gains (1, S) and the share of the push that the open-loop signal gets."""
    controlled = world.excitation == "controller"
    if world.system == "slider":
        return -push * np.array([[1.0 / CENTRED["q"], 0.5]]) * (1.0 if controlled else 0.4), 0.8
    if world.system == "pendulum":
        return -push * np.array([[0.0, 0.12]]) * (2.0 if controlled else 1.0), 0.9
    if world.posture == "upright":
        return _balance(push), 0.35 if world.excitation != "bang_bang" else 0.6
    return -push * np.array([[0.5, 0.25, 0.0, 0.0]]), 0.8


def _signal(kind: str, shape: tuple[int, int, int], dt: float, rng: Rng, vehicle: bool) -> FloatArray:
    """(K, E, A) in [-1, 1]."""
    steps, episodes, actions = shape
    t = dt * np.arange(steps)[:, None, None]
    unit = 2.0 if vehicle else 1.0  # vehicles are slower
    if kind == "sweep":
        hold = max(round(rng.uniform(1.0, 2.5) / dt), 1)
        levels = rng.integers(-5, 6, (steps // hold + 1, episodes, actions)) / 5.0
        levels[..., 0] = np.abs(levels[..., 0]) * 0.8 + 0.2
        return np.repeat(levels, hold, axis=0)[:steps]
    if kind in ("bang_bang", "prbs"):
        clock = int(rng.integers(3, 9)) if kind == "prbs" else 1
        stay = 0.5 if kind == "prbs" else 1.0 - 1.0 / rng.uniform(4, 12)
        flips = rng.random((steps // clock + 1, episodes, actions)) > stay
        sign = np.where(rng.random((1, episodes, actions)) < 0.5, 1.0, -1.0)
        binary = sign * np.where(np.cumsum(flips, axis=0) % 2 == 0, 1.0, -1.0)
        out = np.repeat(binary, clock, axis=0)[:steps]
        if vehicle:
            out[..., 0] = 0.65 + 0.35 * out[..., 0]
        return out
    if kind == "chirp":
        low, high = 0.15 / unit, rng.uniform(1.0, 2.5) / unit
        phase = rng.uniform(0, 2 * np.pi, (1, episodes, actions))
        up = 2 * np.pi * (low * t + (high - low) * t**2 / (2 * t[-1]))
        out = np.sin(up * (1.0 + 0.23 * np.arange(actions)) + phase)
    elif kind == "sines":
        frequency = np.exp(rng.uniform(np.log(0.15 / unit), np.log(2.5 / unit), (5, 1, episodes, actions)))
        phase = rng.uniform(0, 2 * np.pi, (5, 1, episodes, actions))
        out = np.sin(2 * np.pi * frequency * t + phase).sum(axis=0) / 2.5
    else:
        hold = int(rng.integers(1, 6))
        levels = rng.uniform(-1, 1, (steps // hold + 1, episodes, actions))
        out = np.repeat(levels, hold, axis=0)[:steps] * (0.6 if vehicle else 1.0)
    if vehicle and kind != "controller":
        out[..., 0] = 0.6 + 0.4 * out[..., 0]
    return np.asarray(out)


def _tracked(world: World, push: float) -> Driving:
    """A damped second-order loop on the first coordinate, as stiff as the push allows; a vehicle's pursuit."""
    rng, system = world.generator(1), SYSTEMS[world.system]
    shape = (world.steps, world.episodes)
    amplitude = REACH[world.system] * rng.uniform(0.6, 1.0)
    share = rng.uniform(0.08, 0.2)
    hold = int(rng.integers(2, 7))
    levels = rng.uniform(-1, 1, (world.steps // hold + 1, world.episodes, len(system.action)))
    dither = share * np.repeat(levels, hold, axis=0)[: world.steps]
    if system.vehicle:
        carrot = np.stack([_path(shape, world.dt, 0.12, rng) for _ in range(2)], axis=2)
        limit = np.array([rng.uniform(0.5, 1.0), rng.uniform(0.8, 1.5)])
        return _pursuing(amplitude * carrot, dither, limit)
    balancing = world.posture == "upright"
    if balancing:
        amplitude *= UPRIGHT
    reference = np.zeros((*shape, len(system.state)))
    reference[..., 0] = amplitude * _path(shape, world.dt, 0.15 if balancing else 0.5, rng)
    if rng.random() < 0.5 and not balancing:  # steps from one place to the next
        stay = max(round(rng.uniform(0.8, 2.0) / world.dt), 1)
        reference[..., 0] = np.repeat(reference[::stay, :, 0], stay, axis=0)[: world.steps]
    else:
        reference[..., 1] = np.gradient(reference[..., 0], world.dt, axis=0)
    gains = -_balance(push)
    if not balancing:
        stiffness, inertia = push * rng.uniform(1.0, 2.0), _inertia(world)
        stiffness /= REACH[world.system] if world.system != "pendulum" else 1.0
        gains = np.zeros((1, len(system.state)))
        gains[0, :2] = stiffness, 2 * DAMPING_RATIO * np.sqrt(stiffness * inertia)
    dither = push * dither
    return lambda k, measured: _clipped((reference[k] - measured) @ gains.T + dither[k], push)


def _path(shape: tuple[int, int], dt: float, fastest: float, rng: Rng) -> FloatArray:
    """(K, E) in about [-1, 1]: four slow sines an episode, the fastest of `fastest` Hz."""
    t = dt * np.arange(shape[0])[:, None]
    frequency = np.exp(rng.uniform(np.log(fastest / 6), np.log(fastest), (4, 1, shape[1])))
    phase = rng.uniform(0, 2 * np.pi, (4, 1, shape[1]))
    return np.asarray(np.sin(2 * np.pi * frequency * t + phase).sum(axis=0) / 2.0)


def _loop(world: World, push: float) -> Driving:
    """The controller of a machine that tracks a reference as identification uses it."""
    rng, dt = world.generator(1), world.dt
    t: FloatArray = dt * np.arange(world.steps, dtype=np.float64)
    paths = [
        _multisine(t, world.system, rng)
        if world.excitation == "multisine"
        else _to_and_fro(t, world.system, world.excitation, rng)
        for _ in range(world.episodes)
    ]
    path = np.stack(paths, axis=1)
    reference = np.zeros((*path.shape, len(SYSTEMS[world.system].state)))
    reference[..., 0], reference[..., 1] = path, np.gradient(path, dt, axis=0)
    inertia, bandwidth = _inertia(world), LATE / (2.5 * dt + 0.02)
    stiffness = inertia * bandwidth**2
    gains = np.zeros(reference.shape[2])
    gains[:2] = stiffness, 1.8 * inertia * bandwidth
    integral = stiffness * bandwidth / 6 if rng.random() < 0.5 else 0.0
    return _pid(reference, gains, integral, push, dt)


def _multisine(t: FloatArray, system: str, rng: Rng) -> FloatArray:
    """Five sines whose fastest motion is a usual one, begun at rest."""
    frequency = np.exp(rng.uniform(np.log(SLOWEST), np.log(FASTEST), 5))
    phase, size = rng.uniform(0, 2 * np.pi, 5), 1.0 / frequency
    path = (size[:, None] * np.sin(2 * np.pi * frequency[:, None] * t + phase[:, None])).sum(axis=0)
    speed = np.abs(np.gradient(path, t[1])).max()
    path *= min(rng.uniform(*SPEED[system]) / speed, STROKE[system][1] / np.abs(path).max())
    return np.asarray(path * np.minimum(t / 0.5, 1.0))


def _to_and_fro(t: FloatArray, system: str, shape: str, rng: Rng) -> FloatArray:
    """From one random place to the next by trapezoids of velocity; a triangle has ten times steeper ramps."""
    ramp = rng.uniform(*RAMP[system]) * (10.0 if shape == "triangle" else 1.0)
    path, place, k = np.zeros(len(t)), 0.0, 0
    while k < len(t):
        target = rng.choice([-1.0, 1.0]) * rng.uniform(*STROKE[system])
        if target * place > 0:
            target = -target
        speed, pause = rng.uniform(*SPEED[system]), rng.uniform(0.0, 0.4)
        move = _trapezoid(abs(target - place), speed, ramp, t[1])
        part = place + np.sign(target - place) * move
        part = np.concatenate([part, np.full(int(pause / t[1]), target)])[: len(t) - k]
        path[k : k + len(part)] = part
        k, place = k + len(part), target
    return path


def _trapezoid(way: float, speed: float, ramp: float, dt: float) -> FloatArray:
    """Positions from 0 to `way` with a trapezoid of velocity."""
    speed = min(speed, float(np.sqrt(way * ramp)))
    rise, whole = speed / ramp, way / speed + speed / ramp
    t = np.arange(dt, whole + dt, dt)
    early = 0.5 * ramp * np.minimum(t, rise) ** 2
    cruise = speed * np.clip(t - rise, 0.0, whole - 2 * rise)
    late = np.clip(t - (whole - rise), 0.0, rise)
    return np.asarray(early + cruise + speed * late - 0.5 * ramp * late**2)
