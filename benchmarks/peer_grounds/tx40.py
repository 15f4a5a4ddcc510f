"""A Staubli TX40, all six joints, one exciting trajectory of 9 s at 5 kHz (data/README.md says where from).

Peers: the maker's model as it is; figaroh; mujoco.sysid with dry friction, damping and rotor of every joint free, and
the same with those of the coupled wrist's motor, too, of which a user has to know; gpsim, told nothing. Positions of
motors become positions of joints, and currents become torques, by the reduction ratios and the coupled wrist that
figaroh's example of this log has (figaroh-examples, examples/staubli_tx40). The log is thinned to 250 Hz for those that
simulate, torques averaged over a step; figaroh gets all samples, its own filter and its own decimation.

Left out is the end of the log, in which the arm rests: there friction takes any torque. Scored on the last fifth of
what moves: the torque that a model says the measured motion takes, against the measured one, as a share of its spread
(all models from one motion, filtered forward and backward at 100 Hz as figaroh's example does); and motion from the
same starts after 0.2 and 1 s.

figaroh is its BaseIdentification with the settings of its example: dry and viscous friction, rotors, offsets, weighted
least squares; of the wrist the three coupling columns that its example describes, which version 1.0 of the library
does not add by itself, are added here: without them its fit leaves 4.5 N m on joint 5, half of what is there. Its
physically consistent fit ends without an optimum on this log (cvxopt), so its motion is simulated from the base
parameters: mass matrix and bias from its regressor, dry friction solved for at every step of 1 ms.
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pandas as pd
import yaml
from scipy.signal import butter, filtfilt

from gpsim.mjcf.loading import spec_of
from peer_grounds.arms import (
    Floats,
    Free,
    Log,
    Roll,
    Starts,
    corrected,
    cut,
    diagnosed,
    fit,
    joint_numbers,
    left,
    model_of,
    motion,
    rolled,
    told,
)
from peer_grounds.contract import Answer, Parameter, Score
from peer_grounds.scored_robots import named

RATE, EVERY, CUT_OFF = 5000.0, 20, 100.0  # Hz, samples of a step of 250 Hz, Hz of the filter
JOINTS = tuple(f"joint_{k}" for k in range(1, 7))
REDUCTION = np.array([32.0, 32.0, 45.0, -48.0, 45.0, 32.0])
ZERO = np.array([0.0, -np.pi / 2, np.pi / 2, 0.0, 0.0, 0.0])  # rad, added to what the encoders say
HELD = 0.2  # the last share of the log
STRIDE = 0.04  # s between two starts
STILL = 0.05  # rad/s: the last 1.4 s of the log, in which no joint is faster, are left out
BORDER = 0.02  # s that differentiation spoils at either end


@dataclass(frozen=True)
class Raw:
    """The log at 5 kHz: positions [rad] and torques [N m] of joints (N, 6); first: where the last fifth begins."""

    q: Floats
    torque: Floats
    first: int


def recordings() -> Path:
    """Where the log lies."""
    return Path(os.environ["GPSIM_RECORDINGS"]) / "staubli_tx40"


def read() -> Raw:
    """Joints turn as motors do over their reduction; motor 6 turns with joint 5, too."""
    where = recordings()
    motors, currents = (
        pd.read_csv(where / f"{n}.csv").to_numpy(dtype=float) for n in ("pos_read_data", "curr_data")
    )
    turns, pulls = np.diag(REDUCTION), np.diag(REDUCTION)
    turns[5, 4] = pulls[4, 5] = REDUCTION[5]
    q = motors @ np.linalg.inv(turns).T + ZERO
    moves = np.abs(np.diff(q[::EVERY], axis=0)).max(axis=1) > STILL * EVERY / RATE
    count = EVERY * (int(np.flatnonzero(moves)[-1]) + 1)
    return Raw(q[:count], (currents @ pulls.T)[:count], EVERY * round(count * (1.0 - HELD) / EVERY))


def log_of(work: Path) -> tuple[Log, Raw]:
    """The log in its two parts at 250 Hz, with the maker's model as MJCF."""
    raw, whole = read(), work / "whole"
    whole.mkdir(parents=True, exist_ok=True)
    (whole / "robot.urdf").write_text(bare_urdf(), encoding="utf-8")
    spec = spec_of(str(whole / "robot.urdf"))
    spec.option.timestep, spec.option.integrator = 0.001, mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.compile()
    (whole / "robot.xml").write_text(spec.to_xml(), encoding="utf-8")
    names = [a.name for a in spec.actuators]
    count = len(raw.q) // EVERY
    q = raw.q[: count * EVERY : EVERY]
    torque = raw.torque[: count * EVERY].reshape(count, EVERY, 6).mean(axis=1)
    t = np.arange(count) * EVERY / RATE
    table = pd.DataFrame(
        np.column_stack([np.zeros(count), t, q, torque]), columns=["episode", "t", *JOINTS, *names]
    )
    table.astype({"episode": int}).to_csv(whole / "recording.csv", index=False, float_format="%.9g")
    said = {
        "system": "mjcf", "model": "robot.xml", "dt": EVERY / RATE, "clock": "session",
        "held_out": {"time_from": float(raw.first / RATE)},
        "state": dict.fromkeys(JOINTS, "rad"), "action": dict.fromkeys(names, "N m"),
    }  # fmt: skip
    (whole / "recording.yaml").write_text(yaml.safe_dump(said, sort_keys=False), encoding="utf-8")
    return cut("tx40", whole, whole / "robot.xml", work / "train"), raw


