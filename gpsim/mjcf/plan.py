"""How terms act in a model: effects that MuJoCo has a field for, each family's writer, and when each is written.

What a family means is its law in gpsim.effects; here it is said in MuJoCo's terms, so that friction holds, damping is
implicit and masses move with everything that follows from them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gpsim.channels import FloatArray
from gpsim.effects import BristleEffect, ElasticDrive, ForceEffect, ParameterEffect, RateEffect, Term, Values
from gpsim.errors import UsageError
from gpsim.mjcf.body import TENDON, Body
from gpsim.mjcf.naming import MOTIONS

PASSED_ON = ("actuator", "sensor")
"""Sites whose effects are the chain's."""
FORCE = "qfrc_applied"
"""No field of the model, but an input that stays: the generalised force on every degree of freedom."""
FRICTION = ("dof_frictionloss", "dof_solref", "dof_solimp")
TIED_FRICTION = ("tendon_frictionloss", "tendon_solref_fri", "tendon_solimp_fri")
STIFF_SOLIMP = (0.9999, 0.9999, 0.001, 0.5, 2.0)
"""Dry friction that holds: by MuJoCo's defaults a body under a load of 80 % creeps 4 mm/s."""


class Fields(dict[str, FloatArray]):
    """Model fields (B, ...) of a batch, made from the model's when they are first asked for."""

    def __init__(self, body: Body, step: FloatArray, begun: Mapping[str, FloatArray] | None = None) -> None:
        super().__init__(begun or {})
        self.body, self.step, self.count = body, step, len(step)

    def __missing__(self, name: str) -> FloatArray:
        model = self.body.tied if name.startswith(TENDON) else self.body.model
        owner, called = (model.opt, name[4:]) if name.startswith("opt.") else (model, name)
        believed = np.zeros(model.nv) if name == FORCE else np.asarray(getattr(owner, called), float)
        self[name] = np.tile(believed, (self.count, *(1,) * believed.ndim))
        return self[name]


@dataclass(frozen=True)
class Native:
    """How a family is written: the fields that it needs, and the writer.

    It is given fields, body, place, values, and which share of the substep it acts.
    """

    fields: tuple[str, ...]
    write: Callable[[Fields, Body, str, Values, FloatArray], None]


def native_of(term: Term, body: Body) -> Native | None:
    """How MuJoCo says a term; None where it has no field for it, as along the axes of a body that floats."""
    along = body.names.afloat(term.on) is not None and term.on.endswith(tuple(f".{m}" for m in MOTIONS[:3]))
    return NATIVE.get(term.family) if term.variant == "" and not along else None


def add_friction(fields: Fields, dof: int, force: FloatArray) -> None:
    """More dry friction (B,) on a degree of freedom, which is to stick rather than creep."""
    _more_friction(fields, FRICTION, dof, force)


def _more_friction(fields: Fields, names: tuple[str, ...], at: int, force: FloatArray) -> None:
    loss, solref, solimp = (fields[name] for name in names)
    loss[:, at] = np.maximum(loss[:, at] + force, 0.0)
    solref[:, at, 0] = -1.0
    solref[:, at, 1] = -2.0 / fields.step
    solimp[:, at] = STIFF_SOLIMP


def _coulomb(fields: Fields, body: Body, on: str, values: Values, share: FloatArray) -> None:
    add_friction(fields, body.names.dof(on), share * values["force"])


def _viscous(fields: Fields, body: Body, on: str, values: Values, share: FloatArray) -> None:
    damping, dof = fields["dof_damping"], body.names.dof(on)
    damping[:, dof] = np.maximum(damping[:, dof] + share * values["damping"], 0.0)


def _adding(name: str, value: str, *at: int) -> Callable[[Fields, Body, str, Values, FloatArray], None]:
    """The writer that adds a value to a field, at a degree of freedom and what of it."""

    def write(fields: Fields, body: Body, on: str, values: Values, share: FloatArray) -> None:
        where: tuple[slice | int, ...] = (slice(None), body.names.dof(on), *at)
        fields[name][where] += share * values[value]

    return write


def _coupled_friction(fields: Fields, body: Body, on: str, values: Values, share: FloatArray) -> None:
    _more_friction(fields, TIED_FRICTION, body.tendon(on), share * values["force"])


def _of_tendon(name: str, value: str) -> Callable[[Fields, Body, str, Values, FloatArray], None]:
    """The writer that adds a value to a field of the tendon between two joints."""

    def write(fields: Fields, body: Body, on: str, values: Values, share: FloatArray) -> None:
        fields[name][:, body.tendon(on)] += share * values[value]

    return write


