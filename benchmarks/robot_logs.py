"""Logs of arms as laboratories make them, with physics that no family is exactly: what an account of them finds.

    python benchmarks/robot_logs.py [--only ur5 panda xarm7] [--out runs/robot_logs]

Each arm (example-robot-data's file, which knows neither friction nor rotors) follows a Fourier trajectory under
computed torque at 500 Hz and is logged at 100 or 125 Hz for 40 s: positions of an encoder, noisy velocities, measured
torques with noise. The truth steps at 0.5 ms and has at every joint dry friction that passes through rest smoothly and
rises at low speed (tanh, Stribeck), viscous friction that grows less than linearly, a rotor, an offset; all links'
masses are off by some 15 %; xarm7's torques besides by some 8 %. A row (friction, rotor) is right within 15 % or inside
its interval; rows of less than 1 % of the drive's torque do not count. Processor seconds are this process's and its
workers'.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
import pandas as pd

from gpsim.mjcf.loading import spec_of
from gpsim.trials.robots import Robot, robot_of

CONTROL, STEP, SECONDS = 0.002, 0.0005, 40.0  # s
WAVES, BASE, BANDWIDTH = 5, 0.1, 2.0  # of the trajectory; Hz of its slowest; Hz of the controller
SMOOTH, RISE, SLOW, POWER = (
    0.01,
    0.3,
    0.1,
    0.9,
)  # rad/s, of the dry friction, rad/s, of speed in viscous friction
CLOSE, COUNTS = 0.15, 0.01  # of a row's size; of the drive's torque at full speed


@dataclass(frozen=True)
class Log:
    """How an arm is made and logged: Hz, friction of the torque, rotor's spin-up [rad/s^2], error of torques."""

    seed: int
    rate: int = 125
    dry: float = 0.04
    viscous: float = 0.06
    spin: tuple[float, float] = (80.0, 300.0)
    gain: float = 0.0


LOGS = {
    "ur5": Log(5),
    "panda": Log(6, dry=0.02, viscous=0.04),
    "xarm7": Log(7, rate=100, gain=0.08),
}


def trajectory(rng: np.random.Generator, robot: Robot) -> tuple[np.ndarray, ...]:
    """(K, n) reference, its velocity and acceleration at the controller's rate."""
    reach, rest = np.array(robot.reach), np.array(robot.rest[robot.ways[0]])
    t, k = np.arange(0.0, SECONDS, CONTROL), np.arange(1, WAVES + 1)
    sines, cosines = (rng.normal(size=(len(reach), WAVES)) / k for _ in range(2))
    phase = np.outer(2.0 * np.pi * BASE * k, t)
    wave = (sines @ np.sin(phase) + cosines @ (np.cos(phase) - 1.0)).T
    place = rest + wave * reach / np.abs(wave).max(axis=0)
    speed = np.gradient(place, CONTROL, axis=0)
    return place, speed, np.gradient(speed, CONTROL, axis=0)