def bare_urdf() -> str:
    """The maker's model without shapes, whose meshes nobody has."""
    text = (recordings() / "tx40_mdh_modified.urdf").read_text(encoding="utf-8")
    return re.sub(r"<(visual|collision)>.*?</\1>", "", text, flags=re.DOTALL)


@dataclass(frozen=True)
class Motion:
    """Positions, velocities, accelerations and torques (N, 6) of the last fifth, filtered alike, at 250 Hz."""

    q: Floats
    v: Floats
    a: Floats
    torque: Floats


def judged(raw: Raw) -> Motion:
    """The filter runs over the whole log, and the ends of what is judged are left out."""
    b, a = butter(4, CUT_OFF / (RATE / 2))
    q, torque = filtfilt(b, a, raw.q, axis=0), filtfilt(b, a, raw.torque, axis=0)
    v = np.gradient(q, 1.0 / RATE, axis=0)
    rows = slice(raw.first, len(q) - round(BORDER * RATE), EVERY)
    return Motion(q[rows], v[rows], np.gradient(v, 1.0 / RATE, axis=0)[rows], torque[rows])


def scored(said: Floats, of: Motion) -> dict[str, Any]:
    """Root mean square of the torque's error by joint, and as a share of the torque's spread."""
    error = np.sqrt(np.mean((said - of.torque) ** 2, axis=0))
    share = error / of.torque.std(axis=0)
    return {"share": float(share.mean()), "by_joint": share.tolist(), "N m": error.tolist()}


def torque_of(model: mujoco.MjModel, of: Motion, push: Floats | None = None) -> Floats:
    """The command that a model says the motion takes; push: torques (6,) that act beside the motors."""
    dry, viscous = (
        model.dof_frictionloss.copy(),
        model.dof_damping[:, 0] if model.dof_damping.ndim > 1 else model.dof_damping.copy(),
    )
    gain, offset = (
        model.actuator_gainprm[:, 0] * model.actuator_gear[:, 0],
        model.actuator_biasprm[:, 0].copy(),
    )
    data, out = mujoco.MjData(model), np.empty_like(of.q)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    for k in range(len(of.q)):
        data.qpos[:], data.qvel[:], data.qacc[:] = of.q[k], 0.0, of.a[k]
        data.qvel[:] = of.v[k]
        mujoco.mj_inverse(model, data)
        out[k] = data.qfrc_inverse + data.qfrc_passive
    if model.ntendon:
        both = of.v[:, 4] + of.v[:, 5]
        rubs = (
            np.ravel(model.tendon_frictionloss)[0] * np.sign(both) + np.ravel(model.tendon_damping)[0] * both
        )
        out[:, 4:] += rubs[:, None]
    total = out + viscous * of.v + dry * np.sign(of.v) - (0.0 if push is None else push)
    return (total - offset) / gain


