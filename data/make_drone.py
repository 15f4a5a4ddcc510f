"""Make data/drone.csv: the drone of data/drone.xml as it is, which its model does not quite say.

It uses nothing of gpsim, only mujoco: the log must not know how it will be explained. The drone carries 0.15 kg more
than its model says, its rotors spin up with a time constant of 40 ms, its frame drags 0.25 N s/m forwards and 0.35
sideways, and a steady wind pushes with 0.4 N along x. A motion capture sees its pose, 100 times a second. It is stepped
ten times as finely as the model, by the classical Runge-Kutta method.
"""

from pathlib import Path

import mujoco
import numpy as np

HEAVIER, LAG, DRAG, WIND = 0.15, 0.04, np.array([0.25, 0.35, 0.0]), np.array([0.4, 0.0, 0.0])
NOISE = np.array([5e-4, 5e-4, 5e-4, 1e-3, 1e-3, 1e-3])  # m, and rad
DT, FLIGHTS, SAMPLES, FINER = 0.01, 3, 500, 10
MASS, INERTIA, G = 1.2, np.array([0.011, 0.012, 0.02]), 9.81  # as its controller believes
STIFF, DAMPED = np.array([80.0, 80.0, 8.0]), np.array([14.0, 14.0, 4.0])  # 1/s^2, 1/s
MIX = np.array(
    [[1, 1, 1, 1], [0.16, 0.16, -0.16, -0.16], [-0.16, 0.16, 0.16, -0.16], [-0.02, 0.02, -0.02, 0.02]]
)
POSE = ("x", "y", "z", "qw", "qx", "qy", "qz")


def turned(quat: np.ndarray) -> np.ndarray:
    """(3, 3) of a unit quaternion, real part first."""
    out = np.zeros(9)
    mujoco.mju_quat2Mat(out, quat)
    return out.reshape(3, 3)


def controlled(place: np.ndarray, turn: np.ndarray, twist: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """(4,) N: thrusts that lead to a place and a heading (4,) (Lee, Leok and McClamroch 2010)."""
    push = 4.0 * (wanted[:3] - place) - 2.5 * twist[:3] + [0.0, 0.0, G]
    up = push / np.linalg.norm(push)
    left = np.cross(up, [np.cos(wanted[3]), np.sin(wanted[3]), 0.0])
    left /= np.linalg.norm(left)
    off = np.stack([np.cross(left, up), left, up]) @ turn
    error = 0.5 * np.array([off[2, 1] - off[1, 2], off[0, 2] - off[2, 0], off[1, 0] - off[0, 1]])
    torque = INERTIA * (-STIFF * error - DAMPED * twist[3:])
    return np.clip(np.linalg.solve(MIX, [MASS * push @ turn[:, 2], *torque]), 0.0, 9.0)


def main() -> None:
    """Fly, and write down what the motion capture sees."""
    rng = np.random.default_rng(20261130)
    model = mujoco.MjModel.from_xml_path(str(Path(__file__).with_name("drone.xml")))
    model.opt.timestep /= FINER
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    model.body_mass[1] += HEAVIER
    mujoco.mj_setConst(model, mujoco.MjData(model))
    names = [f"base.{p}" for p in POSE]
    data, lines = (
        mujoco.MjData(model),
        [",".join(["episode", "t", *names, *(f"thrust{i}" for i in range(1, 5))])],
    )
    for flight in range(FLIGHTS):
        mujoco.mj_resetData(model, data)
        rates, phases = rng.uniform(0.15, 0.5, 4), rng.uniform(0.0, 2.0 * np.pi, 4)
        thrust = np.full(4, MASS * G / 4.0)
        for k in range(SAMPLES):
            noise, quat = NOISE * rng.normal(size=6), np.zeros(4)
            mujoco.mju_mulQuat(quat, data.qpos[3:], np.append(1.0, 0.5 * noise[3:]))
            seen = np.append(data.qpos[:3] + noise[:3], quat / np.linalg.norm(quat))
            wanted = [0.0, 0.0, 1.0, 0.0] + np.sin(2.0 * np.pi * rates * DT * k + phases) * [
                0.8,
                0.8,
                0.3,
                0.6,
            ]
            command = controlled(seen[:3], turned(seen[3:]), data.qvel, wanted).round(3)
            lines.append(
                ",".join([str(flight), f"{DT * k:.2f}", *(f"{v:.5f}" for v in seen), *map(str, command)])
            )
            for _ in range(round(DT / model.opt.timestep)):
                thrust += (command - thrust) * -np.expm1(-model.opt.timestep / LAG)
                turn = turned(data.qpos[3:])
                data.ctrl[:] = thrust
                data.qfrc_applied[:3] = WIND - turn @ (DRAG * (turn.T @ data.qvel[:3]))
                mujoco.mj_step(model, data)
    Path(__file__).with_name("drone.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
