"""What truly moves: a vehicle by its twist, a mechanical system by its forces, or the same by MuJoCo.

MuJoCo is an independent second source of truth: equations, friction (`frictionloss`, a constraint) and integration are
its own; joint friction, damping and springs are MuJoCo's, too.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from gpsim.channels import FloatArray
from gpsim.errors import UsageError
from gpsim.trials import catalogue, out_of_catalogue
from gpsim.trials.worlds import SYSTEMS, Parameters, TrueEffect, Values, dynamics, load_on_track

TWISTS, HIDDEN_TWISTS = out_of_catalogue.at_site("twist after"), out_of_catalogue.at_site("hidden twist")
FORCES, COUPLED = out_of_catalogue.at_site("force"), out_of_catalogue.at_site("coupled force")
INERTIAS, HIDDEN = out_of_catalogue.at_site("inertia"), out_of_catalogue.at_site("hidden force")
STILL = 1e-12  # below this a velocity is rounding


class Now(NamedTuple):
    """What acts (B, A), and what both clocks say (B,)."""

    u: FloatArray
    t: FloatArray
    wall: FloatArray

    def later(self, late: FloatArray | float) -> Now:
        """So many s later."""
        return Now(self.u, self.t + late, self.wall + late)


class Moving:
    """What moves: states s (B, S) and hidden states z (B, H) of a batch."""

    def begin(self, s: FloatArray) -> FloatArray:
        """(B, H) hidden states at the start."""
        return np.empty((len(s), 0))

    def step(self, s: FloatArray, z: FloatArray, now: Now, h: float) -> tuple[FloatArray, FloatArray]:
        """State and hidden state after h s."""
        raise NotImplementedError

    def free(self) -> FloatArray | float:
        """(B,) 1 where it has met nothing in the last step."""
        return 1.0


def _runge_kutta(
    slope: Callable[[FloatArray, FloatArray | float], FloatArray], y: FloatArray, h: FloatArray | float
) -> FloatArray:
    """Y after h s, or (B,) s each, by the classical scheme; slope(y, how much later)."""
    each = np.reshape(h, (-1, 1))
    k1 = slope(y, 0.0)
    k2 = slope(y + each / 2 * k1, h / 2)
    k3 = slope(y + each / 2 * k2, h / 2)
    k4 = slope(y + each * k3, h)
    return np.asarray(y + each / 6 * (k1 + 2 * (k2 + k3) + k4))


class Vehicle(Moving):
    """Steps a batch of unicycles: state (x, y, yaw), action (v, w)."""

    def __init__(self, effects: Sequence[TrueEffect]) -> None:
        order = list(catalogue.TWIST)
        self._twist = sorted((e for e in effects if e.family in order), key=lambda e: order.index(e.family))
        self._outside = [e for e in effects if e.family in TWISTS]
        self._hidden = [e for e in effects if e.family in HIDDEN_TWISTS]

    def begin(self, s: FloatArray) -> FloatArray:
        """Those of what acts on its twist."""
        return np.zeros((len(s), len(self._hidden)))

    def step(self, s: FloatArray, z: FloatArray, now: Now, h: float) -> tuple[FloatArray, FloatArray]:
        """By a Runge-Kutta step."""
        y = np.hstack([s, z]) if z.shape[1] else s
        y = _runge_kutta(lambda at, late: self._slope(at, now.u, now.t + late), y, h)
        return y[:, : s.shape[1]], y[:, s.shape[1] :]

    def _slope(self, y: FloatArray, u: FloatArray, t: FloatArray) -> FloatArray:
        """(B, S + H) of state and hidden state."""
        s = y[:, :3]
        v, w = u[:, 0], u[:, 1]
        lateral = np.zeros_like(v)
        for effect in self._twist:
            new = catalogue.TWIST[effect.family](effect.values, v, lateral, w)
            if effect.gated:
                gate = effect.acts(s, t, SYSTEMS["unicycle"].names) > 0
                new = tuple(np.where(gate, a, b) for a, b in zip(new, (v, lateral, w), strict=True))
            v, lateral, w = new
        for effect in self._outside:
            v, w = TWISTS[effect.family](effect.values, v, w, s)
        drift = []
        for effect, z in zip(self._hidden, y[:, 3:].T, strict=True):
            v, w, moved = HIDDEN_TWISTS[effect.family](effect.values, v, w, z)
            drift.append(moved[:, None])
        sin, cos = np.sin(s[:, 2]), np.cos(s[:, 2])
        rates = np.stack([v * cos - lateral * sin, v * sin + lateral * cos, w], axis=1)
        return np.hstack([rates, *drift])


class Body(Moving):
    """Steps a batch of a mechanical system with its effects. Hidden states live in `hidden`, (B, 2) an effect.

    Those of kinds outside the catalogue come first, then those of its bristles, then those of its couplings.
    """

    def __init__(self, system: str, parameters: Values, effects: Sequence[TrueEffect]) -> None:
        self._system, self._parameters = SYSTEMS[system], dict(parameters)
        index = {name: i for i, name in enumerate(self._system.coordinates)}

        def of(laws: Mapping[str, Any]) -> list[tuple[TrueEffect, int]]:
            return [(e, index[e.on]) for e in effects if e.family in laws]

        self._offsets = [e for e in effects if e.family == "parameter_offset"]
        self._smooth, self._bristles, self._dry = map(
            of, (catalogue.SMOOTH, catalogue.BRISTLES, catalogue.GRIP)
        )
        self._outside, self._inertias, self._hidden = of(FORCES), of(INERTIAS), of(HIDDEN)
        self._coupled = [e for e in effects if e.family in COUPLED]
        self._couplings = [e for e in effects if e.family in catalogue.COUPLINGS]
        self._dry_columns = sorted({c for _, c in self._dry})
        self._loaded = any("coefficient" in e.values for e, _ in self._dry)
        # The state column of the coordinate that the command drives.
        self._driven = self._system.names.index(catalogue.DRIVEN[system])

    def begin(self, s: FloatArray) -> FloatArray:
        """Two of every force that has some."""
        parts = []
        for effect, c in self._hidden:
            kind, (q, v) = out_of_catalogue.EVERY_KIND[effect.family], s[:, 2 * c : 2 * c + 2].T
            begun = kind.start(q, v) if kind.start else (np.full_like(q, kind.first), np.zeros_like(q))
            parts.append(np.stack(begun, axis=1))
        parts += [np.zeros((len(s), 2)) for _ in self._bristles]
        parts += [np.stack([np.zeros(len(s)), s[:, self._driven + 1]], axis=1) for _ in self._couplings]
        return np.hstack([np.empty((len(s), 0)), *parts])

    def step(self, s: FloatArray, z: FloatArray, now: Now, h: float) -> tuple[FloatArray, FloatArray]:
        """By a Runge-Kutta step, two where friction stops a body within it."""
        direction = np.sign(s[:, 1::2])
        new, hidden = self._moved(s, z, now, np.full(len(s), h), direction)
        for c in self._dry_columns:
            column = 2 * c + 1
            turned = (direction[:, c] != 0) & (new[:, column] * direction[:, c] < 0)
            rows = np.flatnonzero(turned)
            if rows.size:
                share = s[rows, column] / (s[rows, column] - new[rows, column])
                still = np.sign(s[rows, 1::2])
                part, late = Now(*(x[rows] for x in now)), share * h
                a, b = self._moved(s[rows], z[rows], part, late, still)
                a[:, column], still[:, c] = 0.0, 0.0
                rest = (1.0 - share) * h
                new[rows], hidden[rows] = self._moved(a, b, part.later(late), rest, still)
            new[np.abs(new[:, column]) < STILL, column] = 0.0
        return new, hidden

    def _moved(
        self, s: FloatArray, z: FloatArray, now: Now, h: FloatArray, direction: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        width = s.shape[1]

        def slope(at: FloatArray, late: FloatArray | float) -> FloatArray:
            return self._slope(at[:, :width], at[:, width:], now.later(late), direction)

        y = _runge_kutta(slope, np.hstack([s, z]) if z.shape[1] else s, h)
        return y[:, :width].copy(), y[:, width:].copy()

    def _slope(self, s: FloatArray, z: FloatArray, now: Now, direction: FloatArray) -> FloatArray:
        names, p = self._system.names, self._actual(s, now.t)
        inverse, force = dynamics(self._system.name, p, s, now.u)
        for effect, c in self._inertias:
            extra, slope = INERTIAS[effect.family](effect.values, s[:, 2 * c])
            inverse = with_inertia(inverse, c, extra)
            force[:, c] -= 0.5 * slope * s[:, 2 * c + 1] ** 2  # Lagrange: d/dt (I v) - I' v^2 / 2
        for effect, c in self._smooth:
            push = catalogue.SMOOTH[effect.family](effect.values, s[:, 2 * c], s[:, 2 * c + 1])
            force[:, c] += push * effect.acts(s, now.t, names) if effect.gated else push
        for effect, c in self._outside:
            force[:, c] += FORCES[effect.family](effect.values, s[:, 2 * c], s[:, 2 * c + 1], now.wall)
        for effect in self._coupled:
            force += COUPLED[effect.family](effect.values, s)
        drift = []
        for i, (effect, c) in enumerate(self._hidden):
            place, rate = z[:, 2 * i], z[:, 2 * i + 1]
            if more := out_of_catalogue.EVERY_KIND[effect.family].inertia:
                inverse = with_inertia(inverse, c, more(effect.values, place))
            push, *rates = HIDDEN[effect.family](effect.values, s[:, 2 * c], s[:, 2 * c + 1], place, rate)
            force[:, c] += push
            drift.append(np.stack((*rates, np.zeros(len(s)))[:2], axis=1))
        for effect, c in self._bristles:
            rubs, bend = catalogue.BRISTLES[effect.family], z[:, 2 * len(drift)]
            push, rate = rubs(effect.values, s[:, 2 * c + 1], bend, 1.0 / inverse[:, c, c])
            force[:, c] += push
            drift.append(np.stack([rate, np.zeros_like(rate)], axis=1))
        for effect in self._couplings:
            c, part = self._driven, z[:, 2 * len(drift) : 2 * len(drift) + 2]
            pull, rate = catalogue.COUPLINGS[effect.family](effect.values, s[:, c + 1], part, now.u[:, 0])
            force[:, c // 2] += pull - now.u[:, 0]
            drift.append(rate)
        acceleration = (inverse * force[:, None, :]).sum(axis=2)
        if self._dry:
            acceleration = self._with_friction(acceleration, inverse, p, s, now, direction)
        out = np.empty((len(s), s.shape[1] + z.shape[1]))
        out[:, 0 : s.shape[1] : 2], out[:, 1 : s.shape[1] : 2] = s[:, 1::2], acceleration
        if drift:
            out[:, s.shape[1] :] = np.hstack(drift)
        return out

    def _actual(self, s: FloatArray, t: FloatArray) -> dict[str, float | FloatArray]:
        """The parameters as they really are, at the moments t."""
        p: dict[str, float | FloatArray] = dict(self._parameters)
        for effect in self._offsets:
            gate = effect.acts(s, t, self._system.names) if effect.gated else 1.0
            p[effect.on] = p[effect.on] * (1.0 + (effect.values["ratio"] - 1.0) * gate)
        return p

    def _with_friction(
        self, free: FloatArray, inverse: FloatArray, p: Parameters, s: FloatArray, now: Now, direction: FloatArray
    ) -> FloatArray:  # fmt: skip
        """Accelerations (B, C) with dry friction; direction (B, C): of motion, 0 holds still what can be held."""
        friction = np.zeros_like(free)
        rounds = 1 if len(self._dry_columns) == 1 and not self._loaded else 4
        total = free
        # Friction, load and the other coordinate's friction depend a little on each other.
        for _ in range(rounds):
            for c in self._dry_columns:
                load = load_on_track(p, s, total) if self._loaded else np.zeros(len(s))
                most = self._grip(c, s, now, load)
                mobility = inverse[:, c, c]
                others = total[:, c] - mobility * friction[:, c]
                hold = np.maximum(np.minimum(-others / mobility, most), -most)
                new = np.where(direction[:, c] == 0, hold, -direction[:, c] * most)
                total = total + inverse[:, :, c] * (new - friction[:, c])[:, None]
                friction[:, c] = new
        return total

    def _grip(self, coordinate: int, s: FloatArray, now: Now, load: FloatArray) -> FloatArray:
        """(B,) the most that a coordinate's friction resists with."""
        most = np.zeros(len(s))
        for effect in (e for e, c in self._dry if c == coordinate):
            presses = np.abs(now.u[:, 0]) if catalogue.FAMILIES[effect.family].by_command else load
            force = catalogue.GRIP[effect.family](effect.values, s[:, 2 * coordinate + 1], presses)
            most += force * effect.acts(s, now.t, self._system.names) if effect.gated else force
        return most


