"""MODEL, and what MJCF cannot say of the robot: made by `gpsim export model`. It needs mujoco and numpy only.

    robot = Robot()
    robot.reset(qpos, qvel)
    robot.step(ctrl)                  # one control step, the command held
    qpos, qvel = robot.measured()     # what the sensors say; robot.data holds the truth

`step` takes as many steps of the model as make a control step. What becomes of a command on its way, friction that
depends on speed or place, forces from outside and sensors are here; everything else is in the model. PATCH lists it.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

PATCH: dict[str, Any] = {}
LAWS: dict[str, Any] = {}  # of what yields, from the end of this file, where anything does
REST = 80  # control steps without a command before an episode
STICKS = (0.9999, 0.9999, 0.001, 0.5, 2.0)  # solimp of dry friction that holds


class Robot:
    """The corrected model with its wrapper. model, data: MuJoCo's own. age: s on the recording's clock at a reset."""

    def __init__(self, path: str | Path | None = None, age: float | None = None) -> None:
        file = Path(path) if path is not None else Path(__file__).with_name(PATCH["model"])
        self.model = mujoco.MjModel.from_xml_path(str(file))
        self.data, self._scratch = mujoco.MjData(self.model), mujoco.MjData(self.model)
        self.age = float(PATCH["age"]) if age is None else age
        self._h = PATCH["control_step"] / PATCH["substeps"]
        limited = np.asarray(self.model.actuator_ctrllimited, dtype=bool)
        self._low = np.where(limited, self.model.actuator_ctrlrange[:, 0], -np.inf)
        self._high = np.where(limited, self.model.actuator_ctrlrange[:, 1], np.inf)
        if PATCH["commands"]:  # effects act on commands within the range, and may leave it
            self.model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL)
        self._laws = [(self.model.joint(law["joint"]).dofadr[0], law) for law in PATCH["laws"]]
        for dof, _ in self._laws:
            self.model.dof_solref[dof] = -1.0, -2.0 / self._h
            self.model.dof_solimp[dof] = STICKS
        joints = [self.model.joint(force["joint"]) for force in PATCH["forces"]]
        self._forces = [(j.dofadr[0], j.qposadr[0], f) for j, f in zip(joints, PATCH["forces"], strict=True)]
        fields = {change["field"] for change in PATCH["changes"]} | {"dof_frictionloss"}
        pushed = self._forces or PATCH["drags"] or PATCH["yields"]
        fields |= {"qfrc_applied"} if pushed else set()
        self._was = {name: np.array(self._field(name)) for name in fields}
        self.reset()

    def reset(self, qpos: Any = None, qvel: Any = None) -> None:
        """A new episode: nothing was commanded before, and the sensors have long seen this state."""
        mujoco.mj_resetData(self.model, self.data)
        if qpos is not None:
            self.data.qpos[:] = qpos
        if qvel is not None:
            self.data.qvel[:] = qvel
        mujoco.mj_forward(self.model, self.data)
        for i in np.flatnonzero(self.model.actuator_biasprm[:, 1] * self.model.actuator_actnum):
            held, limits = float(self.data.actuator_length[i]), self.model.actuator_actrange[i]
            held = float(np.clip(held, *limits)) if self.model.actuator_actlimited[i] else held
            self.data.act[self.model.actuator_actadr[i]] = (
                held  # a servo that filters or integrates holds its joint
            )
        actuators = {self.model.actuator(name).id: way for name, way in PATCH["commands"].items()}
        self._ways = {i: [Effect(e, self._h) for e in way] for i, way in actuators.items()}
        self._clock = 0.0
        looks = any(effect.region for way in self._ways.values() for effect in way)
        for _ in range(0 if looks else REST * PATCH["substeps"]):  # a bias in front of a lag has arrived
            self._arriving(np.zeros(self.model.nu))
        self._clock = self.age
        self._bends = [np.zeros((1, 2)) if "motor" in law else np.zeros(1) for law in PATCH["yields"]]
        late = [s["values"]["delay"] for s in PATCH["sensors"] if s["family"] == "sensor_delay"]
        depth = math.ceil(max(late, default=0.0) / self._h) + 2
        self._last = self._state()
        self._behind = [0.0] * len(PATCH["sensors"])  # of those with a lag
        self._seen = [self._state()] * depth  # the newest last

    def step(self, ctrl: Any) -> None:
        """One control step: the command (nu,) is held within the actuators' ranges."""
        sent = np.clip(np.asarray(ctrl, dtype=float), self._low, self._high)
        for _ in range(PATCH["substeps"]):
            arriving = self._arriving(sent)
            self._act(arriving)
            self.data.ctrl[:] = arriving
            pushed = self._push()
            mujoco.mj_step(self.model, self.data)
            self._move_on(pushed)
            self._clock += self._h
            self._seen = [*self._seen[1:], self._followed()]

    def measured(self) -> tuple[np.ndarray, np.ndarray]:
        """(nq,), (nv,): what the sensors say."""
        said = {"qpos": self.data.qpos.copy(), "qvel": self.data.qvel.copy()}
        for i, sensor in enumerate(PATCH["sensors"]):
            (kind, place, _), values = PATCH["channels"][sensor["channel"]], sensor["values"]
            if sensor["family"] == "sensor_scale":
                said[kind][place] *= values["scale"]
            elif sensor["family"] == "sensor_lag":
                said[kind][place] -= self._behind[i]
            elif sensor["family"] == "sensor_curve":
                said[kind][place] += _curve(float(said[kind][place]), values)
            elif sensor["family"] == "sensor_delay":
                history = [state[kind][place] for state in self._seen]
                said[kind][place] += _ago(history, values["delay"] / self._h) - history[-1]
            else:
                said[kind][place] += values["offset"]
        return said["qpos"], said["qvel"]

    def _followed(self) -> dict[str, np.ndarray]:
        """The state as a late sensor sees it: behind one that follows with a lag."""
        state = self._state()
        seen = {kind: values.copy() for kind, values in state.items()}
        for i, sensor in enumerate(PATCH["sensors"]):
            if sensor["family"] == "sensor_lag":
                (kind, place, _), ratio = PATCH["channels"][sensor["channel"]], self._h
                ratio /= max(sensor["values"]["time_constant"], 1e-9)
                moved = float(state[kind][place] - self._last[kind][place])
                self._behind[i] = self._behind[i] * math.exp(-ratio) + moved * -math.expm1(-ratio) / ratio
                seen[kind][place] -= self._behind[i]
        self._last = state
        return seen

    def _state(self) -> dict[str, np.ndarray]:
        return {"qpos": self.data.qpos.copy(), "qvel": self.data.qvel.copy()}

    def _arriving(self, sent: np.ndarray) -> np.ndarray:
        """(nu,): what reaches the actuators during a step of the model; their memories move on."""
        out, state = sent.copy(), self._state() | {"ctrl": sent}
        for i, way in self._ways.items():
            out[i] = _through(way, float(sent[i]), self._h, self._clock, state)
        return out

    def _given(self, dof: int, at: dict[str, np.ndarray]) -> float:
        """What a joint's motors give: MuJoCo says it a step later."""
        m, total, joint = self.model, 0.0, int(self.model.dof_jntid[dof])
        kinds = (mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT)
        for i in np.flatnonzero((m.actuator_trnid[:, 0] == joint) & np.isin(m.actuator_trntype, kinds)):
            gear, bias = m.actuator_gear[i, 0], m.actuator_biasprm[i]
            force = m.actuator_gainprm[i, 0] * at["ctrl"][i]
            if m.actuator_biastype[i] == mujoco.mjtBias.mjBIAS_AFFINE:
                q, v = at["qpos"][m.jnt_qposadr[joint]], at["qvel"][dof]
                force += bias[0] + gear * (bias[1] * q + bias[2] * v)
            total += gear * (
                np.clip(force, *m.actuator_forcerange[i]) if m.actuator_forcelimited[i] else force
            )
        return float(np.clip(total, *m.jnt_actfrcrange[joint]) if m.jnt_actfrclimited[joint] else total)

    def _push(self) -> list[tuple[int, float, np.ndarray, np.ndarray]]:
        """What reaches joints through what yields; of each its dof and speed, what a unit does there, the command."""
        m, d, out = self.model, self.data, []
        for law in PATCH["yields"]:
            dof = int(m.joint(law["joint"]).dofadr[0])
            u = self._given(dof, self._state() | {"ctrl": d.ctrl}) / law["strength"]
            out.append((dof, float(d.qvel[dof]), np.zeros((1, m.nv)), np.array([u])))
        for law in PATCH["yields"]:
            if "motor" in law:
                d.ctrl[m.actuator(law["motor"]).id] = 0.0
        if out:
            mujoco.mj_forward(m, d)
        own, h = d.qacc.copy(), np.array([self._h])
        for law, bend, (dof, speed, moves, u) in zip(PATCH["yields"], self._bends, out, strict=True):
            mujoco.mj_solveM(m, d, moves, np.eye(m.nv)[dof : dof + 1])
            now, reacts = own[dof : dof + 1], law["strength"] * moves[0, dof : dof + 1]
            if "motor" in law:
                gets = LAWS["transmitted"](bend, u, now, reacts, h, law["values"])[0]
            else:
                gets = LAWS["mean_force"](bend, np.array([speed]), now, reacts, h, law["values"])[0]
            d.qfrc_applied[dof] += law["strength"] * gets
            own += law["strength"] * gets * moves[0]
        return out

    def _move_on(self, pushed: list[tuple[int, float, np.ndarray, np.ndarray]]) -> None:
        """Twist and bend what yields by what a step made of it."""
        h = np.array([self._h])
        for law, bend, (dof, speed, moves, u) in zip(PATCH["yields"], self._bends, pushed, strict=True):
            after = self.data.qvel[dof]
            if "motor" in law:
                moved, reacts = np.array([after - speed]) / h, law["strength"] * moves[0, dof : dof + 1]
                bend[:] = LAWS["turned"](bend, u, moved, reacts, h, law["values"])
            else:
                mean = np.array([0.5 * (speed + after)])
                bend[:], _ = LAWS["bent"](bend, mean * h, mean, law["values"])

    def _act(self, ctrl: np.ndarray) -> None:
        """Friction and fields that change with speed or place."""
        begin = self._state() | {"ctrl": ctrl}
        end = {kind: values.copy() for kind, values in begin.items()}
        for q, v in PATCH["moving"]:
            end["qpos"][q] += self._h * begin["qvel"][v]
        now = {name: values.copy() for name, values in self._was.items()}
        for dof, law in self._laws:
            speed, share = float(begin["qvel"][dof]), _share(law["region"], begin, end)
            load = self._given(dof, begin) if "share" in law["values"] else 0.0
            now["dof_frictionloss"][dof] += share * _grip(speed, load, law["values"])
        for dof, place, force in self._forces:
            x = begin["qpos"][place] if force["of"] == "position" else begin["qvel"][dof]
            now["qfrc_applied"][dof] += _curve(float(x), force["values"])
        for drag in PATCH["drags"]:
            first, turn = drag["dof"], np.empty(9)
            mujoco.mju_quat2Mat(turn, begin["qpos"][drag["orientation"] : drag["orientation"] + 4])
            along = turn.reshape(3, 3)[:, drag["axis"]]
            speed = along @ begin["qvel"][first : first + 3]
            size = drag["damping"] + drag["drag"] * abs(speed)
            now["qfrc_applied"][first : first + 3] -= size * speed * along
        for change in PATCH["changes"]:
            now[change["field"]][tuple(change["index"])] += change["add"] * _share(
                change["region"], begin, end
            )
        for name in ("dof_frictionloss", "dof_damping"):
            if name in now:
                now[name] = np.maximum(now[name], 0.0)
        derived = [n for n in now if n.startswith(("body_", "dof_armature"))]
        moved = any((now[n] != self._field(n)).any() for n in derived)
        for name, values in now.items():
            self._field(name)[:] = values
        if moved:
            self.model.body_sameframe[:] = 0  # no centre of mass need lie where it did
            mujoco.mj_setConst(self.model, self._scratch)

    def _field(self, name: str) -> Any:
        if name == "qfrc_applied":
            return self.data.qfrc_applied
        return getattr(self.model.opt, name[4:]) if name.startswith("opt.") else getattr(self.model, name)


