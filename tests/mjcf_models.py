"""Models that the tests write down: a pendulum, a slider, a double pendulum, a hopper in the air, a skid on a floor."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np
import yaml

from gpsim.diagnosis.run import Run
from gpsim.diagnosis.setup import PreparedProblem, prepare
from gpsim.stages.diagnose import Task, open_recording

LENGTH, MASS, GRAVITY = 0.8, 1.3, 9.81

PENDULUM = f"""<mujoco><option timestep="0.001" integrator="RK4" gravity="0 0 -{GRAVITY}"/><worldbody>
<body name="rod"><joint name="theta" type="hinge" axis="0 1 0"/>
<inertial pos="0 0 -{LENGTH}" mass="{MASS}" diaginertia="1e-9 1e-9 1e-9"/></body></worldbody>
<actuator><motor name="torque" joint="theta"/></actuator></mujoco>"""
SLIDER = f"""<mujoco><option timestep="0.001" integrator="RK4"/><worldbody>
<body name="cart"><joint name="q" type="slide" axis="1 0 0"/>
<inertial pos="0 0 0" mass="{MASS}" diaginertia="1 1 1"/></body></worldbody>
<actuator><motor name="force" joint="q"/></actuator></mujoco>"""
LINK = '<geom type="capsule" fromto="0 0 0 0 0 -{}" size=".03" mass="{}" contype="0" conaffinity="0"/>'
DOUBLE = f"""<mujoco><option timestep="0.002" integrator="implicitfast"/><worldbody>
<body name="upper"><joint name="shoulder" axis="0 1 0" damping="0.05"/>{LINK.format(0.5, 1.0)}
<body name="lower" pos="0 0 -.5"><joint name="elbow" axis="0 1 0" damping="0.02"/>{LINK.format(0.4, 0.6)}
</body></body></worldbody>
<actuator><motor name="m1" joint="shoulder"/><motor name="m2" joint="elbow"/></actuator></mujoco>"""
SERVO = f"""<mujoco><compiler angle="radian"/><option timestep="0.002" integrator="implicitfast"/><worldbody>
<body name="arm"><joint name="hinge" axis="0 1 0" damping="0.1" range="-2 2" limited="true"/>{LINK.format(0.5, 1.0)}
</body></worldbody>
<actuator><position name="servo" joint="hinge" kp="40" kv="3" ctrlrange="-1 1"/></actuator></mujoco>"""
FLOATING = f"""<mujoco><option timestep="0.002"/><worldbody>
<body name="base"><freejoint name="root"/><geom size=".1" mass="2" contype="0" conaffinity="0"/>
<body name="leg"><joint name="hip" axis="0 1 0"/>{LINK.format(0.4, 0.6)}</body></body></worldbody>
<actuator><motor name="motor" joint="hip"/></actuator></mujoco>"""

SKID = """<mujoco><option timestep="0.001" integrator="implicitfast"/><worldbody>
<geom name="floor" type="plane" size="20 20 1" friction="{floor}"/>
<body name="skid" pos="0 0 .1"><joint name="x" type="slide" axis="1 0 0"/><joint name="z" type="slide" axis="0 0 1"/>
<geom name="sole" size=".1" mass="1.5" friction="{sole}"/></body></worldbody>
<actuator><motor name="pull" joint="x"/><motor name="lift" joint="z"/></actuator></mujoco>"""
"""A ball that is dragged over a floor without turning; the friction of both is to be filled in."""


def linked(joints: tuple[str, ...], axis: str, at: str, inertial: str) -> str:
    """A chain of bodies, each at `at` of the one before and turned by a motor about `axis`, without any friction."""
    body = ""
    for name in reversed(joints):
        joint = f'<joint name="{name}" axis="{axis}" damping="0"/>'
        body = f'<body name="link_{name}" pos="{at}">{joint}<inertial {inertial}/>{body}</body>'
    motors = "".join(f'<motor name="motor_{n}" joint="{n}"/>' for n in joints)
    return f"<mujoco><worldbody>{body}</worldbody><actuator>{motors}</actuator></mujoco>"


def asked_of(
    folder: Path, text: str, joints: tuple[str, ...], dt: float, noise: float, rows: Iterable[np.ndarray]
) -> PreparedProblem:
    """The question of a chain's log; rows: positions, speeds and commands of its joints, one after the other."""
    names = [*joints, *(f"{n}_dot" for n in joints)]
    state = {n: "rad/s" if n.endswith("_dot") else "rad" for n in names}
    action, timed = {f"motor_{n}": "N m" for n in joints}, ((0, k * dt, *row) for k, row in enumerate(rows))
    logged(folder, text, timed, dt, state, action, noise=dict.fromkeys(names, noise))
    recording, simulator = open_recording(Task(folder, None))
    return prepare(recording, simulator, simulator.defaults(), Run())


def logged(
    folder: Path,
    text: str,
    rows: Iterable[Iterable[float]],
    dt: float,
    state: dict[str, str],
    action: dict[str, str],
    **more,
) -> Path:
    """A folder with a model and its recording; rows: episode, t, then states and commands in their order."""
    lines = [",".join(["episode", "t", *state, *action])]
    lines += [",".join(f"{v:.7f}" for v in row) for row in rows]
    (folder / "recording.csv").write_text("\n".join(lines) + "\n")
    meta = {"system": "mjcf", "model": "robot.xml", "dt": dt, "state": state, "action": action, **more}
    (folder / "recording.yaml").write_text(yaml.safe_dump(meta))
    written(folder, text)
    return folder


def written(folder: Path, text: str, name: str = "robot.xml") -> str:
    """The file of a model; its path as a reference."""
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return str(path)


def one_by_one(model, state, commands, split):
    """(K, S): what mujoco.mj_step makes of one simulation; split(state) -> qpos, qvel, joined by their columns."""
    import mujoco

    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = split(state)
    out = []
    for command in commands:
        data.ctrl[:] = command
        mujoco.mj_step(model, data)
        out.append(np.stack([data.qpos, data.qvel], axis=1).ravel())
    return np.array(out)
