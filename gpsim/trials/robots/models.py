"""The robots of the trials: which model each is published as, where its file comes from, how it is driven.

A model is published as its authors wrote it. Of a URDF the meshes are left out, which need files of tens of megabytes
and change no motion: mass and inertia stand beside them.
"""

from __future__ import annotations

import importlib.metadata
import importlib.util
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal, NamedTuple
from xml.etree import ElementTree

import numpy as np

from gpsim.errors import UsageError
from gpsim.trials.bodies import mujoco
from gpsim.trials.worlds import rounded

Files = Mapping[str, str]
"""Name beside the recording -> text."""
Way = Literal["balance", "swing", "servo", "torque"]
"""How it is kept in bounds: a pole upright, a weak centring, its own servos, a controller with gravity feed-forward."""


class Drives(NamedTuple):
    """What the joints are driven with: torque [N m, N] and speed at most, and how fast the torque spins up a rotor.

    spin: rad/s^2, the torque over the rotor's inertia behind its gears, from the most to the least inertia.
    """

    torque: tuple[float, ...]
    speed: float = 3.14
    spin: tuple[float, float] = (60.0, 600.0)


@dataclass(frozen=True)
class Robot:
    """One robot. rest: its joints where it is driven from; spread: how far episodes begin from there [rad, m].

    reach: how far a joint's reference or a servo's command goes from rest; steps: control steps [s], multiples of the
    model's own; masses, carriers: bodies whose mass may differ, and that may carry a payload; zeros: joints whose
    place matters to the motion, so that an encoder's zero shows; tilts: whether gravity is seen in both directions.
    drives: of a passive joint its torque is about the weight's.
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
    drives: Drives
    tilts: bool = False


def _afloat(name: str, files: Callable[[], Files], steps: tuple[float, ...], body: str) -> Robot:
    """One that a controller of its own keeps up: what is drawn of it stands in `afloat`."""
    return Robot(name, f"{name}.xml", files, (), steps, {}, (), (), (body,), (), (), Drives(()))


def of_own(name: str, called: str = "") -> Files:
    """A model that lies beside this file."""
    return {called or f"{name}.xml": _text(Path(__file__).with_name(f"{name}.xml"))}


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


UPRIGHT, HANGING = (0.0, 0.0, 0.0), (0.0, 3.141592653589793, 0.0)
ROBOTS: Mapping[str, Robot] = {
    robot.name: robot
    for robot in (
        Robot(
            "gym_pendulum", "inverted_pendulum.xml", lambda: of_gymnasium("inverted_pendulum.xml"),
            ("balance",), (0.02,), {"balance": (0.0, 0.0)}, (0.1, 0.06), (0.4, 0.0),
            masses=("cart", "pole"), carriers=("pole",), zeros=("hinge",), drives=Drives((80.0, 15.0), 4.0),
        ),
        Robot(
            "gym_double_pendulum", "inverted_double_pendulum.xml",
            lambda: of_gymnasium("inverted_double_pendulum.xml"),
            ("swing", "balance"), (0.01, 0.02), {"balance": UPRIGHT, "swing": HANGING}, (0.1, 0.03, 0.03),
            (0.3, 0.0, 0.0), masses=("cart", "pole", "pole2"), carriers=("pole", "pole2"),
            zeros=("hinge", "hinge2"), drives=Drives((200.0, 20.0, 8.0), 4.0),
        ),
        Robot(
            "dm_acrobot", "acrobot.xml", lambda: of_suite("acrobot.xml"), ("swing",), (0.01, 0.02),
            {"swing": (3.141592653589793, 0.0)}, (0.5, 0.5), (1.2, 1.2), masses=("upper_arm", "lower_arm"),
            carriers=("upper_arm", "lower_arm"), zeros=("shoulder", "elbow"), drives=Drives((10.0, 4.0), 4.0),
        ),
        Robot(
            "dm_reacher", "reacher.xml", lambda: of_suite("reacher.xml"), ("swing",), (0.02,),
            {"swing": (0.0, 1.2)}, (0.5, 0.4), (1.0, 0.7), masses=("arm", "hand"), carriers=("hand",), zeros=(),
            drives=Drives((0.05, 0.03), 6.0),
        ),
        Robot(
            "arm", "robot.xml", lambda: of_own("arm", "robot.xml"), ("servo",), (0.008, 0.012, 0.02),
            {"servo": (0.0, 0.4, 0.5, 0.2)}, (0.4, 0.3, 0.3, 0.4), (0.9, 0.6, 0.7, 0.9),
            masses=("upper", "fore", "hand"), carriers=("fore", "hand"),
            zeros=("shoulder", "elbow", "wrist"), drives=Drives((40.0, 60.0, 25.0, 4.0)), tilts=True,
        ),
        Robot(
            "ur5", "ur5_robot.urdf", lambda: of_robot_data("ur_description/urdf/ur5_robot.urdf"), ("torque",),
            (0.01, 0.02), {"torque": (0.0, -1.2, 1.2, -0.6, 0.9, 0.0)}, (0.3,) * 6, (0.9, 0.5, 0.6, 0.9, 0.9, 1.2),
            masses=("upper_arm_link", "forearm_link", "wrist_2_link"), carriers=("forearm_link", "wrist_3_link"),
            zeros=("shoulder_lift_joint", "elbow_joint", "wrist_1_joint"),
            drives=Drives((150.0,) * 3 + (28.0,) * 3), tilts=True,
        ),
    )
}  # fmt: skip
"""Every robot by its name."""


OTHERS: Mapping[str, Robot] = {
    robot.name: robot
    for robot in (
        Robot(
            "panda", "panda.urdf",
            lambda: of_robot_data(
                "panda_description/urdf/panda.urdf", ("panda_finger_joint1", "panda_finger_joint2"), dynamics=False
            ),
            ("torque",), (0.01,), {"torque": (0.0, -0.4, 0.0, -1.9, 0.0, 1.7, 0.7)}, (0.2,) * 7,
            (1.0, 0.6, 0.9, 0.7, 1.0, 0.9, 1.2), masses=("panda_link3", "panda_link4", "panda_link6"),
            carriers=("panda_link7",), zeros=(), drives=Drives((87.0,) * 4 + (12.0,) * 3, 2.4), tilts=True,
        ),
        Robot(
            "ur5e", "ur5e.xml", lambda: of_own("ur5e"), ("torque",), (0.01,),
            {"torque": (0.0, -1.0, 1.2, -0.5, 0.9, 0.0)}, (0.2,) * 6, (0.9, 0.5, 0.6, 0.9, 0.9, 1.2),
            masses=("upper_arm", "forearm", "wrist_2"), carriers=("wrist_3",), zeros=(),
            drives=Drives((150.0,) * 3 + (28.0,) * 3), tilts=True,
        ),
        Robot(
            "z1", "z1.urdf",
            lambda: of_robot_data("z1_description/urdf/z1.urdf", ("jointGripper",), dynamics=False),
            ("torque",), (0.01,), {"torque": (0.0, 1.3, -1.2, 0.0, 0.0, 0.0)}, (0.2,) * 6,
            (0.9, 0.6, 0.6, 0.8, 0.8, 1.2), masses=("link02", "link03", "link05"), carriers=("link06",), zeros=(),
            drives=Drives((30.0, 60.0, 30.0, 30.0, 30.0, 30.0), spin=(300.0, 3000.0)), tilts=True,
        ),
        Robot(
            "xarm7", "xarm7.urdf", lambda: of_robot_data("xarm_description/urdf/xarm7.urdf", dynamics=False),
            ("torque",), (0.01,), {"torque": (0.0, 0.3, 0.0, 1.4, 0.0, 1.1, 0.0)}, (0.2,) * 7,
            (0.9, 0.5, 0.9, 0.6, 1.0, 0.8, 1.2), masses=("link3", "link4", "link6"), carriers=("link7",), zeros=(),
            drives=Drives((50.0, 50.0, 30.0, 30.0, 30.0, 20.0, 20.0)), tilts=True,
        ),
        Robot(
            "planar", "planar.xml", lambda: of_own("planar"), ("torque",), (0.005, 0.01),
            {"torque": (0.3, -0.4)}, (0.4, 0.4), (1.2, 1.3), masses=("upper", "lower"), carriers=("lower",),
            zeros=(), drives=Drives((12.0, 5.0), 6.0),
        ),
        Robot(
            "leg", "leg.xml", lambda: of_own("leg"), ("torque",), (0.005, 0.01),
            {"torque": (0.0, 0.8, -1.6)}, (0.2, 0.2, 0.2), (0.5, 0.7, 0.6), masses=("thigh", "calf"),
            carriers=("calf",), zeros=(), drives=Drives((23.7, 23.7, 45.4), 12.0, (1500.0, 8000.0)),
        ),
    )
}  # fmt: skip
"""Robots that whole robots' worlds have besides."""
AFLOAT: Mapping[str, Robot] = {
    robot.name: robot
    for robot in (
        _afloat("quadrotor", lambda: of_own("quadrotor"), (0.005, 0.01), "frame"),
        _afloat("boat", lambda: of_own("boat"), (0.02, 0.025, 0.04, 0.05), "hull"),
        _afloat("hopper", lambda: of_gymnasium("hopper.xml"), (0.01,), "torso"),
        _afloat("dog", lambda: of_own("dog"), (0.01,), "trunk"),
    )
}
"""Robots that float, or stand on a floor that nothing ties them to."""
SERVOS = "_servos"  # behind the name of a robot whose motors are position servos
SERVOED = ("ur5", *OTHERS)
"""Robots with a motor on each joint, which position servos may be instead."""
WHOLE = (*ROBOTS, *OTHERS)
"""Robots that may be whole ones."""
GIVES_WAY = 0.06  # rad by which a position servo gives way to its torque
DAMPED = 0.8  # of a servo's critical damping