def with_inertia(inverse: FloatArray, coordinate: int, extra: FloatArray) -> FloatArray:
    """(B, C, C) inverse mass matrix with `extra` (B,) more on one diagonal element (Sherman and Morrison, 1950)."""
    column, row = inverse[:, :, coordinate], inverse[:, coordinate, :]
    share = extra / (1.0 + extra * inverse[:, coordinate, coordinate])
    return np.asarray(inverse - share[:, None, None] * column[:, :, None] * row[:, None, :])


NATIVE = ("coulomb_friction", "viscous_friction", "spring", "constant_force", "parameter_offset")
"""Families of the body that MuJoCo has itself; those of actuators and sensors act outside of it."""
FRICTION = 'solreffriction="-1 -{stop}" solimpfriction="0.9999 0.9999 0.001 0.5 2"'
"""A body that friction can hold stops within a step: the constraint takes its speed away at the rate 2 / h."""
MODEL = """
<mujoco>
  <compiler angle="radian" inertiafromgeom="false" autolimits="true"/>
  <option timestep="{h}" integrator="RK4" gravity="0 0 -{gravity}" iterations="200" tolerance="1e-14">
    <flag contact="disable"/>
  </option>
  <worldbody>{bodies}</worldbody>
  <actuator><motor joint="{first}" gear="1"/></actuator>
</mujoco>
"""
BODIES = {
    "cartpole": """
<body><inertial pos="0 0 0" mass="{cart_mass}" diaginertia="1 1 1"/>
  <joint name="x" type="slide" axis="1 0 0" {x}/>
  <body><inertial pos="0 0 {pole_half_length}" mass="{pole_mass}" diaginertia="{rod} {rod} {thin}"/>
    <joint name="theta" type="hinge" axis="0 1 0" {theta}/></body></body>
""",
    "slider": """
<body><inertial pos="0 0 0" mass="{mass}" diaginertia="1 1 1"/><joint name="q" type="slide" axis="1 0 0" {q}/></body>
""",
    "pendulum": """
<body><inertial pos="0 0 -{length}" mass="{mass}" diaginertia="1e-10 1e-10 1e-10"/>
  <joint name="theta" type="hinge" axis="0 1 0" {theta}/></body>
""",
}


