"""What the grounds with robots share: logs cut in time, motion of a test part, and the two sides that are asked.

A log is a recording folder (recording.yaml, recording.csv) with a MuJoCo model. `cut` splits it in time: a peer and
gpsim see the first part alone, and the last is never shown to either. `motion` starts a model at moments of the test
part in the measured state, plays the measured commands and says how far its joints are off after each horizon. All
models start in the same states: those that gpsim's reader makes of the log.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import resource
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import mujoco
import mujoco.rollout
import numpy as np
import pandas as pd
import yaml
from numpy.typing import NDArray
from scipy.signal import savgol_filter

import gpsim
from gpsim.recordings import Recording
from gpsim.stages.diagnose import read_corrected

Floats = NDArray[np.float64]
HORIZONS = (0.2, 1.0)  # s, after which held-out motion is judged
STRIDE = 0.1  # s between two starts
HISTORY = 0.5  # s of commands that a model with memory sees before it starts


@dataclass(frozen=True)
class Log:
    """A log in two parts.

    train: a recording folder. episodes: states (K + 1, 2 J), positions of all joints and then their velocities, and
    actions (K, A), in the model's order. begin: of the episodes with a test part its first sample.
    """

    name: str
    model: Path
    train: Path
    dt: float
    joints: tuple[str, ...]
    episodes: Sequence[tuple[Floats, Floats]]
    begin: Mapping[int, int]

    @property
    def n(self) -> int:
        """How many joints."""
        return len(self.joints)

    def trained(self) -> list[tuple[Floats, Floats]]:
        """The training part of every episode that has one."""
        parts = [(s[: self.begin.get(at, len(s))], a) for at, (s, a) in enumerate(self.episodes)]
        return [(s, a[: len(s) - 1]) for s, a in parts if len(s) > 1]


def cut(name: str, folder: Path, model: Path, into: Path) -> Log:
    """Write the training part of a recording folder to `into`; raises ValueError where it holds nothing out."""
    said = yaml.safe_load((folder / "recording.yaml").read_text(encoding="utf-8"))
    rows = pd.read_csv(folder / "recording.csv", dtype={"t": str})
    held, t = said.pop("held_out"), rows["t"].astype(float)
    if "episodes_from" in held:
        kept = rows["episode"] < held["episodes_from"]
    else:
        edge = held["time_from"] if "time_from" in held else t.iloc[round(len(rows) * (1.0 - held["share"]))]
        kept = t < edge
    into.mkdir(parents=True, exist_ok=True)
    rows[kept].to_csv(into / "recording.csv", index=False)
    said.pop("model", None)
    (into / "recording.yaml").write_text(yaml.safe_dump(said, sort_keys=False), encoding="utf-8")
    recording, begin = gpsim.read_recording(folder, str(model)), {}
    for at, (_, episode) in enumerate(rows.groupby("episode", sort=False)):
        mine = kept.loc[episode.index].to_numpy()
        if not mine.all():
            begin[at] = int(mine.sum())
    joints = tuple(n for n in recording.state.names if not n.endswith("_dot"))
    states = [_states(recording, episode.states, joints) for episode in recording.episodes]
    pairs = [(s, e.actions) for s, e in zip(states, recording.episodes, strict=True)]
    return Log(name, model, into, recording.dt, joints, pairs, begin)


def _states(recording: Recording, states: Floats, joints: Sequence[str]) -> Floats:
    """Positions and velocities; where none is measured, the slope of a cubic through seven samples."""
    names = recording.state.names
    places = states[:, [names.index(j) for j in joints]]
    if all(f"{j}_dot" in names for j in joints):
        return np.hstack([places, states[:, [names.index(f"{j}_dot") for j in joints]]])
    return np.hstack([places, savgol_filter(places, 7, 3, deriv=1, delta=recording.dt, axis=0)])


@dataclass(frozen=True)
class Starts:
    """Windows of a log: history (N, H, S), (N, H, A) before them, states (N, T + 1, S), actions (N, T, A)."""

    before: tuple[Floats, Floats]
    states: Floats
    actions: Floats


def starts(log: Log, horizon: float, stride: float) -> Starts:
    """All windows of a horizon [s] in the test part, a stride [s] apart, whose history may lie before it."""
    ahead, back, every = (max(round(s / log.dt), 1) for s in (horizon, HISTORY, stride))
    found: list[tuple[Floats, ...]] = []
    for at, first in log.begin.items():
        states, actions = log.episodes[at]
        for k in range(max(first, back), len(states) - ahead, every):
            before = states[k - back : k], actions[k - back : k]
            found.append((*before, states[k : k + ahead + 1], actions[k : k + ahead]))
    parts = [np.stack(part) for part in zip(*found, strict=True)]
    return Starts((parts[0], parts[1]), parts[2], parts[3])


Roll = Callable[[Starts], Floats]
"""The positions (N, T + 1, J) that a model goes through from the starts."""


def motion(log: Log, roll: Roll, stride: float = STRIDE) -> dict[str, Any]:
    """Held-out error after each horizon: root mean square over starts, joint by joint [rad]."""
    found: dict[str, Any] = {}
    for horizon in HORIZONS:
        windows = starts(log, horizon, stride)
        error = np.sqrt(np.mean((roll(windows)[:, -1] - windows.states[:, -1, : log.n]) ** 2, axis=0))
        found[f"{horizon:g} s"] = {"starts": len(windows.states), "rad": [float(e) for e in error]}
    return found


def left(made: Mapping[str, Any], before: Mapping[str, Any]) -> dict[str, float]:
    """By horizon what a peer leaves of the error of the model as it is: the geometric mean over the joints.

    Joints that rest count like those that move, and each is measured by what the model itself got wrong of it.
    """
    found = {}
    for horizon, was in before.items():
        now = np.array(made[horizon]["rad"]) / np.array(was["rad"])
        found[horizon] = float(np.exp(np.mean(np.log(np.where(np.isfinite(now), now, np.inf)))))
    return found


def model_of(spec: mujoco.MjSpec, dt: float) -> mujoco.MjModel:
    """The model with its step made to fit the log's clock a whole number of times."""
    spec.option.timestep = dt / max(1, round(dt / spec.option.timestep))
    return spec.compile()


