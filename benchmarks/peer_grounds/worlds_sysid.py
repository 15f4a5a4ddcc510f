"""mujoco.sysid as a namer of the concealed machines: a model of each, everything free that MuJoCo has a word for.

The user has written the machine down as MJCF, with the numbers of the simulator, and frees dry and viscous friction and
a spring of every joint, the offset and the gain of the motor, and gravity. All are fitted at once; then as many of them
are kept as BIC asks for, the surest first, each time fitted again. MuJoCo has no word for quadratic drag and none for a
motor whose gain depends on the sign: in these worlds it cannot be right.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from gpsim.trials.worlds import SYSTEMS
from peer_grounds.arms import Free, Log, Starts, _built, _least_squares, _windows, rolled

Floats = NDArray[np.float64]
MOST = 30  # iterations of a fit
WINDOW, PIECES = 0.5, 30  # s of a window; windows of each fit, evenly spread over the recording
SUREST = 4  # numbers that are kept at most
SLIGHT = 0.01  # of a ratio or of the largest command: left alone, as the other peers leave forces alone
START = 0.02  # of the largest command, from which friction and springs are looked for


def model_text(system: str, p: Mapping[str, float], step: float, scheme: str) -> str:
    """MJCF of a machine with these parameters, which steps as its simulator does, as far as MuJoCo can."""
    stepped = "RK4" if scheme == "rk4" else "Euler"
    head = (
        f'<mujoco><compiler autolimits="true"/><option timestep="{step}" integrator="{stepped}" '
        f'gravity="0 0 -{p.get("gravity", 0.0)}"/><worldbody>'
    )
    point = 'diaginertia="1e-9 1e-9 1e-9"'
    if system == "slider":
        slide = '<joint name="q" type="slide" axis="1 0 0"/>'
        body = f'<body>{slide}<inertial pos="0 0 0" mass="{p["mass"]}" {point}/></body>'
        driven = "q"
    elif system == "pendulum":
        body = (
            f'<body><joint name="theta" type="hinge" axis="0 1 0"/><inertial pos="0 0 -{p["length"]}" '
            f'mass="{p["mass"]}" {point}/></body>'
        )
        driven = "theta"
    else:
        half, mass = p["pole_half_length"], p["pole_mass"]
        turns = mass * half**2 / 3.0  # a uniform rod about its middle
        body = (
            f'<body><joint name="x" type="slide" axis="1 0 0"/><inertial pos="0 0 0" mass="{p["cart_mass"]}" {point}/>'
            f'<body><joint name="theta" type="hinge" axis="0 1 0"/><inertial pos="0 0 {half}" mass="{mass}" '
            f'diaginertia="{turns} {turns} 1e-9"/></body></body>'
        )
        driven = "x"
    (action,) = SYSTEMS[system].action
    return f'{head}{body}</worldbody><actuator><motor name="{action}" joint="{driven}"/></actuator></mujoco>'


def numbers(log: Log, spec: mujoco.MjSpec, most: float, gravity: float) -> dict[str, Free]:
    """What is free, by the words of the catalogue, within what the largest command could do."""
    (motor,) = spec.actuators

    def push(s: mujoco.MjSpec, value: float) -> None:
        s.actuators[0].biastype = mujoco.mjtBias.mjBIAS_AFFINE
        s.actuators[0].biasprm[0] = value

    def gain(s: mujoco.MjSpec, value: float) -> None:
        s.actuators[0].gainprm[0] = value

    def weight(s: mujoco.MjSpec, ratio: float) -> None:
        s.option.gravity[2] = -gravity * ratio

    every = [
        Free(f"constant_force on {motor.target}", 0.0, -most, most, push),
        Free(f"actuator_gain on {motor.name}", 1.0, 0.5, 2.0, gain),
    ]
    if gravity:
        every.append(Free("parameter_offset on gravity", 1.0, 0.5, 2.0, weight))
    spread = np.concatenate([s for s, _ in log.episodes]).std(axis=0)
    for at, joint in enumerate(log.joints):
        way, speed = spread[at], spread[log.n + at]

        def dry(s: mujoco.MjSpec, value: float, joint: str = joint) -> None:
            s.joint(joint).frictionloss = value

        def viscous(s: mujoco.MjSpec, value: float, joint: str = joint) -> None:
            s.joint(joint).damping[0] = value

        def stiff(s: mujoco.MjSpec, value: float, joint: str = joint) -> None:
            s.joint(joint).stiffness[0] = value

        def rest(s: mujoco.MjSpec, value: float, joint: str = joint) -> None:
            s.joint(joint).springref = value

        every += [
            Free(f"coulomb_friction on {joint}", START * most, 0.0, most, dry),
            Free(f"viscous_friction on {joint}", START * most / speed, 0.0, most / speed, viscous),
            Free(f"spring on {joint}", START * most / way, 0.0, most / way, stiff),
            Free(f"rest of the spring on {joint}", 0.0, -3.0 * way, 3.0 * way, rest),
        ]
    return {one.name: one for one in every}


def nothing(name: str) -> float:
    """The value of a number that says that nothing is missing."""
    return 1.0 if name.startswith(("actuator_gain", "parameter_offset")) else 0.0


def by_sysid(recording: Any) -> tuple[frozenset[tuple[str, str]], dict[tuple[str, str], list[float]]]:
    """Claims, and their sizes."""
    with tempfile.TemporaryDirectory() as place:
        return _named(recording, Path(place) / "machine.xml")


def _named(
    recording: Any, path: Path
) -> tuple[frozenset[tuple[str, str]], dict[tuple[str, str], list[float]]]:
    names, system = recording.state.names, recording.system
    path.write_text(
        model_text(system, recording.parameters, recording.dt, recording.integrator), encoding="utf-8"
    )
    joints = tuple(n for n in names if not n.endswith("_dot"))
    order = [names.index(n) for n in (*joints, *(f"{n}_dot" for n in joints))]
    episodes = [(e.states[:, order], e.actions) for e in recording.episodes]
    log = Log("machine", path, path.parent, recording.dt, joints, episodes, {})
    spec = mujoco.MjSpec.from_file(str(path))
    most = max(float(np.abs(a).max()) for _, a in episodes)
    free = numbers(log, spec, most, float(recording.parameters.get("gravity", 0.0)))
    states, actions = _windows(log.trained(), round(WINDOW / log.dt))
    rows = np.unique(np.linspace(0, len(states) - 1, PIECES).round().astype(int))
    parts = list(zip(states[rows], actions[rows], strict=True))
    fitted, width, _ = _least_squares(log, free, parts, WINDOW, MOST, None)
    begun = dict(zip(free, fitted.tolist(), strict=True))
    surely = {
        n: abs(begun[n] - nothing(n)) / max(w, 1e-12)
        for n, w in zip(free, width, strict=True)
        if not n.startswith("rest")
    }
    ranked = sorted(surely, key=lambda n: -surely[n])[:SUREST]
    best: tuple[float, dict[str, float]] = (np.inf, {})
    for count in range(len(ranked) + 1):
        some = {n: free[n] for n in ranked[:count]}
        some |= {r: free[r] for n in list(some) if (r := f"rest of the {n}") in free}
        begin = np.array([begun[n] for n in some])
        values = _least_squares(log, some, parts, WINDOW, MOST, begin)[0] if some else begin
        score = _bic(log, some, values)
        if score < best[0]:
            best = score, dict(zip(some, values.tolist(), strict=True))
    claims: dict[tuple[str, str], list[float]] = {}
    for name, value in best[1].items():
        whole = (
            1.0 if nothing(name) else free[name].high
        )  # of friction, springs and offsets: what the command can do
        slight = SLIGHT * whole
        if not name.startswith("rest") and abs(value - nothing(name)) > slight:
            family, _, on = name.partition(" on ")
            rest = best[1].get(f"rest of the {name}")
            claims[family, on] = [value] if rest is None else [value, rest]
    return frozenset(claims), claims


def _bic(log: Log, some: Mapping[str, Free], values: Floats) -> float:
    """Of the positions in all windows."""
    states, actions = _windows(log.trained(), round(WINDOW / log.dt))
    path = rolled(_built(log, some, values), log.dt)(Starts((states[:, :0], actions[:, :0]), states, actions))
    error = (path[:, 1:] - states[:, 1:, : log.n]) / (states[:, :, : log.n].std(axis=(0, 1)) + 1e-9)
    return float(error.size * np.log(np.mean(error**2) + 1e-300) + len(some) * np.log(error.size))