def robot_of(name: str) -> Robot:
    """The robot of a name."""
    bare = {**ROBOTS, **OTHERS, **AFLOAT}[name.removesuffix(SERVOS)]
    if not name.endswith(SERVOS):
        return bare
    return replace(
        bare,
        name=name,
        file=bare.file.replace(".urdf", ".xml"),
        ways=("servo",),
        rest={"servo": bare.rest["torque"]},
    )


@lru_cache(maxsize=8)
def files_of(name: str) -> Files:
    """What is published of a robot: the model's file first, then what it includes; raises UsageError."""
    robot, servos = robot_of(name), name.endswith(SERVOS)
    files = robot.files()
    if (name not in OTHERS and not servos) or (not servos and robot.file.endswith(".urdf")):
        return files
    (text,) = files.values()
    return {robot.file: _actuated(text, robot.drives, servos)}


def _actuated(text: str, drives: Drives, servos: bool) -> str:
    """A model with a motor of so much torque on each joint, or a position servo."""
    mj = mujoco()
    spec = mj.MjSpec.from_string(text)
    model = spec.compile()
    for i, (joint, torque) in enumerate(zip(spec.joints, drives.torque, strict=True)):
        kind = "servo" if servos else "motor"
        made = spec.add_actuator(
            name=f"{joint.name}_{kind}", target=joint.name, trntype=mj.mjtTrn.mjTRN_JOINT
        )
        if not servos:
            made.ctrllimited, made.ctrlrange = True, (-torque, torque)
            continue
        kp = rounded(torque / GIVES_WAY)
        moved = float(model.dof_M0[i]) + torque / drives.spin[1]
        made.set_to_position(kp, kv=rounded(2.0 * DAMPED * float(np.sqrt(kp * moved))))
        made.ctrllimited, made.ctrlrange = True, model.jnt_range[i]
    spec.compile()
    return str(spec.to_xml())