def rolled(model: mujoco.MjModel, dt: float) -> Roll:
    """Motion of a MuJoCo model, commands held over a step of the log."""

    def roll(windows: Starts) -> Floats:
        several, count = round(dt / model.opt.timestep), len(windows.states)
        begun = np.zeros((count, mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS)))
        begun[:, 1 : 1 + model.nq + model.nv] = windows.states[:, 0]
        sent = np.repeat(windows.actions, several, axis=1)
        state, _ = mujoco.rollout.rollout([model] * count, mujoco.MjData(model), begun, sent)
        path = state[:, several - 1 :: several, 1 : 1 + model.nq]
        return np.concatenate([windows.states[:, :1, : model.nq], path], axis=1)

    return roll


def corrected(found: Path, gp: bool = False) -> Roll:
    """Motion of a diagnosis' corrected simulator; what it remembers comes from the measured history."""

    def roll(windows: Starts) -> Floats:
        plant, rng = read_corrected(found, gp=gp), np.random.default_rng(0)
        joints = [name for name in plant.state.names if not name.endswith("_dot")]
        order = [plant.state.index(name) for name in (*joints, *(f"{name}_dot" for name in joints))]
        (seen, sent), n = windows.before, len(joints)
        memory = plant.begin(len(windows.states), rng)
        for k in range(seen.shape[1]):
            plant.step(_put(seen[:, k], order), sent[:, k], memory, rng)
        path = [state := _put(windows.states[:, 0], order)]
        with np.errstate(over="ignore", invalid="ignore"):
            for k in range(windows.actions.shape[1]):
                path.append(state := plant.step(state, windows.actions[:, k], memory, rng))
        return np.stack(path, axis=1)[:, :, order[:n]]

    return roll


def _put(states: Floats, order: Sequence[int]) -> Floats:
    """States (N, S) as a plant orders them."""
    out = np.empty_like(states)
    out[:, order] = states
    return out


def diagnosed(log: Log, out: Path, given: Sequence[str] = ()) -> float:
    """Processor seconds of `gpsim diagnose` on the training part, told nothing; kept in `out`."""
    spent = out.with_suffix(".seconds.json")
    if not (out.exists() and spent.exists()):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        command = [
            "-m",
            "gpsim",
            "diagnose",
            str(log.train),
            "--simulator",
            str(log.model),
            "--out",
            str(out),
        ]
        done = subprocess.run(
            [sys.executable, *command, *given],
            check=False,
            capture_output=True,
            text=True,
            env={**os.environ, "OMP_NUM_THREADS": "1", "PYTHONWARNINGS": ""},
        )
        if done.returncode:
            raise RuntimeError(f"gpsim diagnose: {done.stderr.strip().splitlines()[-1]}")
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        spent.write_text(json.dumps(seconds), encoding="utf-8")
    return float(json.loads(spent.read_text(encoding="utf-8")))