def _spring(fields: Fields, body: Body, on: str, values: Values, share: FloatArray) -> None:
    """Beside the joint's own spring: two are one of their stiffness together, at rest between them."""
    joint = body.joint(on)
    place = int(body.model.jnt_qposadr[joint])
    own, rest = fields["jnt_stiffness"][:, joint], fields["qpos_spring"][:, place]
    more = share * values["stiffness"]
    total, pull = own + more, own * rest + more * values["rest_position"]
    fields["qpos_spring"][:, place] = np.divide(pull, total, out=np.array(rest), where=total != 0.0)
    fields["jnt_stiffness"][:, joint] = total


def _tilt(fields: Fields, body: Body, on: str, values: Values, share: FloatArray) -> None:
    """Gravity as a base sees it that was rolled about its x, then pitched about its y."""
    gravity = fields["opt.gravity"]
    roll, pitch = share * values["roll"], share * values["pitch"]
    x, y, z = gravity.T.copy()
    # The transpose of Ry(pitch) Rx(roll): into the tilted base.
    x, z = np.cos(pitch) * x - np.sin(pitch) * z, np.sin(pitch) * x + np.cos(pitch) * z
    y, z = np.cos(roll) * y + np.sin(roll) * z, -np.sin(roll) * y + np.cos(roll) * z
    gravity[:] = np.stack([x, y, z], axis=1)


def _compensated(fields: Fields, body: Body, on: str, values: Values, share: FloatArray) -> None:
    """What is left of gravity where every joint is held against a part of it."""
    fields["opt.gravity"][:] *= 1.0 - (share * values["share"])[:, None]


def _offset(fields: Fields, body: Body, on: str, values: Values, share: FloatArray) -> None:
    """A servo compares its command with what the encoder says."""
    joint, model = body.joint(on), body.model
    for i in range(model.nu):
        if int(model.actuator_trnid[i, 0]) == joint and float(model.actuator_biasprm[i, 1]) != 0.0:
            bias = fields["actuator_biasprm"]
            bias[:, i, 0] += bias[:, i, 1] * float(model.actuator_gear[i, 0]) * share * values["offset"]


def _payload(fields: Fields, body: Body, on: str, values: Values, share: FloatArray) -> None:
    """A point mass at (x, y, z) of a body's frame: mass, centre of mass and moments of inertia of both together."""
    b = body.names.bodies.index(on)
    own, more = fields["body_mass"][:, b], share * values["mass"]
    was, at = fields["body_ipos"][:, b], np.stack([values[k] for k in "xyz"], axis=1)
    total = own + more
    centre = (own[:, None] * was + more[:, None] * at) / total[:, None]
    turned = rotation(fields["body_iquat"][:, b])
    tensor = (turned * fields["body_inertia"][:, b][:, None, :]) @ turned.transpose(0, 2, 1)
    tensor = tensor + _shifted(own, was - centre) + _shifted(more, at - centre)
    moments, axes = np.linalg.eigh(tensor)
    axes[np.linalg.det(axes) < 0.0, :, 0] *= -1.0
    fields["body_mass"][:, b], fields["body_ipos"][:, b] = total, centre
    fields["body_inertia"][:, b], fields["body_iquat"][:, b] = moments, quaternion(axes)


def _shifted(mass: FloatArray, by: FloatArray) -> FloatArray:
    """(B, 3, 3): what a mass (B,) adds to a tensor of inertia so far (B, 3) from its centre."""
    square = (by**2).sum(axis=1)[:, None, None] * np.eye(3)
    return np.asarray(mass[:, None, None] * (square - by[:, :, None] * by[:, None, :]))


def rotation(quat: FloatArray) -> FloatArray:
    """(B, 3, 3) of unit quaternions (B, 4), real part first."""
    w, x, y, z = quat.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


def quaternion(axes: FloatArray) -> FloatArray:
    """(B, 4) unit quaternions, real part first, of rotations (B, 3, 3); Bar-Itzhack (2000), the largest eigenvector."""
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = np.moveaxis(axes, 0, -1)
    none = np.zeros_like(xx)
    rows = [
        [xx - yy - zz, none, none, none],
        [xy + yx, yy - xx - zz, none, none],
        [xz + zx, yz + zy, zz - xx - yy, none],
        [zy - yz, xz - zx, yx - xy, xx + yy + zz],
    ]
    vectors = np.linalg.eigh(np.moveaxis(np.array(rows), 2, 0))[1][:, :, -1]  # (x, y, z, w)
    return np.asarray(vectors[:, [3, 0, 1, 2]])