class Effect:
    """What happens to a command on its way, with what it remembers."""

    def __init__(self, told: dict[str, Any], h: float) -> None:
        self.family, self.values, self.region = told["family"], told["values"], told["region"]
        self.level = 0.0
        longest = 0.4 if "drift" in self.values else self.values.get("delay", 0.0)  # a drift grows to that
        self.past = [0.0] * (math.ceil(longest / h) + 3)  # the newest first

    def __call__(self, u: float, h: float, t: float) -> float:
        """What becomes of a command that is held for h [s] from t [s] on: its mean."""
        v: dict[str, float] = self.values
        was = self.level
        if self.family == "actuator_dead_zone":
            return 0.0 if abs(u) < v["width"] else u
        if self.family == "actuator_dead_band":
            return math.copysign(max(abs(u) - v["width"], 0.0), u)
        if self.family == "actuator_saturation":
            return min(max(u, -v["limit"]), v["limit"])
        if self.family == "actuator_gain":
            return v["gain"] * u
        if self.family == "actuator_asymmetry":
            return (v["gain_positive"] if u > 0 else v["gain_negative"]) * u
        if self.family == "actuator_curve":
            return u + _curve(u, v)
        if self.family == "battery_sag":
            return u * max(1.0 - v["loss_per_second"] * t, 0.0)
        if self.family == "actuator_bias":
            return u + v["bias"]
        if self.family == "actuator_backlash":
            self.level = min(max(was, u - v["half_width"]), u + v["half_width"])
            return self.level
        if self.family == "actuator_rate_limit":
            reach = v["rate"] * h
            self.level = min(max(u, was - reach), was + reach)
            moved = self.level - was
            return self.level - moved * abs(moved) / max(2.0 * reach, 1e-300)
        if self.family == "actuator_lag":
            ratio = max(h, 1e-12) / max(v["time_constant"], 1e-9)
            self.level = u + (was - u) * math.exp(-ratio)
            return u + (was - u) * -math.expm1(-ratio) / ratio
        raise ValueError(f"unknown effect {self.family}")

    def delayed(self, u: float, h: float, t: float) -> tuple[float, float, float]:
        """The two commands that act for h [s] from t [s] on, the earlier one first, and the share that it lasts."""
        self.past = [u, *self.past[:-1]]
        drift = self.values.get("drift", 0.0) / 1e6 * max(t + h / 2, 0.0)
        back = min((self.values.get("delay", 0.0) + drift) / h, len(self.past) - 2.0)
        whole = int(back)
        return self.past[whole + 1], self.past[whole], back - whole


