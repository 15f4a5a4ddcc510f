"""Worlds with a known truth, made by an integrator that shares no code with the one that explains them.

Mass matrices inverted by Cramer's rule, Runge-Kutta steps of 2 ms, friction handled as events: a body that reaches
zero speed inside a step stops there, and starts again only when the forces exceed what friction can hold.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from gpsim.channels import Channels
from gpsim.recordings import Episode, HeldOut, Recording

H = 2e-3
P = {
    "cartpole": {"gravity": 9.8, "cart_mass": 1.0, "pole_mass": 0.1, "pole_half_length": 0.5},
    "slider": {"mass": 2.0},
    "pendulum": {"gravity": 9.81, "mass": 1.0, "length": 0.5},
    "unicycle": {},
    "ackermann": {"wheelbase": 0.2},
}
STATE = {
    "cartpole": {"x": "m", "x_dot": "m/s", "theta": "rad", "theta_dot": "rad/s"},
    "slider": {"q": "m", "q_dot": "m/s"},
    "pendulum": {"theta": "rad", "theta_dot": "rad/s"},
    "unicycle": {"x": "m", "y": "m", "yaw": "rad"},
    "ackermann": {"x": "m", "y": "m", "yaw": "rad"},
}
ACTION = {
    "cartpole": {"force": "N"},
    "slider": {"force": "N"},
    "pendulum": {"torque": "N m"},
    "unicycle": {"v_cmd": "m/s", "w_cmd": "rad/s"},
    "ackermann": {"v_cmd": "m/s", "steering": "rad"},
}


@dataclass
class World:
    """The truth. forces: coordinate -> f(q, v, t); grips: coordinate -> (f(q, v, normal) sliding, f holding).

    filters: functions (u (E, A), t, h, memory dict) -> (E, A), in order; twist: (v, lateral, w) -> the same, while
    the heading is one of those for which `headings` (E,) -> bool says so;
    sensors: functions (states (K, E, S), times (K,)) -> (K, E, S) on the fine grid of a whole run.
    """

    system: str
    parameters: dict = field(default_factory=dict)
    forces: dict[int, Callable] = field(default_factory=dict)
    grips: dict[int, Callable] = field(default_factory=dict)
    filters: list[Callable] = field(default_factory=list)
    twist: Callable | None = None
    headings: Callable | None = None
    sensors: list[Callable] = field(default_factory=list)


def accelerations(world, state, u, extra):
    """(E, C) accelerations and the cart's normal force (E,) or None under extra generalised forces (E, C)."""
    p = {**P[world.system], **world.parameters}
    if world.system == "slider":
        return (u + extra) / p["mass"], None
    if world.system == "pendulum":
        inertia = p["mass"] * p["length"] ** 2
        torque = u + extra - p["mass"] * p["gravity"] * p["length"] * np.sin(state[:, :1])
        return torque / inertia, None
    m, mc, length, g = p["pole_mass"], p["cart_mass"], p["pole_half_length"], p["gravity"]
    th, om = state[:, 2], state[:, 3]
    mass = np.empty((len(state), 2, 2))
    mass[:, 0, 0], mass[:, 1, 1] = mc + m, m * length**2 + m * (2 * length) ** 2 / 12
    mass[:, 0, 1] = mass[:, 1, 0] = m * length * np.cos(th)
    right = np.stack([u[:, 0] + m * length * om**2 * np.sin(th), m * g * length * np.sin(th)], axis=1) + extra
    determinant = mass[:, 0, 0] * mass[:, 1, 1] - mass[:, 0, 1] ** 2
    acc = np.stack(
        [
            (mass[:, 1, 1] * right[:, 0] - mass[:, 0, 1] * right[:, 1]) / determinant,
            (mass[:, 0, 0] * right[:, 1] - mass[:, 1, 0] * right[:, 0]) / determinant,
        ],
        axis=1,
    )
    rise = -length * (acc[:, 1] * np.sin(th) + om**2 * np.cos(th))
    return acc, mc * g + m * (g + rise)