def write_log(name: str, folder: Path) -> tuple[Path, dict[tuple[str, str], tuple[float, bool]]]:
    """Write model and log; the model's file, and (family, joint) -> size and whether it counts."""
    log, robot = LOGS[name], robot_of(name)
    folder.mkdir(parents=True, exist_ok=True)
    for file, text in robot.files().items():
        (folder / file).write_text(text, encoding="utf-8")
    rng, spec = np.random.default_rng(log.seed), spec_of(str(folder / robot.file))
    believed, model = spec.compile(), spec.compile()
    n, most = model.nu, np.array(robot.drives.torque)
    dry, viscous = most * log.dry * rng.uniform(0.5, 1.5, n), most * log.viscous * rng.uniform(0.5, 1.5, n)
    viscous /= robot.drives.speed
    rotor = most / rng.uniform(*log.spin, n)
    offset, gain = most * 0.01 * rng.normal(size=n), 1.0 + log.gain * rng.normal(size=n)
    model.dof_armature[:] += rotor
    for b in range(1, model.nbody):
        ratio = 1.0 + 0.15 * rng.normal()
        model.body_mass[b] *= ratio
        model.body_inertia[b] *= ratio
    mujoco.mj_setConst(model, mujoco.MjData(model))
    model.opt.timestep, model.opt.integrator = STEP, mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    place, speed, pull = trajectory(rng, robot)
    real, mind, rows = mujoco.MjData(model), mujoco.MjData(believed), []
    real.qpos[:] = place[0]
    stiff, every = 2.0 * np.pi * BANDWIDTH, round(1.0 / log.rate / CONTROL)
    for k in range(len(place)):
        wanted = pull[k] + 2.0 * stiff * (speed[k] - real.qvel) + stiff**2 * (place[k] - real.qpos)
        mind.qpos[:], mind.qvel[:], mind.qacc[:] = real.qpos, real.qvel, wanted
        mujoco.mj_inverse(believed, mind)
        torque = np.clip(mind.qfrc_inverse + 0.7 * rotor * wanted, -most, most)
        if k % every == 0:
            read = np.round(real.qpos, 5), real.qvel + 0.004 * rng.normal(size=n)
            rows.append(np.concatenate([[k * CONTROL], *read, torque + 0.003 * most * rng.normal(size=n)]))
        for _ in range(round(CONTROL / STEP)):
            v = real.qvel
            rubbing = dry * np.tanh(v / SMOOTH) * (1.0 + RISE * np.exp(-((v / SLOW) ** 2)))
            real.qfrc_applied[:] = (
                gain * torque + offset - rubbing - viscous * np.sign(v) * np.abs(v) ** POWER
            )
            mujoco.mj_step(model, real)
    joints = [model.joint(i).name for i in range(n)]
    columns = ["t", *joints, *(f"{j}_dot" for j in joints), *(f"{j}_tau" for j in joints)]
    pd.DataFrame(rows, columns=columns).to_csv(folder / "log.csv", index=False, float_format="%.6f")
    full = {"coulomb_friction": dry, "viscous_friction": viscous, "armature": rotor}
    worth = {
        "coulomb_friction": dry,
        "viscous_friction": viscous * robot.drives.speed,
        "armature": rotor * 10.0,
    }
    truth = {
        (family, joint): (float(full[family][i]), bool(worth[family][i] >= COUNTS * most[i]))
        for family in full
        for i, joint in enumerate(joints)
    }
    return folder / robot.file, truth


def scored(found: Path, truth: dict[tuple[str, str], tuple[float, bool]]) -> dict[str, object]:
    """Rows that count and how many of them are told and right, the verdict, what else is claimed."""
    said = json.loads((found / "diagnosis.json").read_text(encoding="utf-8"))
    told, right, besides = 0, 0, []
    counts = {place: size for place, (size, count) in truth.items() if count}
    for effect in said["effects"]:
        place = effect["family"], effect["on"]
        if place not in truth:
            besides += [" on ".join(place)] if effect["role"] == "headline" else []
            continue
        if place in counts:
            (size,) = effect["parameters"].values()
            inside = size["low"] is not None and size["low"] <= counts[place] <= size["high"]
            told, right = told + 1, right + (inside or abs(size["value"] / counts[place] - 1.0) <= CLOSE)
    return {"rows": len(counts), "told": told, "right": right, "besides": besides, "verdict": said["verdict"]}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", nargs="+", choices=tuple(LOGS), default=tuple(LOGS))
    parser.add_argument("--out", type=Path, default=Path("runs/robot_logs"))
    given = parser.parse_args()
    for name in given.only:
        folder, found = given.out / name, given.out / f"{name}_found"
        model, truth = write_log(name, folder)
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        command = ["diagnose", str(folder / "log.csv"), "--simulator", str(model), "--out", str(found)]
        if not found.exists():
            subprocess.run(
                [sys.executable, "-m", "gpsim", *command],
                check=True,
                env={**os.environ, "PYTHONWARNINGS": ""},
            )
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        print(name, json.dumps(scored(found, truth) | {"processor_s": round(seconds)}), flush=True)


if __name__ == "__main__":
    main()