def _through(way: list[Effect], u: float, h: float, t: float, state: dict[str, np.ndarray]) -> float:
    """A command through an actuator's effects: its mean over h [s]. A late one may change on the way."""
    pieces = [(u, h, t)]
    for place, effect in enumerate(way):
        opened = _share(effect.region, state, state) == 1.0
        if effect.family not in ("actuator_delay", "clock_drift"):
            done = [(effect(c, length, begin), length, begin) for c, length, begin in pieces]
        else:
            earlier, recent, share = effect.delayed(u, h, t)
            if place == len(way) - 1:
                done = [(recent + share * (earlier - recent), h, t)]
            else:
                done = [(earlier, share * h, t), (recent, (1.0 - share) * h, t + share * h)]
                pieces = [(u, length, begin) for _, length, begin in done]
        pieces = done if opened else pieces
    if len(pieces) == 1:
        return pieces[0][0]
    return sum(c * length for c, length, _ in pieces) / h


def _share(region: dict[str, Any], begin: dict[str, np.ndarray], end: dict[str, np.ndarray]) -> float:
    """How much of the way from one state to the other lies in a region: channel -> from, to."""
    share = 1.0
    for name, (low, high) in region.items():
        kind, place, wraps = PATCH["channels"][name]
        a, b = float(begin[kind][place]), float(end[kind][place])
        if wraps:
            turns = 2.0 * math.pi * np.round((a - 0.5 * (low + high)) / (2.0 * math.pi))
            a, b = a - turns, b - turns
        inside = min(max(a, b), high) - max(min(a, b), low)
        share *= min(max(inside / abs(b - a), 0.0), 1.0) if a != b else float(low <= a <= high)
    return share


