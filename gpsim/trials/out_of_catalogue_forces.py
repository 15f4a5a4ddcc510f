"""Physics outside the catalogue that acts in a body: forces, some with a hidden state, and inertias.

Materials remember how they were moved, masses are measured by nobody, some forces act on both axes of a cart-pole at
once. The comment above a kind is its law.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials.catalogue import Family, middle, seconds
from gpsim.trials.worlds import SYSTEMS, Dial, Scales, Values, rounded, waves

BOTH: dict[str, Any] = {"systems": ("cartpole",), "on": ("x",)}


def _toggle(k: Values, q: FloatArray, v: FloatArray, t: FloatArray) -> FloatArray:
    x = q - k["centre"]
    return np.asarray(-k["stiffness"] * x * (1.0 - k["rest"] / np.hypot(x, k["aside"])))


def _toggle_drawn(s: Scales, on: str, d: Dial) -> dict[str, float]:
    """It snaps within the range; its typical force in proportion to what moves the body."""
    aside, q = d.any(0.2, 0.5) * s.reach(on), s.column(on)
    unit = {"stiffness": 1.0, "centre": rounded(middle(s, on, d, 0.5)), "aside": rounded(aside)}
    unit["rest"] = rounded(d.any(1.5, 3.0) * aside)
    typical = float(np.sqrt(np.mean(_toggle(unit, q, q, q) ** 2)))
    return {**unit, "stiffness": d.size(0.1, 0.6) * s.force(on) / typical}


def _thinning_drawn(s: Scales, on: str, d: Dial) -> dict[str, float]:
    """Thin already at a part of the typical speed; the strength is its resistance at that speed."""
    slow, exponent, speed = d.any(0.05, 0.2), d.any(0.2, 0.5), s.speed(on)
    thinned = (1.0 + slow**-2) ** ((exponent - 1.0) / 2.0)
    damping = d.size(0.1, 0.6) * s.force(on) / (speed * thinned)
    return {"damping": damping, "speed": slow * speed, "exponent": exponent}


def _crisis(k: Values, q: FloatArray, v: FloatArray, t: FloatArray) -> FloatArray:
    # The same as with an exponential, and no overflow.
    narrow = 0.5 * (1.0 + np.tanh(0.5 * (np.abs(v) - k["critical"]) / k["width"]))
    return np.asarray(-k["drag"] * np.abs(v) * v * (1.0 - k["loss"] * narrow))


def _crisis_drawn(s: Scales, on: str, d: Dial) -> dict[str, float]:
    critical, drag = d.any(0.8, 1.4) * s.speed(on), d.size(0.15, 1.0) * s.force(on) / s.speed(on) ** 2
    return {"drag": drag, "loss": d.any(0.7, 0.85), "critical": critical, "width": 0.08 * critical}


def _gusts(k: Values, q: FloatArray, v: FloatArray, t: FloatArray) -> FloatArray:
    number = np.arange(12)
    frequency = 0.1 * 30.0 ** ((number + 0.37 * np.sin(7.0 * number + k["phase"])) / 11.5)
    phase = 1000.0 * np.sin((number + 1) * (k["phase"] + 0.1))
    now = np.sin(2 * np.pi * t[:, None] * frequency + phase)
    return np.asarray(k["amplitude"] * np.sqrt(2.0 / 12) * now.sum(axis=1))


FORCES: Mapping[str, Family] = {
    # A torque ripple: -A sin(k q + phase).
    "cogging": Family(
        "force", lambda k, q, v, t: -k["amplitude"] * np.sin(k["wave_number"] * q + k["phase"]),
        lambda s, on, d: {"amplitude": d.size(0.1, 0.6) * s.force(on), **waves(s, on, d, 4, 8)}, word="cogging_force",
    ),
    # A force cubic in position: -c q^3.
    "hardening_spring": Family(
        "force", lambda k, q, v, t: -k["cubic"] * q**3,
        lambda s, on, d: {"cubic": d.size(0.1, 0.6) * s.force(on) / s.reach(on) ** 3}, word="cubic_spring",
    ),
    # A magnet that pulls to one place and reaches not far: -A x exp((1 - x^2) / 2), A the most, at x = 1.
    "magnetic_detent": Family(
        "force",
        lambda k, q, v, t: (
            -k["amplitude"] * (x := (q - k["centre"]) / k["reach"]) * np.exp(0.5 * (1.0 - x * x))
        ),
        lambda s, on, d: {
            "amplitude": d.size(0.3, 1.2) * s.force(on), "centre": middle(s, on, d, 0.5),
            "reach": d.any(0.2, 0.4) * s.reach(on),
        },
        since=0,
    ),
    # A one-sided contact: -K x^1.5 (1 + loss v) for x = q - edge > 0, and it never pulls.
    # Hunt and Crossley (1975), Coefficient of restitution interpreted as damping in vibroimpact.
    "soft_stop": Family(
        "force",
        lambda k, q, v, t: (
            -k["stiffness"] * np.maximum(q - k["edge"], 0.0) ** 1.5 * np.maximum(1.0 + k["loss"] * v, 0.0)
        ),
        lambda s, on, d: {
            "edge": float(np.quantile(s.column(on), 0.75)),
            "stiffness": d.size(0.4, 4.0) * s.force(on) / s.reach(on) ** 1.5, "loss": 0.6 / s.speed(on),
        },
        since=0,
    ),
    # A spring across the way that snaps to either side: -K x (1 - L / sqrt(x^2 + b^2)), b off the way, longer than b.
    # x is the distance from its middle. von Mises (1923), Über die Stabilitätsprobleme der Elastizitätstheorie.
    "toggle_spring": Family("force", _toggle, _toggle_drawn, since=2031),
    # A magnet at the end of the way that pushes a like pole on the body back: -A / (1 + (edge - q) / reach)^4.
    # Two dipoles on one axis: the fourth power of their distance (Griffiths, Introduction to Electrodynamics, section
    # 6.1). No more than A beyond the edge.
    "magnetic_bumper": Family(
        "force",
        lambda k, q, v, t: -k["amplitude"] / (1.0 + np.maximum(k["edge"] - q, 0.0) / k["reach"]) ** 4,
        lambda s, on, d: {
            "amplitude": d.size(0.5, 3.0) * s.force(on), "edge": float(np.quantile(s.column(on), 0.9)),
            "reach": d.any(0.8, 1.8) * s.reach(on),
        },
        since=2040,
    ),
    # -a (exp(|v| / v0) - 1) sgn v.
    "exponential_aero": Family(
        "force",
        lambda k, q, v, t: -k["amplitude"] * np.sign(v) * np.expm1(np.minimum(np.abs(v) / k["speed"], 30.0)),
        lambda s, on, d: {
            "amplitude": d.size(0.1, 0.5) * s.force(on) / np.expm1(1.5 / 0.35), "speed": 0.35 * s.speed(on)
        },
    ),
    # A force periodic in speed: -A sin(v / v0).
    "speed_ripple": Family(
        "force", lambda k, q, v, t: -k["amplitude"] * np.sin(v / k["speed"]),
        lambda s, on, d: {"amplitude": d.size(0.1, 0.5) * s.force(on), "speed": d.any(0.15, 0.3) * s.speed(on)},
        since=0,
    ),
    # A magnetic brake that lets go when the body is fast: -2 A x / (1 + x^2), x = v / v0, A the most, at v0.
    # Smythe (1942), On eddy currents in a rotating disk.
    "eddy_brake": Family(
        "force", lambda k, q, v, t: -2.0 * k["amplitude"] * (x := v / k["speed"]) / (1.0 + x * x),
        lambda s, on, d: {"amplitude": d.size(0.1, 0.6) * s.force(on), "speed": d.any(0.3, 0.7) * s.speed(on)},
        since=2028,
    ),
    # A damper whose oil gets thinner the faster it is sheared: -b v (1 + (v / v0)^2)^((n - 1) / 2).
    # Thick when slow; faster than v0 about |v|^n, n < 1. Carreau (1972), Rheological equations from molecular network
    # theories.
    "shear_thinning": Family(
        "force",
        lambda k, q, v, t: -k["damping"] * (1.0 + (v / k["speed"]) ** 2) ** ((k["exponent"] - 1.0) / 2.0) * v,
        _thinning_drawn, since=2029,
    ),
    # A damper with a check valve: -c v towards its side (1 or -1), nothing on the way back.
    "one_way_damper": Family(
        "force", lambda k, q, v, t: -k["damping"] * k["side"] * np.maximum(k["side"] * v, 0.0),
        lambda s, on, d: {"damping": d.size(0.08, 0.7) * s.force(on) / s.speed(on), "side": d.sign()}, since=2030,
    ),
    # A cable on the floor, more of it dragged the farther out: -w |q - anchor| tanh(v / v0).
    # Anchored within the range, so that it goes slack on the way.
    "dragged_cable": Family(
        "force", lambda k, q, v, t: -k["drag"] * np.abs(q - k["anchor"]) * np.tanh(v / k["speed"]),
        lambda s, on, d: {
            "drag": d.size(0.08, 0.5) * s.force(on) / s.reach(on), "anchor": middle(s, on, d, 0.8),
            "speed": d.any(0.05, 0.15) * s.speed(on),
        },
        since=2030,
    ),
    # Dry friction against a belt that runs, or of a pendulum on a shaft that turns: -F tanh((v - belt) / v0).
    # It runs no faster than the body does as a rule, so that this moves to either side of it. Froude's pendulum:
    # Rayleigh (1894), The Theory of Sound, vol. 1.
    "running_belt": Family(
        "force", lambda k, q, v, t: -k["force"] * np.tanh((v - k["belt"]) / k["speed"]),
        lambda s, on, d: {
            "force": d.size(0.08, 0.5) * s.force(on), "belt": d.sign() * d.any(0.3, 0.8) * s.speed(on),
            "speed": d.any(0.05, 0.15) * s.speed(on),
        },
        since=2031,
    ),
    # A bluff body whose wake narrows when it is fast: -c |v| v (1 - loss / (1 + e^(-(|v| - critical) / width))).
    # Achenbach (1972), Experiments on the flow past spheres at very high Reynolds numbers.
    "drag_crisis": Family("force", _crisis, _crisis_drawn, since=2040),
    # A force periodic in time: A sin(2 pi f t + phase).
    "fan": Family(
        "force", lambda k, q, v, t: k["amplitude"] * np.sin(2 * np.pi * k["frequency"] * t + k["phase"]),
        lambda s, on, d: {
            "amplitude": d.size(0.1, 0.6) * s.force(on), "frequency": d.any(0.4, 2.5), "phase": d.any(0, 6.28)
        },
    ),
    # A random force that wanders over seconds: twelve incommensurate waves between 0.1 and 3 Hz, whose frequencies and
    # phases follow from one phase.
    "gusts": Family(
        "force", _gusts, lambda s, on, d: {"amplitude": d.size(0.1, 0.5) * s.force(on), "phase": d.any(0, 6.28)}
    ),
    # Viscous friction that fades as the bearing warms up: -b v (0.1 + 2 e^(-t / T)).
    "fading_damping": Family(
        "force", lambda k, q, v, t: -k["damping"] * v * (0.1 + 2.0 * np.exp(-t / k["time"])),
        lambda s, on, d: {"damping": d.size(0.08, 0.5) * s.force(on) / s.speed(on), "time": 0.3 * s.wall}, since=0,
    ),
    # Gravity modulated by a shaking support: -lever a sin(2 pi f t) sin q.
    "vibrating_pivot": Family(
        "force",
        lambda k, q, v, t: (
            -k["lever"] * k["acceleration"] * np.sin(2 * np.pi * k["frequency"] * t) * np.sin(q)
        ),
        lambda s, on, d: {
            "lever": s.world.parameters["mass"] * s.world.parameters["length"],
            "acceleration": d.size(0.1, 0.6) * s.world.parameters["gravity"], "frequency": d.any(0.5, 3.0),
        },
        ("pendulum",), since=0,
    ),
}  # fmt: skip
"""Of position, velocity and the clock on the wall [s]."""


def _mass(
    pull: Callable[[Values, FloatArray, FloatArray], FloatArray],
    own: Callable[[Values, FloatArray], FloatArray | float] = lambda k, r: 0.0,
) -> Callable[..., Any]:
    """A second mass of k['inertia'] at p, with the velocity r, by Newton's law.

    It pushes the body by `pull` of how far and how fast it is ahead; `own` resists the mass and does not act on the
    body.
    """

    def law(k: Values, q: FloatArray, v: FloatArray, p: FloatArray, r: FloatArray) -> tuple[FloatArray, ...]:
        force = pull(k, p - q, r - v)
        return force, r, -(force + own(k, r)) / k["inertia"]

    return law


AS_THE_BODY: dict[str, Any] = {"site": "hidden force", "start": lambda q, v: (q, v)}


def _knock(k: Values, ahead: FloatArray, faster: FloatArray) -> FloatArray:
    side = np.sign(ahead)
    depth = np.maximum(np.abs(ahead) - k["gap"], 0.0)
    return np.asarray(k["stiffness"] * side * depth * np.maximum(1.0 + k["loss"] * side * faster, 0.0))


def _appendage_drawn(s: Scales, on: str, d: Dial) -> dict[str, float]:
    inertia, turn = d.size(0.2, 0.8) * s.inertia(on), 2 * np.pi * d.any(1.5, 4.0)
    damping = 2 * d.any(0.02, 0.15) * inertia * turn
    return {"inertia": inertia, "stiffness": inertia * turn**2, "damping": damping}


def _load_drawn(s: Scales, on: str, d: Dial) -> dict[str, float]:
    """Buffers that throw the load back within a few samples, and take part of its energy."""
    inertia, turn = d.size(0.15, 0.8) * s.inertia(on), 2 * np.pi * d.any(2.5, 5.0)
    gap, loss = d.any(0.05, 0.25) * s.reach(on), d.any(0.2, 0.8) / s.speed(on)
    return {"inertia": inertia, "gap": gap, "stiffness": inertia * turn**2, "loss": loss}


def _flywheel_drawn(s: Scales, on: str, d: Dial) -> dict[str, float]:
    inertia, grip = d.any(0.4, 1.0) * s.inertia(on), d.size(0.05, 0.4) * s.force(on)
    return {"grip": grip, "inertia": inertia, "speed": d.any(0.05, 0.15) * s.speed(on)}


def _sledge_drawn(s: Scales, on: str, d: Dial) -> dict[str, float]:
    """Lighter than the body, on a rope that jerks it along within a few samples."""
    inertia, turn = d.any(0.1, 0.3) * s.inertia(on), 2 * np.pi * d.any(2.5, 5.0)
    friction, slack = d.size(0.1, 0.6) * s.force(on), d.any(0.2, 0.5) * s.reach(on)
    own = {"friction": friction, "slack": slack, "inertia": inertia, "stiffness": inertia * turn**2}
    return {**own, "speed": d.any(0.05, 0.15) * s.speed(on)}


def _sink_drawn(s: Scales, on: str, d: Dial) -> dict[str, float]:
    inertia, turn = d.size(0.15, 0.8) * s.inertia(on), 2 * np.pi * d.any(1.0, 2.5)
    cubic = inertia * (turn / s.reach(on)) ** 2
    return {"inertia": inertia, "cubic": cubic, "damping": 0.2 * inertia * turn}


def _governor(
    k: Values, q: FloatArray, v: FloatArray, r: FloatArray, w: FloatArray
) -> tuple[FloatArray, ...]:
    """What it takes to speed weights up that move outwards; the weights: flung outwards, drawn back, damped."""
    turn = k["turn"]
    back = turn**2 * (r - 1.0) + 2.0 * k["damping_ratio"] * turn * w
    return -2.0 * k["inertia"] * r * w * v, w, r * v**2 - back


HIDDEN: Mapping[str, Family] = {
    # Hysteresis: force -A z, z' = (v - (|v| z + v |z|) / 2) / width; loading stiff, unloading stiffer.
    # Wen (1976), Method for random vibration of hysteretic systems, with n = 1.
    "bouc_wen": Family(
        "hidden force",
        lambda k, q, v, z, _: (
            -k["amplitude"] * z, (v - 0.5 * (np.abs(v) * z + v * np.abs(z))) / k["width"]
        ),
        lambda s, on, d: {"amplitude": d.size(0.15, 0.7) * s.force(on), "width": d.any(0.2, 0.5) * s.reach(on)},
    ),
    # A spring and a damper in a row, which forgets where it began: force -z, z' = k v - z / T (Maxwell's element).
    # It forgets within about the time in which the body crosses its range.
    "rubber_buffer": Family(
        "hidden force", lambda k, q, v, z, _: (-z, k["stiffness"] * v - z / k["time"]),
        lambda s, on, d: {
            "stiffness": d.size(0.15, 1.0) * s.force(on) / s.reach(on),
            "time": d.any(0.4, 1.2) * s.reach(on) / s.speed(on),
        },
        since=2028,
    ),
    # Grease that gels at rest: force -b z v, z' = (1 - z) / T - |v| z / L, z in (0, 1]; motion breaks the gel down.
    # It gels in about the time in which the body crosses its range, and breaks down in a part of that range. Moore
    # (1959), The rheology of ceramic slips and bodies; Mewis and Wagner (2009), Thixotropy, section 4.
    "thixotropic_grease": Family(
        "hidden force",
        lambda k, q, v, z, _: (-k["damping"] * z * v, (1.0 - z) / k["time"] - np.abs(v) * z / k["way"]),
        lambda s, on, d: {
            "damping": d.size(0.2, 1.6) * s.force(on) / s.speed(on),
            "time": d.any(0.5, 1.5) * s.reach(on) / s.speed(on), "way": d.any(0.2, 0.6) * s.reach(on),
        },
        since=2029, first=1.0,
    ),
    # A pad that grips less when it is hot: -F / (1 + z) tanh(v / v0), T z' = fade |v| / V - z; cold at the start.
    # Hot after a part of an episode; then it grips with a third of its force. Brake fade (Limpert, Brake Design and
    # Safety, chapter 4), the heat in proportion to the speed.
    "fading_brake": Family(
        "hidden force",
        lambda k, q, v, z, _: (
            -k["force"] / (1.0 + z) * np.tanh(v / k["speed"]),
            (k["fade"] * np.abs(v) / k["typical"] - z) / k["time"],
        ),
        lambda s, on, d: {
            "force": d.size(0.15, 0.9) * s.force(on), "speed": 0.1 * s.speed(on), "fade": d.any(1.5, 3.0),
            "typical": s.speed(on), "time": seconds(s, d.any(0.1, 0.3)),
        },
        since=2040,
    ),
    # A second inertia that hangs on the body by a spring and a damper; a drive has it on its other side.
    "flexible_appendage": Family(
        law=_mass(lambda k, ahead, faster: k["stiffness"] * ahead + k["damping"] * faster),
        draw=_appendage_drawn, since=0, **AS_THE_BODY,
    ),
    # A load with play that knocks from one buffer to the other, `gap` to either side.
    # Impact pair: Masri and Caughey (1966); the buffers are Hunt and Crossley's (1975) with n = 1, so they never pull.
    "loose_load": Family(law=_mass(_knock), draw=_load_drawn, since=2029, **AS_THE_BODY),
    # A flywheel behind a dry clutch that slips: it transmits F tanh((r - v) / v0), r its rate.
    # What changes gently takes it along, what changes fast slips: the inertia seems to depend on the acceleration. It
    # is as heavy as the body or less, and slips whenever the body is accelerated as a rule.
    "slipping_flywheel": Family(
        law=_mass(lambda k, ahead, faster: k["grip"] * np.tanh(faster / k["speed"])),
        draw=_flywheel_drawn, since=2030, **AS_THE_BODY,
    ),
    # A sledge on a rope with slack: it rubs on the floor, -F tanh(r / v0), and is towed to whichever side.
    # r is its velocity; the rope's pull is K (distance - slack) if > 0.
    "towed_sledge": Family(
        law=_mass(
            lambda k, ahead, faster: (
                k["stiffness"] * np.sign(ahead) * np.maximum(np.abs(ahead) - k["slack"], 0.0)
            ),
            lambda k, r: k["friction"] * np.tanh(r / k["speed"]),
        ),
        draw=_sledge_drawn, since=2031, **AS_THE_BODY,
    ),
    # A small mass behind a spring that is cubic alone, and a damper: it has no frequency and takes what comes.
    # As stiff as a spring of a few hertz where it is stretched by as much as the body moves. Vakakis (2001), Inducing
    # passive nonlinear energy sinks in vibrating systems.
    "energy_sink": Family(
        law=_mass(lambda k, ahead, faster: k["cubic"] * ahead**3 + k["damping"] * faster),
        draw=_sink_drawn, since=2040, **AS_THE_BODY,
    ),
    # Two flyweights on springs that turn with the body: z is their radius r, 1 at rest, and its rate.
    # Inertia J (r^2 - 1) more than at rest, force -2 J r r' v, r'' = r v^2 - w^2 (r - 1) - 2 zeta w r': Lagrange's
    # equations of J (r'^2 + r^2 v^2) / 2 - J w^2 (r - 1)^2 / 2. The weights outrun their springs only when the body is
    # much faster than it is as a rule. Maxwell (1868), On governors.
    "centrifugal_governor": Family(
        "hidden force", _governor,
        lambda s, on, d: {
            "inertia": d.size(0.08, 0.6) * s.inertia(on), "turn": d.any(1.5, 3.0) * s.speed(on),
            "damping_ratio": d.any(0.2, 0.6),
        },
        ("cartpole", "pendulum"), since=2029, on=("theta",), first=1.0,
        inertia=lambda k, r: k["inertia"] * (r**2 - 1.0),
    ),
    # A load that runs out, J e^(-t / T) from every episode's start; what leaves has the body's speed: no thrust.
    # z is the share that is left; most of it is gone when the episode ends. Sommerfeld (1952), Mechanics, section 4:
    # with v of what leaves the body's own, m dv/dt = F.
    "leaking_tank": Family(
        "hidden force", lambda k, q, v, z, _: (np.zeros_like(v), -z / k["time"]),
        lambda s, on, d: {"inertia": d.size(0.08, 0.6) * s.inertia(on), "time": seconds(s, d.any(0.2, 0.5))},
        since=2030, first=1.0, inertia=lambda k, z: k["inertia"] * z,
    ),
    # A chain drawn from a heap at `edge`, link by link with a jerk, and laid down again: inertia d (q - edge) if > 0.
    # Drawn out, d/dt((m + d x) v) = F, which takes a force to set the next links in motion; laid down, the links take
    # their momentum along: (m + d x) v' = F. z is the place q. Some of it is drawn out most of the time. Cayley (1857),
    # On a class of dynamical problems.
    "heaped_chain": Family(
        "hidden force", lambda k, q, v, z, _: (-k["density"] * (z > k["edge"]) * np.maximum(v, 0.0) ** 2, v),
        lambda s, on, d: {
            "density": d.size(0.1, 0.8) * s.inertia(on) / s.reach(on),
            "edge": float(np.quantile(s.column(on), d.any(0.1, 0.4))),
        },
        since=2031, start=lambda q, v: (q, np.zeros_like(q)),
        inertia=lambda k, z: k["density"] * np.maximum(z - k["edge"], 0.0),
    ),
}  # fmt: skip
"""Forces, and perhaps inertias, with a hidden state of their own."""


def _sail(k: Values, s: FloatArray) -> FloatArray:
    x_rate, turn = s[:, 1], k["length"] * s[:, 3]
    ahead, up = x_rate + turn * np.cos(s[:, 2]), -turn * np.sin(s[:, 2])
    thrust = -k["drag"] * np.hypot(ahead, up)
    lever = k["length"] * (np.cos(s[:, 2]) * ahead - np.sin(s[:, 2]) * up)
    return np.stack([thrust * ahead, thrust * lever], axis=1)


def _sail_drawn(s: Scales, on: str, d: Dial) -> dict[str, float]:
    """Its pull on the pole in proportion to what moves the pole."""
    length = 2 * s.world.parameters["pole_half_length"]
    turn, x_rate = length * s.column("theta_dot"), s.column("x_dot")
    square = x_rate**2 + turn**2 + 2 * x_rate * turn * np.cos(s.column("theta"))
    pull = float(np.sqrt(np.mean(square**2)))
    return {"drag": d.size(0.1, 0.7) * s.force("theta") / (length * pull), "length": length}


def _tether(k: Values, s: FloatArray) -> FloatArray:
    sin, cos = np.sin(s[:, 2]), np.cos(s[:, 2])
    ahead, up = s[:, 0] + k["length"] * sin, k["length"] * cos
    far = np.hypot(ahead, up)
    pull = k["stiffness"] * np.maximum(far - k["rest"], 0.0) / np.maximum(far, 1e-9)
    return np.stack([-pull * ahead, -pull * k["length"] * (cos * ahead - sin * up)], axis=1)


def _tether_drawn(s: Scales, on: str, d: Dial) -> dict[str, float]:
    """Its pull on the pole in proportion to what moves the pole."""
    length = 2 * s.world.parameters["pole_half_length"]
    unit = {"stiffness": 1.0, "length": length, "rest": rounded(d.any(0.5, 0.9) * length)}
    states = np.stack([s.column(n) for n in SYSTEMS[s.world.system].names], axis=1)
    torque = float(np.sqrt(np.mean(_tether(unit, states)[:, 1] ** 2)))
    return {**unit, "stiffness": d.size(0.1, 0.7) * s.force("theta") / torque}


def _axle(k: Values, s: FloatArray) -> FloatArray:
    rubbing = k["force"] * np.tanh((s[:, 1] - k["radius"] * s[:, 3]) / k["speed"])
    return np.stack([-rubbing, k["radius"] * rubbing], axis=1)


def _rack(k: Values, s: FloatArray) -> FloatArray:
    torque = k["stiffness"] * np.sin(s[:, 2] - s[:, 0] / k["radius"])
    return np.stack([torque / k["radius"], -torque], axis=1)


COUPLED: Mapping[str, Family] = {
    # Each axis pushed in proportion to the other's speed; the two pushes do no work together.
    "gyroscopic": Family(
        "coupled force", lambda k, s: np.stack([k["coupling"] * s[:, 3], -k["coupling"] * s[:, 1]], axis=1),
        lambda s, on, d: {"coupling": d.size(0.1, 0.5) * s.force("theta") / s.speed("x")}, since=0, **BOTH,
    ),
    # Drag on a ball at the pole's tip, -c |V| V with V the tip's own velocity, which the cart makes, too.
    "tip_sail": Family("coupled force", _sail, _sail_drawn, since=2029, **BOTH),
    # A rubber band from the pole's tip to the middle of the track, which pulls when longer than its rest.
    # From the potential K max(d - rest, 0)^2 / 2 with the tip at (x + L sin theta, L cos theta) and d its distance.
    "tip_tether": Family("coupled force", _tether, _tether_drawn, since=2030, **BOTH),
    # A disc on the pole's axle that rubs on the track, -F tanh(V / v0), V = x' - r theta' where they touch.
    # It pushes the cart, and turns the pole by its lever r; none where the disc rolls. The radius gives the pole about
    # as large a share of what moves it as the cart.
    "rubbing_axle": Family(
        "coupled force", _axle,
        lambda s, on, d: {
            "force": d.size(0.08, 0.5) * s.force("x"),
            "radius": d.any(0.5, 1.2) * s.force("theta") / s.force("x"), "speed": d.any(0.05, 0.15) * s.speed("x"),
        },
        since=2031, **BOTH,
    ),
    # A magnetic rack on the track and a pinion on the pole's axle: they slip past each other without touching.
    # From the potential -K cos(theta - x / r). The radius gives the cart about as large a share of what moves it as the
    # pole. Halbach arrays as gears: Atallah, Wang and Howe (2005), A high-performance linear magnetic gear.
    "magnetic_rack": Family(
        "coupled force", _rack,
        lambda s, on, d: {
            "stiffness": d.size(0.1, 0.6) * s.force("theta"),
            "radius": d.any(0.6, 1.5) * s.force("theta") / s.force("x"),
        },
        since=2040, **BOTH,
    ),
}  # fmt: skip
"""On all coordinates at once, of the state."""


def _uneven(k: Values, q: FloatArray) -> tuple[FloatArray, FloatArray]:
    angle = k["wave_number"] * q + k["phase"]
    return k["amplitude"] * np.cos(angle), -k["amplitude"] * k["wave_number"] * np.sin(angle)


OF_BODIES: Mapping[str, Family] = {
    **FORCES,
    **HIDDEN,
    **COUPLED,
    # An unbalanced drive, whose inertia varies with position: A cos(k q + phase).
    "uneven_inertia": Family(
        "inertia", _uneven,
        lambda s, on, d: {"amplitude": d.size(0.1, 0.5) * s.inertia(on), **waves(s, on, d, 1, 3)}, since=2028,
    ),
}  # fmt: skip