def told(found: Path) -> dict[str, Any]:
    """The verdict and every effect with its values and intervals."""
    said = json.loads((found / "diagnosis.json").read_text(encoding="utf-8"))
    effects = [
        {
            "name": f"{e['family']} on {e['on']}",
            "role": e["role"],
            "parameters": {
                k: {key: p[key] for key in ("value", "low", "high", "unit")}
                for k, p in e["parameters"].items()
            },
        }
        for e in said["effects"]
    ]
    return {"verdict": said["verdict"], "effects": effects}


@dataclass(frozen=True)
class Free:
    """A number of a model that mujoco.sysid may change: where it is, from where it starts, how far it may go."""

    name: str
    start: float
    low: float
    high: float
    put: Callable[[mujoco.MjSpec, float], None] = field(repr=False)


def scales(log: Log, spec: mujoco.MjSpec) -> dict[str, tuple[float, float, float]]:
    """By joint: torque [N m], speed [rad/s] and inertia [kg m^2] that are usual in the training part.

    They say where a user who has looked at the log and the model would let numbers start and end.
    """
    model = spec.compile()
    data, n = mujoco.MjData(model), log.n
    torques, inertias, full = [], [], np.zeros((log.n, log.n))
    for states, actions in log.trained():
        for k in range(0, len(actions), 20):
            data.qpos[:], data.qvel[:], data.ctrl[:] = states[k, :n], states[k, n:], actions[k]
            mujoco.mj_forward(model, data)
            mujoco.mj_fullM(model, data, full)
            torques.append(data.qfrc_actuator.copy())
            inertias.append(np.diag(full).copy())
    speeds = np.concatenate([states[:, n:] for states, _ in log.trained()])
    torque, inertia = (np.sqrt(np.mean(np.square(x), axis=0)) for x in (torques, inertias))
    speed = np.sqrt(np.mean(speeds**2, axis=0))
    return {model.joint(i).name: (float(torque[i]), float(speed[i]), float(inertia[i])) for i in range(n)}


def joint_numbers(log: Log, spec: mujoco.MjSpec) -> dict[str, Free]:
    """Dry friction, damping, rotor and an offset of every joint."""
    found: dict[str, Free] = {}
    for joint, (torque, speed, inertia) in scales(log, spec).items():
        was = spec.joint(joint)
        dry, viscous, rotor = float(was.frictionloss), float(was.damping[0]), float(was.armature)

        def friction(s: mujoco.MjSpec, value: float, joint: str = joint) -> None:
            s.joint(joint).frictionloss = value

        def damping(s: mujoco.MjSpec, value: float, joint: str = joint) -> None:
            s.joint(joint).damping[0] = value

        def armature(s: mujoco.MjSpec, value: float, joint: str = joint) -> None:
            s.joint(joint).armature = value

        most, slow = torque + dry, (torque + dry) / speed + viscous
        for one in (
            Free(f"coulomb_friction on {joint}", dry or 0.1 * most, 0.0, 2.0 * most, friction),
            Free(f"viscous_friction on {joint}", viscous or 0.1 * slow, 0.0, 2.0 * slow, damping),
            Free(f"armature on {joint}", rotor or 0.1 * inertia, 0.0, 10.0 * (inertia + rotor), armature),
        ):
            found[one.name] = one
    return found


def body_numbers(spec: mujoco.MjSpec) -> dict[str, Free]:
    """Of every moving body a ratio of its mass, inertia with it."""
    found: dict[str, Free] = {}
    for body in spec.bodies[1:]:
        if body.name == "base":  # stands still
            continue
        mass, inertia = float(body.mass), np.array(body.inertia)
        geoms = {g.name: float(g.mass) for g in body.geoms} if not body.explicitinertial else {}

        def weigh(
            s: mujoco.MjSpec,
            ratio: float,
            of: str = body.name,
            m: float = mass,
            i: Floats = inertia,
            g: Mapping[str, float] = geoms,
        ) -> None:
            if g:
                for name, weight in g.items():
                    s.geom(name).mass = weight * ratio
            else:
                s.body(of).mass, s.body(of).inertia = m * ratio, i * ratio

        found[f"mass of {body.name}"] = Free(f"mass of {body.name}", 1.0, 0.5, 2.0, weigh)
    return found