def account_model(log: Log, found: Path, work: Path) -> tuple[mujoco.MjModel, Floats, list[str]]:
    """What gpsim's account is as a model: exported attributes, constant forces, and families that are neither."""
    target = work / "exported" / "robot.xml"
    if not target.exists():
        target.parent.mkdir(parents=True, exist_ok=True)
        subprocess.run(
            [sys.executable, "-m", "gpsim", "export", "model", str(found), "--out", str(target)],
            check=True,
            capture_output=True,
        )
    push, others = np.zeros(6), []
    for effect in told(found)["effects"]:
        family, _, place = effect["name"].partition(" on ")
        if family == "constant_force":
            push[JOINTS.index(place)] += effect["parameters"]["force"]["value"]
        elif family not in (
            "coulomb_friction",
            "viscous_friction",
            "armature",
            "coupled_friction",
            "coupled_damping",
            "coupled_armature",
            "parameter_offset",
            "payload",
            "actuator_gain",
            "actuator_bias",
            "spring",
        ):
            others.append(effect["name"])
    return model_of(mujoco.MjSpec.from_file(str(target)), log.dt), push, others


# figaroh


SETTINGS = {
    "robot": {
        "name": "staubli_tx40",
        "properties": {
            "joints": {"active_joints": list(JOINTS)},
            "mechanics": {
                "reduction_ratios": REDUCTION.tolist(),
                "friction_coefficients": {"viscous": [0.0] * 6, "static": [0.0] * 6},
                "actuator_inertias": [0.0] * 6,
                "joint_offsets": [0.0] * 6,
            },
            "coupling": {"has_coupled_wrist": True, "Iam6": 0.0, "fvm6": 0.0, "fsm6": 0.0},
        },
    },
    "tasks": {
        "identification": {
            "enabled": True,
            "problem": {
                "include_external_forces": False,
                "use_joint_torques": True,
                "model_components": dict.fromkeys(
                    ("friction", "joint_offset", "actuator_inertia", "static_regressor", "inertia_regressor"),
                    True,
                ),
            },
            "signal_processing": {
                "sampling_frequency": RATE,
                "cutoff_frequency": CUT_OFF,
                "filter_type": "butterworth",
                "filter_order": 4,
            },
        }
    },
}
COUPLED = ("Iam6", "fvm6", "fsm6")


@dataclass(frozen=True)
class Base:
    """figaroh's base parameters as a standard vector with zeros elsewhere, which gives the same torques.

    names: of the parameters that are not zero, as figaroh says them, value and half of the 90 % interval as a share;
    theta: ten inertial ones a link, then dry and viscous friction, rotors and offsets (6,) each and the three
    of the coupled wrist.
    """

    robot: Any
    theta: dict[str, Floats]
    names: dict[str, tuple[float, float]]

    def rigid(self, q: Floats, v: Floats, a: Floats) -> Floats:
        """(6,): torque without friction."""
        import pinocchio

        regressor = pinocchio.computeJointTorqueRegressor(self.robot.model, self.robot.data, q, v, a)
        turned = self.theta["coupled"][0] * np.array([0.0, 0.0, 0.0, 0.0, a[5], a[4]])
        return regressor @ self.theta["links"] + self.theta["ia"] * a + self.theta["off"] + turned

    def torque(self, of: Motion) -> Floats:
        """The torque that a motion takes."""
        inertial = np.stack([self.rigid(q, v, a) for q, v, a in zip(of.q, of.v, of.a, strict=True)])
        _, slow, dry = self.theta["coupled"]
        wrist = np.zeros_like(of.v)
        both = dry * np.sign(of.v[:, 4] + of.v[:, 5])
        wrist[:, 4], wrist[:, 5] = slow * of.v[:, 5] + both, slow * of.v[:, 4] + both
        return inertial + self.theta["fv"] * of.v + self.theta["fs"] * np.sign(of.v) + wrist

    def rolled(self, dt: float, step: float = 0.001) -> Roll:
        """Motion from the base parameters: semi-implicit, viscous friction implicit, dry friction by Gauss-Seidel."""
        damp = np.diag(self.theta["fv"])
        damp[4, 5] = damp[5, 4] = self.theta["coupled"][1]
        ways = np.vstack([np.eye(6), [0.0, 0.0, 0.0, 0.0, 1.0, 1.0]])
        most = step * np.maximum(np.append(self.theta["fs"], self.theta["coupled"][2]), 0.0)
        unit, still = np.eye(6), np.zeros(6)

        def one(q: Floats, v: Floats, torque: Floats) -> tuple[Floats, Floats]:
            rest = self.rigid(q, still, still)
            mass = np.stack([self.rigid(q, still, e) - rest for e in unit], axis=1)
            inverse = np.linalg.inv(mass + step * damp)
            v = inverse @ (mass @ v + step * (torque - self.rigid(q, v, still)))
            along = inverse @ ways.T
            held, size = np.zeros(7), np.einsum("ij,ji->i", ways, along)
            for _ in range(30):
                for i in range(7):
                    wanted = np.clip(held[i] + ways[i] @ v / size[i], -most[i], most[i])
                    v = v - along[:, i] * (wanted - held[i])
                    held[i] = wanted
            return q + step * v, v

        def roll(windows: Starts) -> Floats:
            path = np.full((*windows.states.shape[:2], 6), np.nan)
            with np.errstate(all="ignore"):
                for k, (begun, commands) in enumerate(
                    zip(windows.states[:, 0], windows.actions, strict=True)
                ):
                    q, v = begun[:6], begun[6:]
                    path[k, 0] = q
                    for i, command in enumerate(commands):
                        for _ in range(round(dt / step)):
                            q, v = one(q, v, command)
                        if not np.isfinite(q).all() or np.abs(q).max() > 1e3:
                            break
                        path[k, i + 1] = q
            return path

        return roll


