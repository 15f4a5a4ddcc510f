"""The robots of the trials: which model each is published as, where its file comes from, how it is driven.

A model is published as its authors wrote it. Of a URDF the meshes are left out, which need files of tens of megabytes
and change no motion: mass and inertia stand beside them.
"""

from __future__ import annotations

import importlib.metadata
import importlib.util
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal
from xml.etree import ElementTree

from gpsim.errors import UsageError

ARM = """<mujoco model="trial_arm">
  <compiler angle="radian"/>
  <option timestep="0.004" integrator="implicitfast"/>
  <default>
    <geom type="capsule" contype="0" conaffinity="0"/>
    <joint type="hinge" limited="true"/>
  </default>
  <worldbody>
    <body name="turret" pos="0 0 0.2">
      <joint name="yaw" axis="0 0 1" range="-2.8 2.8" damping="0.6" armature="0.08"/>
      <geom fromto="0 0 0 0 0 0.15" size="0.06" mass="3.5"/>
      <body name="upper" pos="0 0 0.15">
        <joint name="shoulder" axis="0 1 0" range="-2.2 2.2" damping="0.8" armature="0.1"/>
        <geom fromto="0 0 0 0.02 0 0.38" size="0.05" mass="3.2"/>
        <body name="fore" pos="0.02 0 0.38">
          <joint name="elbow" axis="0 1 0" range="-2.5 2.5" damping="0.4" armature="0.05"/>
          <geom fromto="0 0 0 0.3 0.02 0" size="0.04" mass="1.8"/>
          <body name="hand" pos="0.3 0.02 0">
            <joint name="wrist" axis="0 1 0" range="-2.5 2.5" damping="0.08" armature="0.01"/>
            <geom fromto="0 0 0 0.12 0 0.02" size="0.03" mass="0.6"/>
          </body>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator>
    <position name="yaw_servo" joint="yaw" kp="220" kv="18" ctrlrange="-2.5 2.5"/>
    <position name="shoulder_servo" joint="shoulder" kp="380" kv="30" ctrlrange="-2 2"/>
    <position name="elbow_servo" joint="elbow" kp="180" kv="12" ctrlrange="-2.2 2.2"/>
    <position name="wrist_servo" joint="wrist" kp="25" kv="1.2" ctrlrange="-2.2 2.2"/>
  </actuator>
</mujoco>
"""
"""The arm of the trials: four hinges, a position servo on each, written here."""

Files = Mapping[str, str]
"""Name beside the recording -> text."""
Way = Literal["balance", "swing", "servo", "torque"]
"""How it is kept in bounds: a pole upright, a weak centring, its own servos, a controller with gravity feed-forward."""


@dataclass(frozen=True)
class Robot:
    """One robot. rest: its joints where it is driven from; spread: how far episodes begin from there [rad, m].

    reach: how far a joint's reference or a servo's command goes from rest; steps: control steps [s], multiples of the
    model's own; masses, carriers: bodies whose mass may differ, and that may carry a payload; zeros: joints whose
    place matters to the motion, so that an encoder's zero shows; tilts: whether gravity is seen in both directions.
    """

    name: str
    file: str
    files: Callable[[], Files]
    ways: tuple[Way, ...]
    steps: tuple[float, ...]
    rest: Mapping[Way, tuple[float, ...]]
    spread: tuple[float, ...]
    reach: tuple[float, ...]
    masses: tuple[str, ...]
    carriers: tuple[str, ...]
    zeros: tuple[str, ...]
    tilts: bool = False


def _of_gymnasium(name: str) -> Files:
    return {name: _text(_package("gymnasium") / "envs" / "mujoco" / "assets" / name)}


def _of_suite(name: str) -> Files:
    """A model of dm_control's suite, and the three files that it includes."""
    suite = _package("dm_control") / "suite"
    shared = (f"common/{part}.xml" for part in ("skybox", "visual", "materials"))
    return {file: _text(suite / file) for file in (name, *shared)}


def _of_robot_data(path: str) -> Files:
    """A URDF of example-robot-data without its meshes."""
    try:
        found = importlib.metadata.distribution("example-robot-data")
    except importlib.metadata.PackageNotFoundError:
        raise _missing("example-robot-data") from None
    where = Path(str(found.locate_file(f"cmeel.prefix/share/example-robot-data/robots/{path}")))
    root = ElementTree.fromstring(_text(where))
    for link in root.iter("link"):
        for part in [*link.findall("visual"), *link.findall("collision")]:
            link.remove(part)
    return {Path(path).name: ElementTree.tostring(root, encoding="unicode") + "\n"}


def _package(name: str) -> Path:
    """The folder of an installed package; raises UsageError. The package is not imported."""
    found = importlib.util.find_spec(name)
    if found is None or not found.submodule_search_locations:
        raise _missing(name)
    return Path(found.submodule_search_locations[0])


def _missing(name: str) -> UsageError:
    return UsageError(
        f"prove --system mjcf: no package {name}, whose models it takes; install it with: pip install 'gpsim[prove]'"
    )


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise UsageError(f"{path}: {error.strerror}; install it anew: pip install 'gpsim[prove]'") from error