def mechanical_slope(world, state, u, t, direction):
    """d state / dt when friction opposes `direction` (E, C) in {-1, 0, 1}; 0 holds the coordinate still if it can."""
    q, v = state[:, 0::2], state[:, 1::2]
    smooth = np.zeros_like(q)
    for c, force in world.forces.items():
        smooth[:, c] += force(q[:, c], v[:, c], t)
    acc, normal = accelerations(world, state, u, smooth)
    for c, grip in world.grips.items():
        friction = np.zeros_like(q)
        unit = np.zeros_like(q)
        unit[:, c] = 1.0
        free, _ = accelerations(world, state, u, smooth)
        mobility = accelerations(world, state, u, smooth + unit)[0][:, c] - free[:, c]
        for _ in range(3 if normal is not None else 1):  # the normal force depends a little on the friction
            most = grip(q[:, c], v[:, c], normal)
            hold = np.clip(-free[:, c] / mobility, -most, most)
            friction[:, c] = np.where(direction[:, c] == 0, hold, -direction[:, c] * most)
            acc, normal = accelerations(world, state, u, smooth + friction)
        smooth = smooth + friction
    out = np.empty_like(state)
    out[:, 0::2], out[:, 1::2] = v, acc
    return out


def mechanical_step(world, state, u, t, h):
    if not world.grips:
        return rk4(
            lambda s, time: mechanical_slope(world, s, u, time, np.zeros((len(s), s.shape[1] // 2))),
            state,
            t,
            h,
        )
    direction = np.sign(state[:, 1::2])
    new = rk4(lambda s, time: mechanical_slope(world, s, u, time, direction), state, t, h)
    for c in world.grips:
        before, after = state[:, 2 * c + 1], new[:, 2 * c + 1]
        crossed = (direction[:, c] != 0) & (before * after < 0)
        if not crossed.any():
            continue
        share = before[crossed] / (before[crossed] - after[crossed])
        rows = state[crossed] + share[:, None] * (new[crossed] - state[crossed])
        rows[:, 2 * c + 1] = 0.0
        rest = ((1 - share) * h)[:, None]
        still = np.sign(rows[:, 1::2])
        new[crossed] = rows + rest * mechanical_slope(world, rows, u[crossed], t, still)
        moved = new[crossed, 2 * c + 1]
        new[crossed, 2 * c + 1] = np.where(np.abs(moved) < 1e-12, 0.0, moved)
    return new


def rk4(slope, s, t, h):
    k1 = slope(s, t)
    k2 = slope(s + h / 2 * k1, t + h / 2)
    k3 = slope(s + h / 2 * k2, t + h / 2)
    k4 = slope(s + h * k3, t + h)
    return s + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


def vehicle_step(world, state, u, t, h):
    p = {**P[world.system], **world.parameters}
    v, w = u[:, 0], u[:, 1] if world.system == "unicycle" else u[:, 0] * np.tan(u[:, 1]) / p["wheelbase"]
    plain = v, 0 * v, w
    twisted = world.twist(*plain) if world.twist else plain
    acts = world.headings(state[:, 2]) if world.headings else np.ones(len(state), dtype=bool)
    v, lateral, w = (np.where(acts, a, b) for a, b in zip(twisted, plain, strict=True))

    def slope(s, _):
        sin, cos = np.sin(s[:, 2]), np.cos(s[:, 2])
        return np.stack([v * cos - lateral * sin, v * sin + lateral * cos, w], axis=1)

    return rk4(slope, state, t, h)


def excite(system, rng, episodes, steps, dt, state, previous, k, hold):
    """The command of every episode at step k: random levels held for a while, and enough feedback to stay around."""
    if k % hold == 0:
        shape = (episodes, len(ACTION[system]))
        scale = {
            "cartpole": [9.0], "slider": [6.0], "pendulum": [3.0], "unicycle": [0.8, 1.2], "ackermann": [0.8, 0.3],
        }[system]  # fmt: skip
        previous["level"] = rng.uniform(-1, 1, shape) * scale
    level = previous["level"]
    if system == "cartpole":
        gains = np.array([1.0, 2.5, 32.0, 6.0])
        return np.clip(level + state @ gains[:, None], -14, 14)
    if system == "slider":
        return level - 3.0 * state[:, :1]
    return level


def record(
    world: World,
    *,
    seed: int = 0,
    episodes: int = 10,
    steps: int = 250,
    dt: float | None = None,
    noise: float = 1.0,
    known_noise: bool = True,
    differentiated: bool = False,
    integrator: str = "euler",
    session: bool = False,
    euler_truth: bool = False,
    hold: int | None = None,
) -> Recording:
    """Drive the world and write down what the sensors said. noise 1 is a decent sensor, 0 a perfect one.

    hold: steps for which a random command is held, 4 to 8 without it.
    """
    rng = np.random.default_rng(seed)
    vehicle = world.system in ("unicycle", "ackermann")
    dt = dt or (0.1 if vehicle else 0.02)
    channels, actions = (
        Channels.of(STATE[world.system], ("yaw",) if vehicle else ()),
        Channels.of(ACTION[world.system]),
    )
    sigma = {"m": 0.001, "rad": 0.002, "m/s": 0.01, "rad/s": 0.02}
    if vehicle:
        sigma = {"m": 0.003, "rad": 0.005}
    sd = noise * np.array([sigma[unit] for unit in channels.units.values()])
    n_fine = max(1, round(dt / (dt if euler_truth else H)))
    h = dt / n_fine
    state = rng.normal(size=(episodes, len(channels))) * (0.3 if not vehicle else 1.0)
    if world.system == "cartpole":
        state *= np.array([1.0, 1.0, 0.3, 0.5])
    memory: dict = {}
    fine, commands, previous = [state], [], {}
    drawn = int(rng.integers(4, 9))  # drawn in any case, so that the rest of the world does not depend on it
    hold = drawn if hold is None else hold
    step = vehicle_step if vehicle else mechanical_step
    offset = np.arange(episodes) * steps * dt if session else np.zeros(episodes)
    for k in range(steps):
        command = excite(world.system, rng, episodes, steps, dt, state, previous, k, hold)
        commands.append(command)
        for j in range(n_fine):
            t = offset + k * dt + j * h
            u = command
            for apply in world.filters:
                u = apply(u, t, h, memory)
            if euler_truth:
                slope = (
                    mechanical_slope(world, state, u, t, np.sign(state[:, 1::2]))
                    if not vehicle
                    else (vehicle_step(replace(world), state, u, t, 1e-7) - state) / 1e-7
                )
                state = state + dt * slope
            else:
                state = step(world, state, u, t, h)
            fine.append(state)
    truth, times = np.stack(fine), h * np.arange(len(fine))
    for sensor in world.sensors:
        truth = sensor(truth, times)
    measured = truth[::n_fine] + rng.normal(size=truth[::n_fine].shape) * sd
    if differentiated:
        measured[:, :, 1::2] = np.gradient(measured[:, :, 0::2], dt, axis=0)
    names = channels.names
    known = {
        n: float(s)
        for n, s in zip(names, sd, strict=True)
        if s > 0 and not (differentiated and n.endswith("_dot"))
    }
    clock = dt * np.arange(steps + 1)
    all_commands = np.stack(commands)
    start = lambda i: offset[i] + (i * dt if session else 0.0)  # noqa: E731 - a session's clock runs on
    return Recording(
        system=world.system,
        state=channels,
        action=actions,
        episodes=tuple(
            Episode(str(i), start(i) + clock, measured[:, i], all_commands[:, i]) for i in range(episodes)
        ),
        dt=dt,
        parameters=P[world.system],
        integrator=integrator,
        velocities=None if vehicle else ("differentiated" if differentiated else "measured"),
        clock="session" if session else "episode",
        noise=known if known_noise else {},
        held_out=HeldOut(episodes_from=round(0.8 * episodes)),
    )