def _grip(speed: float, load: float, v: dict[str, float]) -> float:
    """Dry friction: measured, a share of a load, or of its own size, larger the slower where there is a static one."""
    if "share" in v:
        return v["share"] * abs(load)
    if "y0" in v:
        return _curve(speed, v)
    slides = v.get("force", 0.0)
    more = v["rise"] if "rise" in v else max(v.get("static_force", 0.0) - slides, 0.0)
    return slides + (more * math.exp(-((speed / v["stribeck_velocity"]) ** 2)) if more else 0.0)


def _curve(x: float, v: dict[str, float]) -> float:
    """A measured curve: straight between its knots, held beyond them, where nobody measured it."""
    knots, heights = ([v[f"{k}{i}"] for i in range(len(v)) if f"{k}{i}" in v] for k in "xy")
    x = (x + math.pi) % (2.0 * math.pi) - math.pi if "wraps" in v else x
    return v["scale"] * float(np.interp(x, knots, heights))


def _ago(history: list[float], back: float) -> float:
    """What was so many steps ago, between steps by Lagrange's cubic; history: the newest last."""
    depth = len(history)
    back = min(back, depth - 2.0)
    first = min(max(int(back) - 1, 0), max(depth - 4, 0))
    nodes, out = range(min(4, depth)), 0.0
    for i in nodes:
        weight = 1.0
        for j in nodes:
            if j != i:
                weight *= (back - first - j) / (i - j)
        out += weight * history[-1 - first - i]
    return out