def identified(raw: Raw, work: Path) -> tuple[Base, dict[str, Any]]:
    """figaroh's weighted least squares on the first four fifths, and what it says of itself."""
    from figaroh.identification.base_identification import BaseIdentification
    from figaroh.tools.load_robot import load_robot

    border = round(BORDER * RATE)

    class Arm(BaseIdentification):  # type: ignore[misc]
        def load_trajectory_data(self, *_: Any) -> dict[str, Any]:
            t = (np.arange(raw.first) / RATE).reshape(-1, 1)
            none = {"velocities": None, "accelerations": None}
            return {
                "timestamps": t,
                "positions": raw.q[: raw.first],
                "torques": raw.torque[: raw.first],
                **none,
            }

        def process_torque_data(self, **kwargs: Any) -> Floats:
            """The ends, which the filter and two differentiations spoil, are left out of all signals."""
            self.processed_data["torques"] = self.raw_data["torques"]
            for key, values in self.processed_data.items():
                self.processed_data[key] = values[border:-border]
            return self.processed_data["torques"]

        def calculate_full_regressor(self) -> None:
            super().calculate_full_regressor()
            count, v, a = (
                self.num_samples,
                self.processed_data["velocities"],
                self.processed_data["accelerations"],
            )
            more = np.zeros((len(self.dynamic_regressor), 3))
            both = np.sign(v[:, 4] + v[:, 5])
            more[4 * count : 5 * count] = np.column_stack([a[:, 5], v[:, 5], both])
            more[5 * count : 6 * count] = np.column_stack([a[:, 4], v[:, 4], both])
            self.dynamic_regressor = np.hstack([self.dynamic_regressor, more])

        def initialize_standard_parameters(self) -> None:
            super().initialize_standard_parameters()
            self.standard_parameter.update(dict.fromkeys(COUPLED, 0.0))

        def _compute_validation_metrics(self) -> None:
            """It would build a regressor without the wrist's columns; what is held out is judged here."""

    (work / "figaroh.yaml").write_text(yaml.safe_dump(SETTINGS), encoding="utf-8")
    with contextlib.redirect_stdout(io.StringIO()):
        robot = load_robot(str(work / "whole" / "robot.urdf"))
        arm = Arm(robot, str(work / "figaroh.yaml"))
        ids = [robot.model.getJointId(name) for name in JOINTS]
        joints = [robot.model.joints[k] for k in ids]
        arm.identif_config.update(
            act_Jid=ids, act_J=joints, act_idxq=[j.idx_q for j in joints], act_idxv=[j.idx_v for j in joints]
        )
        arm.initialize()
        arm.solve(plotting=False, wls=True)
    names = list(arm.standard_parameter)
    kept = [k for k in range(len(names)) if k not in set(arm._idx_eliminated)]
    whole = np.zeros(len(names))
    whole[[kept[k] for k in arm._base_indices]] = arm.phi_base
    blocks = {"links": whole[:60], "coupled": whole[-3:]}
    blocks |= {name: whole[60 + 6 * k : 66 + 6 * k] for k, name in enumerate(("fv", "fs", "ia", "off"))}
    width = np.asarray(arm.result.get("wls_std_deviations", np.full(len(arm.phi_base), np.nan)), dtype=float)
    said = {
        n: (float(p), 1.645 * float(w) / 100.0)
        for n, p, w in zip(arm.params_base, arm.phi_base, width, strict=False)
    }
    return Base(robot, blocks, said), {
        "rmse of its fit, N m": float(arm.rms_error),
        "base parameters": len(said),
    }