UPRIGHT, HANGING = (0.0, 0.0, 0.0), (0.0, 3.141592653589793, 0.0)
ROBOTS: Mapping[str, Robot] = {
    robot.name: robot
    for robot in (
        Robot(
            "gym_pendulum", "inverted_pendulum.xml", lambda: _of_gymnasium("inverted_pendulum.xml"),
            ("balance",), (0.02,), {"balance": (0.0, 0.0)}, (0.1, 0.06), (0.4, 0.0),
            masses=("cart", "pole"), carriers=("pole",), zeros=("hinge",),
        ),
        Robot(
            "gym_double_pendulum", "inverted_double_pendulum.xml",
            lambda: _of_gymnasium("inverted_double_pendulum.xml"),
            ("swing", "balance"), (0.01, 0.02), {"balance": UPRIGHT, "swing": HANGING}, (0.1, 0.03, 0.03),
            (0.3, 0.0, 0.0), masses=("cart", "pole", "pole2"), carriers=("pole", "pole2"),
            zeros=("hinge", "hinge2"),
        ),
        Robot(
            "dm_acrobot", "acrobot.xml", lambda: _of_suite("acrobot.xml"), ("swing",), (0.01, 0.02),
            {"swing": (3.141592653589793, 0.0)}, (0.5, 0.5), (1.2, 1.2), masses=("upper_arm", "lower_arm"),
            carriers=("upper_arm", "lower_arm"), zeros=("shoulder", "elbow"),
        ),
        Robot(
            "dm_reacher", "reacher.xml", lambda: _of_suite("reacher.xml"), ("swing",), (0.02,),
            {"swing": (0.0, 1.2)}, (0.5, 0.4), (1.0, 0.7), masses=("arm", "hand"), carriers=("hand",), zeros=(),
        ),
        Robot(
            "arm", "robot.xml", lambda: {"robot.xml": ARM}, ("servo",), (0.008, 0.012, 0.02),
            {"servo": (0.0, 0.4, 0.5, 0.2)}, (0.4, 0.3, 0.3, 0.4), (0.9, 0.6, 0.7, 0.9),
            masses=("upper", "fore", "hand"), carriers=("fore", "hand"),
            zeros=("shoulder", "elbow", "wrist"), tilts=True,
        ),
        Robot(
            "ur5", "ur5_robot.urdf", lambda: _of_robot_data("ur_description/urdf/ur5_robot.urdf"), ("torque",),
            (0.01, 0.02), {"torque": (0.0, -1.2, 1.2, -0.6, 0.9, 0.0)}, (0.3,) * 6, (0.9, 0.5, 0.6, 0.9, 0.9, 1.2),
            masses=("upper_arm_link", "forearm_link", "wrist_2_link"), carriers=("forearm_link", "wrist_3_link"),
            zeros=("shoulder_lift_joint", "elbow_joint", "wrist_1_joint"), tilts=True,
        ),
    )
}  # fmt: skip
"""Every robot by its name."""


@lru_cache(maxsize=8)
def files_of(name: str) -> Files:
    """What is published of a robot: the model's file first, then what it includes; raises UsageError."""
    return ROBOTS[name].files()


def mujoco() -> Any:
    """The package; raises UsageError where it is not installed."""
    try:
        import mujoco as found
    except ImportError as error:
        raise UsageError(
            "a concealed world needs MuJoCo; install it with: pip install 'gpsim[prove]'"
        ) from error
    return found


def spec_of(name: str) -> Any:
    """The model as published, not yet compiled; a URDF gets a motor JOINT_motor on each joint."""
    mj, files = mujoco(), files_of(name)
    file = ROBOTS[name].file
    include = {other: text.encode() for other, text in files.items() if other != file}
    spec = (
        mj.MjSpec.from_string(files[file], include=include) if include else mj.MjSpec.from_string(files[file])
    )
    if file.endswith(".urdf"):
        for joint in spec.joints:
            spec.add_actuator(name=f"{joint.name}_motor", target=joint.name, trntype=mj.mjtTrn.mjTRN_JOINT)
    return spec


@dataclass(frozen=True)
class Layout:
    """A robot's channels: joints in order, each followed by its velocity; actions; and their units."""

    joints: tuple[str, ...]
    state: Mapping[str, str]
    action: Mapping[str, str]
    servos: tuple[str, ...]  # actions whose force is a gain times how far the joint is from the command
    driven: Mapping[str, str]  # action -> the joint that it moves

    @property
    def names(self) -> tuple[str, ...]:
        """State channels in column order."""
        return tuple(self.state)


@lru_cache(maxsize=8)
def layout_of(name: str) -> Layout:
    """The channels of a robot, as recordings of MuJoCo models call them (docs/how-to/mujoco.md)."""
    mj, model = mujoco(), spec_of(name).compile()
    hinge = [int(t) == mj.mjtJoint.mjJNT_HINGE for t in model.jnt_type]
    joints = tuple(model.joint(j).name or f"joint{j}" for j in range(model.njnt))
    lengths = ["rad" if turns else "m" for turns in hinge]
    state: dict[str, str] = {}
    for joint, unit in zip(joints, lengths, strict=True):
        state |= {joint: unit, f"{joint}_dot": f"{unit}/s"}
    action, driven, servos = {}, {}, []
    for i in range(model.nu):
        own = model.actuator(i).name or f"actuator{i}"
        called, j = f"{own}_cmd" if own in state else own, int(model.actuator_trnid[i, 0])
        servo = float(model.actuator_biasprm[i, 1]) != 0.0
        plain = float(model.actuator_gear[i, 0]) == 1.0 and float(model.actuator_gainprm[i, 0]) == 1.0
        action[called] = lengths[j] if servo else ("N m" if hinge[j] else "N") if plain else "1"
        driven[called] = joints[j]
        servos += [called] if servo else []
    return Layout(joints, state, action, tuple(servos), driven)