def drive_numbers(spec: mujoco.MjSpec) -> dict[str, Free]:
    """Of a motor its gain; of a servo its two gains."""
    found: dict[str, Free] = {}
    for actuator in spec.actuators:
        name = actuator.name
        if actuator.biastype == mujoco.mjtBias.mjBIAS_AFFINE:
            stiff, slow = float(actuator.gainprm[0]), -float(actuator.biasprm[2])

            def kp(s: mujoco.MjSpec, ratio: float, name: str = name, k: float = stiff) -> None:
                s.actuator(name).gainprm[0], s.actuator(name).biasprm[1] = k * ratio, -k * ratio

            def kv(s: mujoco.MjSpec, value: float, name: str = name) -> None:
                s.actuator(name).biasprm[2] = -value

            found[f"kp of {name}"] = Free(f"kp of {name}", 1.0, 0.2, 5.0, kp)
            found[f"kv of {name}"] = Free(
                f"kv of {name}", slow or 0.01 * stiff, 0.0, 5.0 * (slow or 0.1 * stiff), kv
            )
        else:

            def gain(s: mujoco.MjSpec, value: float, name: str = name) -> None:
                s.actuator(name).gainprm[0] = value

            found[f"gain of {name}"] = Free(f"gain of {name}", 1.0, 0.5, 2.0, gain)
    return found


def offset_numbers(log: Log, spec: mujoco.MjSpec) -> dict[str, Free]:
    """Of every motor a constant torque beside its own."""
    found: dict[str, Free] = {}
    reach = list(scales(log, spec).values())
    for at, actuator in enumerate(spec.actuators):
        if actuator.biastype == mujoco.mjtBias.mjBIAS_AFFINE:
            continue
        joint = actuator.target

        def push(s: mujoco.MjSpec, value: float, name: str = actuator.name) -> None:
            s.actuator(name).biastype = mujoco.mjtBias.mjBIAS_AFFINE
            s.actuator(name).biasprm[0] = value

        most = reach[at][0]
        found[f"constant_force on {joint}"] = Free(f"constant_force on {joint}", 0.0, -most, most, push)
    return found


@dataclass(frozen=True)
class Fitted:
    """What mujoco.sysid made of a log."""

    model: mujoco.MjModel
    values: dict[str, tuple[float, float, float]]  # value and 90 % interval
    window: float  # s
    seconds: float  # processor seconds of the fits with the chosen window
    tried: dict[str, float]  # by window: error on the last fifth of the training part


WINDOWS = (
    0.2,
    1.0,
)  # s: the grid of mujoco.sysid; the one that does better on the last fifth of the training part


def fit(log: Log, free: Mapping[str, Free], most: int = 50) -> Fitted:
    """mujoco.sysid's least squares on windows of the training part, its own optimiser and settings.

    Windows do not overlap, each begins in the measured state; a residual is an error of a position or velocity over
    its standard deviation in the training part (its own weighting, by each window's norm, divides by zero where a
    joint rests). The length of the windows is chosen on the last fifth of the training part; the fit on all of it
    starts from there.
    """
    whole = log.trained()
    total = sum(len(p) for p, _ in whole)
    early, late, room = [], [], round(0.8 * total)
    for p, c in whole:
        k = min(max(room, 0), len(p))
        room -= len(p)
        early += [(p[:k], c[: max(k - 1, 0)])] if k > 1 else []
        late += [(p[k:], c[k:])] if len(p) - k > 1 else []
    tried: dict[str, float] = {}
    best: tuple[float, float, Any] | None = None
    seconds: dict[float, float] = {}
    for window in WINDOWS:
        began = time.process_time()
        values, _, _ = _least_squares(log, free, early, window, most, None)
        model = _built(log, free, values)
        error = _error(log, model, late)
        seconds[window] = time.process_time() - began
        tried[f"{window:g} s"] = error
        if best is None or error < best[0]:
            best = error, window, values
    assert best is not None
    began = time.process_time()
    values, width, _ = _least_squares(log, free, whole, best[1], most, best[2])
    last = time.process_time() - began
    said = {
        name: (float(v), float(v - w), float(v + w)) for name, v, w in zip(free, values, width, strict=True)
    }
    model = _built(log, free, values)
    return Fitted(model, said, best[1], seconds[best[1]] + last, tried)


def _built(log: Log, free: Mapping[str, Free], values: Floats) -> mujoco.MjModel:
    spec = mujoco.MjSpec.from_file(str(log.model))
    for one, value in zip(free.values(), values, strict=True):
        one.put(spec, float(value))
    return model_of(spec, log.dt)