NATIVE: Mapping[str, Native] = {
    "coulomb_friction": Native(FRICTION, _coulomb),
    "viscous_friction": Native(("dof_damping",), _viscous),
    "quadratic_drag": Native(("dof_dampingpoly",), _adding("dof_dampingpoly", "drag", 0)),
    "spring": Native(("jnt_stiffness", "qpos_spring"), _spring),
    "constant_force": Native((FORCE,), _adding(FORCE, "force")),
    "armature": Native(("dof_armature",), _adding("dof_armature", "inertia")),
    "coupled_friction": Native(TIED_FRICTION, _coupled_friction),
    "coupled_damping": Native(("tendon_damping",), _of_tendon("tendon_damping", "damping")),
    "coupled_armature": Native(("tendon_armature",), _of_tendon("tendon_armature", "inertia")),
    "gravity_tilt": Native(("opt.gravity",), _tilt),
    "gravity_compensation": Native(("opt.gravity",), _compensated),
    "joint_offset": Native(("actuator_biasprm",), _offset),
    "payload": Native(("body_mass", "body_ipos", "body_inertia", "body_iquat"), _payload),
}


@dataclass(frozen=True)
class Plan:
    """How the terms of a hypothesis act in a model, which follows from what they are and not from their values.

    lasting: terms whose fields stand as long as a rollout lasts; passing: those looked at anew at every substep.
    """

    body: Body
    terms: tuple[Term, ...]
    parameters: Mapping[str, float]

    @cached_property
    def lasting(self) -> list[int]:
        """Indices of terms that are written once."""
        return [i for i, t in enumerate(self.terms) if self._written(t) and not t.gate]

    @cached_property
    def passing(self) -> list[int]:
        """Indices of terms that are written at every substep."""
        own = [t.effect.site not in PASSED_ON or isinstance(t.effect, ElasticDrive) for t in self.terms]
        acts = [i for i, t in enumerate(self.terms) if own[i] or native_of(t, self.body)]
        return [i for i in acts if i not in self.lasting]

    @cached_property
    def fields(self) -> frozenset[str]:
        """The fields that simulations need of their own."""
        of_terms = {f for i in (*self.lasting, *self.passing) for f in self._fields_of(self.terms[i])}
        of_parameters = {f for name in self._other for f in self.body.knobs[name].fields}
        return frozenset((of_terms | of_parameters) - {FORCE})

    @cached_property
    def moving_fields(self) -> tuple[str, ...]:
        """Fields that change from substep to substep."""
        return tuple(sorted({f for i in self.passing for f in self._fields_of(self.terms[i])} - {FORCE}))

    def write(
        self, which: Sequence[int], fields: Fields, values: Sequence[Values], shares: Mapping[int, FloatArray]
    ) -> None:
        """Write terms that need to know no state into the fields; shares (B,) of those behind gates."""
        whole = np.ones(fields.count)
        for i in which:
            term, share = self.terms[i], shares.get(i, whole)
            native = native_of(term, self.body)
            if native is not None:
                native.write(fields, self.body, term.on, values[i], share)
            elif isinstance(term.effect, ParameterEffect):
                for on in term.places:
                    believed = np.full(fields.count, self.parameters[on])
                    value = term.effect.corrected(believed, values[i])
                    self.body.knobs[on].write(fields, share * value + (1.0 - share) * believed)

    def believed(self, fields: Fields) -> None:
        """Write what is believed of parameters where that is not what the model says."""
        for name in self._other:
            self.body.knobs[name].write(fields, np.full(fields.count, self.parameters[name]))

    @cached_property
    def timed(self) -> bool:
        """Whether all that passes is written and waits for a moment only: most windows are before or after it."""
        passing = [self.terms[i] for i in self.passing]
        return bool(passing) and all(self._written(t) and not t.gate.region for t in passing)

    def acts_on_state(self, i: int) -> bool:
        """Whether a term's force has to be worked out from where the system is."""
        return native_of(self.terms[i], self.body) is None and isinstance(self.terms[i].effect, ForceEffect)

    @cached_property
    def _other(self) -> list[str]:
        """Parameters that are believed to be other than the model says."""
        declared = self.body.parameters
        return [n for n, v in self.parameters.items() if n in declared and v != declared[n].default]

    def _written(self, term: Term) -> bool:
        return native_of(term, self.body) is not None or isinstance(term.effect, ParameterEffect)

    def _fields_of(self, term: Term) -> tuple[str, ...]:
        native, effect = native_of(term, self.body), term.effect
        if native is not None:
            return native.fields
        if isinstance(effect, ParameterEffect):
            return tuple(field for on in term.places for field in self.body.knobs[on].fields)
        if isinstance(effect, (BristleEffect, ElasticDrive)):
            return (FORCE,)
        if isinstance(effect, ForceEffect):
            return FRICTION if effect.dry else (FORCE,)
        if isinstance(effect, RateEffect):
            return ()
        raise UsageError(f"{term.family} on {term.on}: a MuJoCo model cannot take it")
