"""Arms whose tool a motion capture sees: models with numbers to be filled in, and what would be recorded of them.

The truth is MuJoCo's own forward kinematics of a model that is written otherwise; nothing of gpsim's is used for it.
"""

from dataclasses import dataclass

import mujoco
import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

GEOM = '<geom size=".03" mass="1" contype="0" conaffinity="0"/>'
SIX = f"""<mujoco><compiler angle="radian"/><worldbody>
<body name="l1" pos="0 0 .1"><joint name="j1" axis="0 0 1"/>{GEOM}
<body name="l2" pos="{{l2}} 0 .3" quat="{{turn}}"><joint name="j2" axis="0 1 0" ref="{{z2}}"/>{GEOM}
<body name="l3" pos="0 0 {{l3}}"><joint name="j3" axis="0 1 0" pos="0 0 .02"/>{GEOM}
<body name="l4" pos=".05 0 .2"><joint name="j4" axis="0 0 1"/>{GEOM}
<body name="l5" pos="0 0 .2"><joint name="j5" axis="0 1 0"/>{GEOM}
<body name="l6" pos="0 0 .1"><joint name="j6" axis="0 0 1" ref="{{z6}}"/>{GEOM}
<site name="tool" pos=".05 {{mark}} .1"/></body></body></body></body></body></body></worldbody></mujoco>"""
PLANAR = f"""<mujoco><compiler angle="radian"/><worldbody>
<body name="upper" pos="0 0 .5"><joint name="shoulder" axis="0 0 1"/>{GEOM}
<body name="fore" pos="{{length}} 0 0"><joint name="elbow" axis="0 0 1" ref="{{zero}}"/>{GEOM}
<site name="tool" pos=".3 0 0"/></body></body></worldbody></mujoco>"""
BELIEVED = {
    "l2": 0.1,
    "l3": 0.4,
    "z2": 0.0,
    "z6": 0.0,
    "mark": 0.0,
    "turn": "1 0 0 0",
    "length": 0.4,
    "zero": 0.0,
}


def arm(text=SIX, **numbers):
    """A model with some numbers otherwise than believed."""
    return text.format(**{**BELIEVED, **numbers})


@dataclass(frozen=True)
class Capture:
    """How an arm is looked at: seconds at a rate, noise [m], its memory from sample to sample, delay [s], the frame."""

    seconds: float = 12.0
    dt: float = 0.02
    noise: float = 5e-4
    memory: float = 0.0
    delay: float = 0.0
    turned: tuple = (0.0, 0.0, 0.0)
    moved: tuple = (0.0, 0.0, 0.0)
    lost: float = 0.0
    leaping: float = 0.0
    oriented: bool = False
    seed: int = 0


def seen(truth, how=Capture(), site="tool"):
    """A table: t, what the encoders say, and where the site is seen; angles of every joint are sums of three waves."""
    rng = np.random.default_rng(how.seed)
    model = mujoco.MjModel.from_xml_string(truth)
    data = mujoco.MjData(model)
    t = np.arange(0.0, how.seconds, how.dt)
    rate, size, phase = (rng.uniform(*span, (model.nq, 3)) for span in ((0.1, 0.5), (0.2, 0.6), (0.0, 6.28)))

    def angles(at):
        return (size * np.sin(2 * np.pi * rate * at[:, None, None] + phase)).sum(axis=2)

    frame = Rotation.from_rotvec(how.turned)
    points, quats = np.empty((len(t), 3)), np.empty((len(t), 4))
    for k, q in enumerate(angles(t - how.delay)):
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        points[k] = frame.apply(data.site(site).xpos) + how.moved
        turn = frame * Rotation.from_matrix(data.site(site).xmat.reshape(3, 3))
        quats[k] = (Rotation.from_rotvec(1e-3 * rng.normal(size=3)) * turn).as_quat(scalar_first=True)
    errors = how.noise * rng.normal(size=points.shape)
    for k in range(1, len(t) if how.memory else 0):
        errors[k] = how.memory * errors[k - 1] + np.sqrt(1.0 - how.memory**2) * errors[k]
    points += errors
    points[rng.random(len(t)) < how.lost] = np.nan
    points[rng.random(len(t)) < how.leaping] += 0.3
    table = {"t": t} | {model.joint(j).name: q for j, q in enumerate(angles(t).T)}
    table |= {f"{site}.{axis}": p for axis, p in zip("xyz", points.T, strict=True)}
    if how.oriented:
        table |= {f"{site}.q{part}": q for part, q in zip("wxyz", quats.T, strict=True)}
    return pd.DataFrame(table)