def spec_of(name: str) -> Any:
    """The model as published, not yet compiled; a URDF gets a motor JOINT_motor on each joint."""
    mj, files = mujoco(), files_of(name)
    file = robot_of(name).file
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
    """A robot's channels: joints in order, each followed by its velocity; actions; and their units.

    Of a free joint its pose, then its twist. driven: none for an actuator at a site.
    """

    joints: tuple[str, ...]
    state: Mapping[str, str]
    action: Mapping[str, str]
    servos: tuple[str, ...]  # actions whose force is a gain times how far the joint is from the command
    driven: Mapping[str, str]  # action -> the joint that it moves

    @property
    def names(self) -> tuple[str, ...]:
        """State channels in column order."""
        return tuple(self.state)

    @property
    def places(self) -> tuple[str, ...]:
        """Those of them that are no velocity."""
        return tuple(name for name, unit in self.state.items() if not unit.endswith("/s"))


FREE = {
    **dict.fromkeys(("x", "y", "z"), "m"), **dict.fromkeys(("qw", "qx", "qy", "qz"), "1"),
    **dict.fromkeys(("vx", "vy", "vz"), "m/s"), **dict.fromkeys(("wx", "wy", "wz"), "rad/s"),
}  # fmt: skip
"""Pose and twist of a free joint: linear velocity in the world, angular in the body."""


@lru_cache(maxsize=8)
def layout_of(name: str) -> Layout:
    """The channels of a robot, as recordings of MuJoCo models call them (docs/how-to/mujoco.md)."""
    mj, model = mujoco(), spec_of(name).compile()
    hinge = [int(t) == mj.mjtJoint.mjJNT_HINGE for t in model.jnt_type]
    joints = tuple(model.joint(j).name or f"joint{j}" for j in range(model.njnt))
    lengths = ["rad" if turns else "m" for turns in hinge]
    state: dict[str, str] = {}
    for joint, unit, kind in zip(joints, lengths, model.jnt_type, strict=True):
        free = int(kind) == mj.mjtJoint.mjJNT_FREE
        afloat = {f"{joint}.{part}": u for part, u in FREE.items()}
        state |= afloat if free else {joint: unit, f"{joint}_dot": f"{unit}/s"}
    action, driven, servos = {}, {}, []
    for i in range(model.nu):
        own = model.actuator(i).name or f"actuator{i}"
        called, j = f"{own}_cmd" if own in state else own, int(model.actuator_trnid[i, 0])
        if int(model.actuator_trntype[i]) == mj.mjtTrn.mjTRN_SITE:
            action[called] = "1"
            continue
        servo = float(model.actuator_biasprm[i, 1]) != 0.0
        plain = float(model.actuator_gear[i, 0]) == 1.0 and float(model.actuator_gainprm[i, 0]) == 1.0
        action[called] = lengths[j] if servo else ("N m" if hinge[j] else "N") if plain else "1"
        driven[called] = joints[j]
        servos += [called] if servo else []
    return Layout(joints, state, action, tuple(servos), driven)
