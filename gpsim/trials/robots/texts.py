"""Where the models of the robots are from: packages that are installed, and those written here."""

from __future__ import annotations

import importlib.metadata
import importlib.util
from collections.abc import Mapping, Sequence
from pathlib import Path
from xml.etree import ElementTree

from gpsim.errors import UsageError

Files = Mapping[str, str]
"""Name beside the recording -> text."""


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

UR5E = """<mujoco model="ur5e">
  <compiler angle="radian"/>
  <option timestep="0.002" integrator="implicitfast"/>
  <default>
    <joint type="hinge" axis="0 1 0" limited="true" range="-6.28 6.28"/>
  </default>
  <worldbody>
    <body name="shoulder" pos="0 0 0.1625">
      <joint name="pan" axis="0 0 1"/>
      <inertial pos="0 -0.00193 -0.02561" mass="3.761" diaginertia="0.0103 0.0103 0.0067"/>
      <body name="upper_arm" pos="0 0.138 0">
        <joint name="lift"/>
        <inertial pos="0.2125 0 0" mass="8.058" diaginertia="0.0151 0.1339 0.1339"/>
        <body name="forearm" pos="0.425 -0.131 0">
          <joint name="elbow" range="-3.1 3.1"/>
          <inertial pos="0.19 0 0" mass="2.846" diaginertia="0.0041 0.0312 0.0312"/>
          <body name="wrist_1" pos="0.3922 0 0">
            <joint name="wrist1"/>
            <inertial pos="0 0.1264 -0.0018" mass="1.37" diaginertia="0.0026 0.0022 0.0026"/>
            <body name="wrist_2" pos="0 0.1264 0">
              <joint name="wrist2" axis="0 0 -1"/>
              <inertial pos="0 0.0018 -0.0834" mass="1.3" diaginertia="0.0026 0.0026 0.0022"/>
              <body name="wrist_3" pos="0 0 -0.0997">
                <joint name="wrist3"/>
                <inertial pos="0 0.0797 0" mass="0.365" diaginertia="0.00026 0.0002 0.00026"/>
              </body>
            </body>
          </body>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>
"""
"""Lengths, masses and centres of mass as Universal Robots publishes them, moments of inertia of such tubes."""

PLANAR = """<mujoco model="planar_arm">
  <compiler angle="radian"/>
  <option timestep="0.002" integrator="implicitfast"/>
  <default>
    <joint type="hinge" axis="0 1 0" limited="true" range="-3 3"/>
  </default>
  <worldbody>
    <body name="upper">
      <joint name="shoulder"/>
      <inertial pos="0 0 -0.14" mass="1.4" diaginertia="0.012 0.012 0.0008"/>
      <body name="lower" pos="0 0 -0.3">
        <joint name="elbow"/>
        <inertial pos="0.01 0 -0.11" mass="0.8" diaginertia="0.005 0.005 0.0004"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""
"""An arm of two joints in a vertical plane, masses written as inertials."""

LEG = """<mujoco model="leg">
  <compiler angle="radian"/>
  <option timestep="0.002" integrator="implicitfast"/>
  <default>
    <joint type="hinge" axis="0 1 0" limited="true"/>
  </default>
  <worldbody>
    <body name="hip" pos="0 0 0.6">
      <joint name="abduct" axis="1 0 0" range="-1.05 1.05"/>
      <inertial pos="-0.005 0.002 0" mass="0.767" diaginertia="0.0006 0.0009 0.0006"/>
      <body name="thigh" pos="0 0.0955 0">
        <joint name="swing" range="-1.57 3.49"/>
        <inertial pos="-0.0037 -0.0223 -0.0327" mass="1.241" diaginertia="0.006 0.006 0.0011"/>
        <body name="calf" pos="0 0 -0.213">
          <joint name="knee" range="-2.72 -0.83"/>
          <inertial pos="0.0044 0 -0.1346" mass="0.194" diaginertia="0.0014 0.0014 0.00004"/>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>
"""
"""A leg of a quadruped of 15 kg, its trunk held on a stand; masses and lengths as Unitree's Go2 has them."""


def of_gymnasium(name: str) -> Files:
    """A model of Gymnasium's environments."""
    return {name: _text(_package("gymnasium") / "envs" / "mujoco" / "assets" / name)}


def of_suite(name: str) -> Files:
    """A model of dm_control's suite, and the three files that it includes."""
    suite = _package("dm_control") / "suite"
    shared = (f"common/{part}.xml" for part in ("skybox", "visual", "materials"))
    return {file: _text(suite / file) for file in (name, *shared)}


def of_robot_data(path: str, stiff: Sequence[str] = (), dynamics: bool = True) -> Files:
    """A URDF of example-robot-data without its meshes.

    stiff: joints of a gripper, which is held still; dynamics: whether guesses of friction stay in it.
    """
    try:
        found = importlib.metadata.distribution("example-robot-data")
    except importlib.metadata.PackageNotFoundError:
        raise _missing("example-robot-data") from None
    where = Path(str(found.locate_file(f"cmeel.prefix/share/example-robot-data/robots/{path}")))
    root = ElementTree.fromstring(_text(where))
    for link in root.iter("link"):
        for part in [*link.findall("visual"), *link.findall("collision")]:
            link.remove(part)
    for joint in root.iter("joint"):
        held = joint.get("name") in stiff
        if held:
            joint.set("type", "fixed")
        names = [*(() if dynamics else ("dynamics",)), *(("limit", "mimic", "axis") if held else ())]
        for part in [part for name in names for part in joint.findall(name)]:
            joint.remove(part)
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