def _windows(parts: Sequence[tuple[Floats, Floats]], steps: int) -> tuple[Floats, Floats]:
    """States (N, steps + 1, S) and actions (N, steps, A) of windows that do not overlap."""
    found = [
        (p[k : k + steps + 1], c[k : k + steps]) for p, c in parts for k in range(0, len(p) - steps, steps)
    ]
    return np.stack([p for p, _ in found]), np.stack([c for _, c in found])


def _error(log: Log, model: mujoco.MjModel, parts: Sequence[tuple[Floats, Floats]]) -> float:
    """Of positions, as a share of their spread in all that trains: the geometric mean of the horizons."""
    dt, n = log.dt, log.n
    spread = np.concatenate([p[:, :n] for p, _ in log.trained()]).std(axis=0) + 1e-6
    shares = []
    for horizon in HORIZONS:
        steps = round(horizon / dt)
        if max(len(p) for p, _ in parts) <= steps:
            continue
        states, actions = _windows(parts, steps)
        none = (states[:, :0], actions[:, :0])
        path = rolled(model, dt)(Starts(none, states, actions))
        shares.append(
            float(np.mean(np.sqrt(np.mean((path[:, -1] - states[:, -1, :n]) ** 2, axis=0)) / spread))
        )
    error = float(np.exp(np.mean(np.log(shares))))
    return error if np.isfinite(error) else np.inf


def _least_squares(
    log: Log,
    free: Mapping[str, Free],
    parts: Sequence[tuple[Floats, Floats]],
    window: float,
    most: int,
    begin: Floats | None,
) -> tuple[Floats, Floats, int]:
    """Values and half widths of their 90 % intervals."""
    from absl import logging
    from mujoco import sysid

    logging.set_verbosity(logging.ERROR)  # it warns of every window that the model has no sensors

    dt, spec = log.dt, mujoco.MjSpec.from_file(str(log.model))
    model = model_of(spec, dt)
    several, steps = round(dt / model.opt.timestep), round(window / dt)
    states, actions = _windows(parts, steps)
    scale = np.concatenate([p for p, _ in parts]).std(axis=0) + 1e-9
    names = [f"{model.joint(i).name}_qpos" for i in range(model.njnt)] + [
        f"{model.joint(i).name}_qvel" for i in range(model.njnt)
    ]
    fine = np.arange(steps * several + 1) * model.opt.timestep
    coarse = np.arange(steps + 1) * dt
    begun, sent, seen = [], [], []
    for path, command in zip(states, actions, strict=True):
        begun.append(sysid.create_initial_state(model, path[0, : model.nq], path[0, model.nq :]))
        held = np.repeat(command, several, axis=0)
        sent.append(sysid.TimeSeries(fine, np.concatenate([held, held[-1:]])))
        seen.append(sysid.TimeSeries.from_names(coarse, path, model, names))
    sequences = sysid.ModelSequences(
        log.name, spec, [str(k) for k in range(len(states))], begun, sent, seen, allow_missing_sensors=True
    )

    def difference(
        params: Any, predicted: Any, measured: Any, model: Any, everything: Any, state: Any = None, **_: Any
    ) -> Any:
        there = state[several - 1 :: several, 1 : 1 + model.nq + model.nv]
        made = sysid.TimeSeries(measured.times[1:], there, measured.signal_mapping)
        wanted = sysid.TimeSeries(measured.times[1:], measured.data[1:], measured.signal_mapping)
        return np.nan_to_num((there - wanted.data) / scale, nan=1e3, posinf=1e3, neginf=-1e3), made, wanted

    parameters = sysid.ParameterDict()
    for at, one in enumerate(free.values()):
        value = one.start if begin is None else float(np.clip(begin[at], one.low, one.high))
        parameters.add(
            sysid.Parameter(
                one.name,
                value,
                one.low,
                one.high,
                modifier=lambda s, p, put=one.put: put(s, float(p.value[0])),
            )
        )
    residual = sysid.build_residual_fn(
        models_sequences=[sequences], modify_residual=difference, resample_true=False, n_threads=1
    )
    with contextlib.redirect_stdout(io.StringIO()):  # a line an iteration
        best, result = sysid.optimize(parameters, residual, optimizer="mujoco", verbose=False, max_iters=most)
    left, _, _ = residual(best.as_vector(), best)
    _, width = sysid.calculate_intervals(left, np.asarray(result.jac), alpha=0.1)
    return best.as_vector(), np.asarray(width, dtype=np.float64).reshape(-1), len(states)
