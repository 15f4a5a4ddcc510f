"""Make the logs of docs/tutorial/car.md, motor.md and servo_arm.md: python data/make_day.py FOLDER.

It uses nothing of gpsim: the logs must not know how they will be explained. The car acts 0.12 s after its commands,
goes at 0.9 of the commanded speed and turns 0.03 rad/s too far. The motor has 0.012 N m of dry friction, and its
driver takes 0.6 V off every voltage. The arm carries 0.4 kg at its tool; its shoulder has 0.6 N m of dry friction and
its elbow 0.35 N m.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pandas as pd

FINER = 50  # steps of the truth in one of the log
LATE, SLOWER, TURNS = 0.12, 0.9, 0.03  # s, 1, rad/s
RUBS, BAND = 0.012, 0.6  # N m, V
PAYLOAD, DRY = 0.4, {"shoulder": 0.6, "elbow": 0.35}  # kg, N m

ARM = """<mujoco model="servo_arm">
  <compiler angle="radian"/>
  <option timestep="0.002" integrator="implicitfast"/>
  <default><geom contype="0" conaffinity="0"/></default>
  <worldbody>
    <body name="turret" pos="0 0 0.1">
      <joint name="yaw" axis="0 0 1" armature="0.01" damping="0.1"/>
      <inertial pos="0 0 0.05" mass="1.5" diaginertia="0.006 0.006 0.004"/>
      <geom type="cylinder" size="0.05 0.05"/>
      <body name="upper" pos="0 0 0.1">
        <joint name="shoulder" axis="0 1 0" armature="0.02" damping="0.1"/>
        <inertial pos="0.15 0 0" mass="1.2" diaginertia="0.002 0.011 0.011"/>
        <geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.03"/>
        <body name="fore" pos="0.3 0 0">
          <joint name="elbow" axis="0 1 0" armature="0.01" damping="0.05"/>
          <inertial pos="0.12 0 0" mass="0.7" diaginertia="0.001 0.005 0.005"/>
          <geom type="capsule" fromto="0 0 0 0.25 0 0" size="0.025"/>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator>
    <position name="yaw_servo" joint="yaw" kp="60" kv="4"/>
    <position name="shoulder_servo" joint="shoulder" kp="120" kv="8"/>
    <position name="elbow_servo" joint="elbow" kp="60" kv="3"/>
  </actuator>
