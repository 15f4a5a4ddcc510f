"""What is exported as URDF moves as the model does, read back by MuJoCo; what URDF cannot hold is listed."""

import mujoco
import numpy as np
import pytest

from gpsim.effects import Term
from gpsim.mjcf import Correction, export_model, load_mjcf

ARM = """<mujoco><compiler angle="radian"/><option gravity="0 0 -9.81"/><worldbody>
<body name="base" pos="0.1 0.2 0.3" euler="0.3 0.2 -0.4"><inertial pos="0 0 0.01" mass="1" diaginertia="0.01 0.02 0.015"/>
<body name="upper" pos="0.05 0 0.1" euler="0.1 -0.2 0.5"><joint name="yaw" axis="0 0 1" pos="0.02 0.01 -0.03" ref="0.2"/>
<joint name="pitch" axis="0 1 0" pos="-0.01 0.02 0.04" range="-1.5 1.5" limited="true" damping="0.3" frictionloss="0.05"/>
<geom name="box" type="box" size="0.02 0.03 0.1" mass="0.7" pos="0 0.01 0.1" euler="0.2 0 0"/>
<body name="lower" pos="0 0 0.25" quat="0.9 0.1 -0.3 0.2"><joint name="slide" type="slide" axis="1 0 1" ref="0.03"/>
<inertial pos="0.01 0.02 0.1" mass="0.4" fullinertia="0.004 0.005 0.003 0.0004 -0.0002 0.0003"/>
<body name="tool" pos="0.02 0 0.2"><joint name="roll" axis="1 2 3" pos="0 0.01 0" armature="0.002" stiffness="0.1"/>
<geom name="tip" type="sphere" size="0.03" mass="0.2" pos="0 0 0.05"/></body></body></body></body></worldbody>
<actuator><motor name="m" joint="pitch" forcerange="-3 3" gear="2"/></actuator></mujoco>"""
HELD = {"yaw": 0, "pitch": 0, "slide": 0, "roll": 0}


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("urdf")
    (folder / "arm.xml").write_text(ARM)
    simulator = load_mjcf(str(folder / "arm.xml"))
    terms = (
        Term("viscous_friction", "yaw", {"damping": 0.07}),
        Term("parameter_offset", "tool.mass", {"ratio": 1.5}),
    )
    correction = Correction(simulator, simulator.defaults({}), terms, 0.01, 10)
    exported = export_model(correction, {}, {}, folder / "out.xml", urdf=True)
    return exported, *(mujoco.MjModel.from_xml_path(str(exported.files[k])) for k in ("model", "urdf"))


def dynamics(model, q, v):
    """The mass matrix without rotors, and the forces of gravity and of motion."""
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = q, v
    mujoco.mj_forward(model, data)
    mass = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, mass, data.qM) if not hasattr(data, "M") else mujoco.mj_fullM(model, data, mass)
    return mass - np.diag(model.dof_armature), np.array(data.qfrc_bias), np.array(data.body("tool").xipos)


def test_it_moves_as_the_model_does(made):
    _, model, back = made
    rng = np.random.default_rng(0)
    assert [back.joint(j).name for j in range(back.njnt)] == list(HELD)
    for _ in range(20):
        q, v = rng.normal(size=4), rng.normal(size=4)
        for one, other in zip(dynamics(model, q, v), dynamics(back, q, v), strict=True):
            np.testing.assert_allclose(other, one, rtol=1e-5, atol=3e-5)  # links between joints weigh 1 mg


def test_friction_and_limits_are_there(made):
    _, model, back = made
    np.testing.assert_allclose(back.dof_damping, model.dof_damping)
    np.testing.assert_allclose(back.dof_frictionloss, model.dof_frictionloss)
    assert tuple(back.joint("pitch").range) == (-1.5, 1.5)
    assert tuple(back.jnt_actfrcrange[back.joint("pitch").id]) == (-6.0, 6.0)  # 3 N m through a gear of 2


def test_what_urdf_cannot_hold_is_listed(made):
    lost = "\n".join(made[0].lost)
    for what in (
        "armature): roll 0.002",
        "springs of joints: roll 0.1",
        "actuators, their gains and servos: m",
    ):
        assert what in lost
