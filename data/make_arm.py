"""Make data/arm.csv: the arm of data/arm.xml as it is, which its model does not quite say.

It uses nothing of gpsim, only mujoco: the log must not know how it will be explained. The elbow has dry friction of
0.12 N m, and the shoulder's motor does nothing below 0.5 N m. It is stepped four times as finely as the model, by the
classical Runge-Kutta method.
"""

from pathlib import Path

import mujoco
import numpy as np

FRICTION = 0.12  # N m, in the elbow
WIDTH = 0.5  # N m, below which the shoulder's motor does nothing
NOISE = 5e-4  # rad
DT, EPISODES, SAMPLES, FINER = 0.02, 4, 300, 4


def commands(rng: np.random.Generator) -> np.ndarray:
    """(K, 2) N m: sums of slow sines, cut at the motors' ranges."""
    t = DT * np.arange(SAMPLES)
    rates, phases = rng.uniform(0.1, 1.5, (2, 4, 1)), rng.uniform(0.0, 2.0 * np.pi, (2, 4, 1))
    made = np.sin(2.0 * np.pi * rates * t + phases).sum(axis=1).T
    return np.clip(made * [0.8, 0.15], [-4.0, -1.0], [4.0, 1.0])


def main() -> None:
    """Drive, and write down what the encoders say."""
    rng = np.random.default_rng(20261126)
    model = mujoco.MjModel.from_xml_path(str(Path(__file__).with_name("arm.xml")))
    model.opt.timestep /= FINER
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    model.dof_frictionloss[1] = FRICTION
    model.dof_solref[1] = -1.0, -2.0 / model.opt.timestep
    model.dof_solimp[1] = 0.9999, 0.9999, 0.001, 0.5, 2.0
    data, lines = mujoco.MjData(model), ["episode,t,shoulder,elbow,m1,m2"]
    for episode in range(EPISODES):
        mujoco.mj_resetData(model, data)
        data.qpos[:] = 0.3 * rng.normal(size=2)
        for k, (m1, m2) in enumerate(commands(rng).round(3)):
            said = data.qpos + NOISE * rng.normal(size=2)
            lines.append(f"{episode},{DT * k:.2f},{said[0]:.5f},{said[1]:.5f},{m1:.3f},{m2:.3f}")
            data.ctrl[:] = 0.0 if abs(m1) < WIDTH else m1, m2
            mujoco.mj_step(model, data, nstep=round(DT / model.opt.timestep))
    Path(__file__).with_name("arm.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