</mujoco>
"""


def held(
    rng: np.random.Generator, count: int, shortest: int, longest: int, low: float, high: float
) -> np.ndarray:
    """(count,): random levels, each held for a random number of samples."""
    lengths = rng.integers(shortest, longest, count)
    return np.repeat(rng.uniform(low, high, count), lengths)[:count]


def car(rng: np.random.Generator) -> pd.DataFrame:
    """80 s at 20 Hz: t [s], x, y [m], yaw [rad] of a motion capture, and the commanded speeds [m/s], [rad/s]."""
    dt, count, rows = 0.05, 1600, []
    v, w = held(rng, count, 12, 30, -0.4, 0.9), held(rng, count, 12, 30, -1.4, 1.4)
    x = y = yaw = 0.0
    for k in range(count):
        noise = rng.normal(size=3) * [5e-4, 5e-4, 2e-3]
        rows.append((k * dt, x + noise[0], y + noise[1], yaw + noise[2], v[k], w[k]))
        for i in range(FINER):
            then = int(np.floor(k + i / FINER - LATE / dt + 1e-9))
            speed, turn = (SLOWER * v[then], w[then] + TURNS) if then >= 0 else (0.0, TURNS)
            h = dt / FINER
            x += h * speed * np.cos(yaw + turn * h / 2)
            y += h * speed * np.sin(yaw + turn * h / 2)
            yaw += h * turn
    return pd.DataFrame(rows, columns=["t", "x", "y", "yaw", "v", "w"])


def as_table(log: pd.DataFrame) -> pd.DataFrame:
    """The same as a logger with habits of its own writes it."""
    return pd.DataFrame(
        {
            "time_ms": (1000 * log.t).round().astype(int),
            "pos_x": log.x.round(5),
            "pos_y": log.y.round(5),
            "heading_deg": np.rad2deg(log.yaw).round(3),
            "speed_cmd": log.v.round(4),
            "yawrate_cmd_deg": np.rad2deg(log.w).round(3),
        }
    )


def as_bag(log: pd.DataFrame, path: Path) -> None:
    """The same as a ROS 1 bag: a pose and a Twist."""
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    kinds = store.types
    stamped, twist, header, time = (
        kinds[name]
        for name in (
            "geometry_msgs/msg/PoseStamped",
            "geometry_msgs/msg/Twist",
            "std_msgs/msg/Header",
            "builtin_interfaces/msg/Time",
        )
    )
    pose, point, vector, quaternion = (
        kinds[f"geometry_msgs/msg/{name}"] for name in ("Pose", "Point", "Vector3", "Quaternion")
    )
    path.unlink(missing_ok=True)
    with Writer(path) as bag:
        seen = bag.add_connection("/mocap/car/pose", stamped.__msgtype__, typestore=store)
        told = bag.add_connection("/cmd_vel", twist.__msgtype__, typestore=store)
        for k, row in enumerate(log.itertuples()):
            when = round((1_700_000_000 + row.t) * 1e9)
            stamp = time(sec=when // 10**9, nanosec=when % 10**9)
            turned = quaternion(x=0.0, y=0.0, z=np.sin(row.yaw / 2), w=np.cos(row.yaw / 2))
            there = pose(position=point(x=row.x, y=row.y, z=0.05), orientation=turned)
            said = stamped(header=header(seq=k, stamp=stamp, frame_id="world"), pose=there)
            bag.write(seen, when, store.serialize_ros1(said, stamped.__msgtype__))
            command = twist(linear=vector(x=row.v, y=0.0, z=0.0), angular=vector(x=0.0, y=0.0, z=row.w))
            bag.write(told, when, store.serialize_ros1(command, twist.__msgtype__))


def motor(rng: np.random.Generator) -> pd.DataFrame:
    """20 s at 100 Hz: t [s], angle [rad], speed [rad/s] and the voltage [V] of a motor of 2e-4 kg m^2."""
    dt, count, rows = 0.01, 2000, []
    inertia, constant, resistance = 2e-4, 0.05, 1.2  # kg m^2, N m/A, ohm
    volts = held(rng, count, 15, 60, -7.0, 7.0) * held(rng, count, 60, 120, 0.2, 1.0)
    angle = speed = 0.0
    for k in range(count):
        noise = rng.normal(size=2) * [1e-3, 0.1]
        rows.append((k * dt, angle + noise[0], speed + noise[1], volts[k]))
        given = np.sign(volts[k]) * max(abs(volts[k]) - BAND, 0.0)
        for _ in range(FINER):
            h, torque = dt / FINER, constant * (given - constant * speed) / resistance
            way = np.sign(speed) if speed else np.sign(torque)
            pushes = abs(torque) > RUBS or speed != 0.0
            after = speed + h * (torque - way * RUBS) / inertia if pushes else 0.0
            speed = 0.0 if speed * after < 0.0 else after
            angle += h * speed
    return pd.DataFrame(rows, columns=["t", "angle", "speed", "voltage"])


def arm(rng: np.random.Generator) -> pd.DataFrame:
    """Two drives of 15 s at 100 Hz: what encoders say [rad], and the positions [rad] that servos were asked for."""
    import mujoco

    spec = mujoco.MjSpec.from_string(ARM)
    load = spec.body("fore").add_body(name="load", pos=[0.25, 0.0, 0.0])
    load.explicitinertial, load.mass, load.ipos, load.inertia = True, PAYLOAD, [0.0] * 3, [1e-4] * 3
    for joint, force in DRY.items():
        spec.joint(joint).frictionloss = force
    spec.option.timestep = 0.0005
    model, dt, rows = spec.compile(), 0.01, []
    tones, middle = np.arange(1, 6), np.array([0.0, -0.5, 0.8])
    for episode in range(2):
        data = mujoco.MjData(model)
        heights, phases = rng.uniform(-0.8, 0.8, (3, 5)) / tones, rng.uniform(0.0, 6.3, (3, 5))
        for k in range(1500):
            asked = middle + (heights * np.sin(0.5 * np.pi * tones * k * dt + phases)).sum(axis=1)
            asked = np.round(min(k * dt / 2.0, 1.0) * asked, 5)
            rows.append((episode, k * dt, *(data.qpos + 2e-4 * rng.normal(size=3)), *asked))
            data.ctrl[:] = asked
            mujoco.mj_step(model, data, nstep=round(dt / model.opt.timestep))
    joints = ["yaw", "shoulder", "elbow"]
    return pd.DataFrame(rows, columns=["episode", "t", *joints, *(f"{j}_servo" for j in joints)])


def main(folder: Path) -> None:
    """Write all of them."""
    folder.mkdir(parents=True, exist_ok=True)
    drive = car(np.random.default_rng(4))
    as_bag(drive, folder / "drive.bag")
    as_table(drive).to_csv(folder / "odd.csv", index=False)
    from scipy.io import savemat

    savemat(folder / "car.mat", {name: column.to_numpy() for name, column in as_table(drive).items()})
    motor(np.random.default_rng(1)).round(5).to_csv(folder / "motor.csv", index=False)
    (folder / "servo_arm.xml").write_text(ARM, encoding="utf-8")
    arm(np.random.default_rng(2)).round(5).to_csv(folder / "servo_arm.csv", index=False)
    arm(np.random.default_rng(3)).round(5).to_csv(folder / "servo_arm_later.csv", index=False)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