def native(effect: TrueEffect) -> bool:
    """Whether MuJoCo can play this effect of a body by itself."""
    return effect.family in NATIVE and not effect.gated and "coefficient" not in effect.values


class MujocoBody(Moving):
    """Steps a batch of a mechanical system, one MuJoCo world an episode."""

    def __init__(self, system: str, parameters: Values, effects: Sequence[TrueEffect], h: float) -> None:
        self._mj = mujoco()
        p, joints = dict(parameters), dict.fromkeys(SYSTEMS[system].coordinates, "")
        self._push = np.zeros(len(joints))
        for effect in effects:
            k = effect.values
            if effect.family == "parameter_offset":
                p[effect.on] *= k["ratio"]
            elif effect.family == "coulomb_friction":
                joints[effect.on] += f' frictionloss="{k["force"]!r}" {FRICTION.format(stop=2.0 / h)}'
            elif effect.family == "viscous_friction":
                joints[effect.on] += f' damping="{k["damping"]!r}"'
            elif effect.family == "spring":
                joints[effect.on] += f' stiffness="{k["stiffness"]!r}" springref="{k["rest_position"]!r}"'
            elif effect.family == "constant_force":
                self._push[list(joints).index(effect.on)] += k["force"]
        if system == "cartpole":
            rod = p["pole_mass"] * (2 * p["pole_half_length"]) ** 2 / 12
            p |= {"rod": rod, "thin": rod / 1e3}
        bodies = BODIES[system].format(**p, **joints)
        text = MODEL.format(h=h, gravity=p.get("gravity", 9.81), bodies=bodies, first=next(iter(joints)))
        self._model = self._mj.MjModel.from_xml_string(text)
        self._data: list[Any] = []

    def begin(self, s: FloatArray) -> FloatArray:
        """Worlds at the given states; nothing is hidden."""
        self._data = [self._mj.MjData(self._model) for _ in s]
        for data, row in zip(self._data, s, strict=True):
            data.qpos[:], data.qvel[:] = row[0::2], row[1::2]
            data.qfrc_applied[:] = self._push
        return np.empty((len(s), 0))

    def step(self, s: FloatArray, z: FloatArray, now: Now, h: float) -> tuple[FloatArray, FloatArray]:
        """The worlds remember their states, `s` is what this returned last."""
        out = np.empty_like(s)
        for i, data in enumerate(self._data):
            data.ctrl[0] = now.u[i, 0]
            self._mj.mj_step(self._model, data)
            out[i, 0::2], out[i, 1::2] = data.qpos, data.qvel
        return out, z


def mujoco() -> Any:
    """The package; raises UsageError where it is not installed."""
    try:
        import mujoco as found
    except ImportError as error:
        missing = "a concealed world needs MuJoCo; install it with: pip install 'gpsim[prove]'"
        raise UsageError(missing) from error
    return found