def asked(peer: str, work: Path) -> Answer:
    """What a peer says, and how far it is off on the last fifth."""
    log, raw = log_of(work)
    of, spec = judged(raw), mujoco.MjSpec.from_file(str(log.model))
    base = model_of(spec, log.dt)
    before = motion(log, rolled(base, log.dt), STRIDE)
    if peer == "as-it-is":
        return answer(torque_of(base, of), of, before, before, {})
    if peer == "figaroh":
        found, about = identified(raw, work)
        numbers = tuple(
            Parameter(n, v, "", v * (1.0 - w), v * (1.0 + w)) for n, (v, w) in found.names.items()
        )
        moved = motion(log, found.rolled(log.dt), STRIDE)
        said = answer(found.torque(of), of, moved, before, about, numbers=numbers)
        return replace(
            said, notes="its fit takes some 2 s; the other seconds are the simulation that scores it"
        )
    if peer == "gpsim-effects":
        out = work / "found"
        diagnosed(log, out)
        model, push, others = account_model(log, out, work)
        said = told(out)
        with_gp = left(motion(log, corrected(out, gp=True), STRIDE), before)
        about = {
            "verdict": said["verdict"],
            "not in its torque": others,
            "left, with the Gaussian process": with_gp,
        }
        moved = motion(log, corrected(out), STRIDE)
        return answer(torque_of(model, of, push), of, moved, before, about, *named(said))
    free = joint_numbers(log, spec)
    if peer == "mujoco-sysid-wrist":
        log = replace(log, model=coupled(log.model))
        free |= wrist_numbers(free)
    fitted = fit(log, free)
    numbers = tuple(Parameter(name, *value) for name, value in fitted.values.items())
    about = {"window, s": fitted.window, "tried": fitted.tried, "seconds of the chosen fit": fitted.seconds}
    moved = motion(log, rolled(fitted.model, log.dt), STRIDE)
    return answer(torque_of(fitted.model, of), of, moved, before, about, numbers=numbers)


def answer(
    said: Floats,
    of: Motion,
    moved: dict[str, Any],
    before: dict[str, Any],
    about: dict[str, Any],
    names: tuple[str, ...] = (),
    numbers: tuple[Parameter, ...] = (),
) -> Answer:
    """The cell of a peer."""
    torque, shares = scored(said, of), left(moved, before)
    arm = float(np.mean(torque["by_joint"][:4]))
    scores = {"torque": Score(torque["share"]), "torque, joints 1-4": Score(arm)}
    scores |= {f"left, {horizon}": Score(share) for horizon, share in shares.items()}
    return Answer(scores, names, numbers, details={"torque": torque, "motion": moved, **about})


WRIST = "wrist"


def coupled(model: Path) -> Path:
    """The model with a tendon along which motor 6 turns: joint 5 plus joint 6."""
    spec = mujoco.MjSpec.from_file(str(model))
    tendon = spec.add_tendon(name=WRIST)
    for joint in JOINTS[4:]:
        tendon.wrap_joint(joint, 1.0)
    target = model.with_name("coupled.xml")
    spec.compile()
    target.write_text(spec.to_xml(), encoding="utf-8")
    return target


def wrist_numbers(joints: Mapping[str, Free]) -> dict[str, Free]:
    """Dry friction, damping and rotor of that tendon, as wide as those of joint 5."""

    def friction(s: mujoco.MjSpec, value: float) -> None:
        s.tendon(WRIST).frictionloss = value

    def damping(s: mujoco.MjSpec, value: float) -> None:
        s.tendon(WRIST).damping[0] = value

    def armature(s: mujoco.MjSpec, value: float) -> None:
        s.tendon(WRIST).armature = value

    found = {}
    for family, put in (
        ("coulomb_friction", friction),
        ("viscous_friction", damping),
        ("armature", armature),
    ):
        like = joints[f"{family} on joint_5"]
        found[f"{family} on {WRIST}"] = Free(f"{family} on {WRIST}", like.start, like.low, like.high, put)
    return found
