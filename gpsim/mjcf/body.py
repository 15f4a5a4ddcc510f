"""A model as gpsim asks it: a copy that takes commands as they come, its names, parameters and what it already has.

With it where the families act that only models of bodies know, and how large things are there.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np

from gpsim.errors import UsageError
from gpsim.mjcf.actuators import Activations, activations_of, motors_on
from gpsim.mjcf.batches import Pool, Pools
from gpsim.mjcf.geometry import Moved, corrected
from gpsim.mjcf.loading import Loaded, source_of, spec_of
from gpsim.mjcf.model_files import MODEL_FILES
from gpsim.mjcf.naming import MOTIONS, POSE, Names, called, names_of, servoed
from gpsim.mjcf.optional import mujoco
from gpsim.mjcf.parameters import Knob, Surface, length_of, moving_bodies, parameters_of, surfaces_of
from gpsim.simulators import ModelPlace, Parameter

HELD = 1e9  # of inertia: what is held by a mount heavier than anything
CARRIES = 0.5  # kg, a payload on a body that weighs next to nothing
TENDON = "tendon_"
"""How fields of tendons begin, of which only families with a drive between two joints have need."""
WHOLE = 0.1
"""Of all that moves, what a payload is counted in where its body weighs less (arms lift up to half of their weight)."""


@dataclass(frozen=True)
class Tie:
    """Two joints in a row that one drive may turn with, and how often the second one turns it, 1 or -1."""

    joints: tuple[int, int]
    second: float


@dataclass
class Body:
    """A compiled model with its names, parameters, and the batches that step it in this process.

    base: MuJoCo's own, its geometry corrected if that is known. model: commands are not clamped in it, since effects
    act on clamped ones, and nothing in it relies on where a body's centre of mass happens to be. ties: by their places;
    as_asked: what makes such a model of a compiled one.
    """

    loaded: Loaded
    base: Any
    model: Any
    names: Names
    parameters: dict[str, Parameter]
    knobs: dict[str, Knob]
    surfaces: tuple[Surface, ...]
    activations: Activations
    ties: Mapping[str, Tie]
    as_asked: Callable[[Any], Any]

    def pool(self, fields: frozenset[str]) -> Pool:
        """The batch, in this process, whose simulations have these fields of their own."""
        return (self._tied_pools if any(name.startswith(TENDON) for name in fields) else self._pools).of(
            fields
        )

    @cached_property
    def _pools(self) -> Pools:
        return Pools(self.model)

    @cached_property
    def _tied_pools(self) -> Pools:
        return Pools(self.tied)

    @cached_property
    def tied(self) -> Any:
        """The model with a tendon for every tie, which does nothing yet; raises UsageError where its files changed."""
        source = self.loaded.source
        if source_of(source.reference).digest != source.digest:
            raise UsageError(f"{source.reference}: changed during the diagnosis; start again")
        spec = spec_of(source.reference)
        for place in self.ties:
            self.tie(spec, place)
        return self.as_asked(spec.compile())

    def tie(self, spec: Any, place: str) -> Any:
        """A new tendon of a spec between the joints of a tie."""
        name, taken = place, {tendon.name for tendon in spec.tendons}
        while name in taken:
            name += "_"
        tendon = spec.add_tendon(name=name)
        for index, turns in zip(self.ties[place].joints, (1.0, self.ties[place].second), strict=True):
            joint = next(j for j in spec.joints if j.id == index)
            joint.name = joint.name or called(self.base, "joint", index)
            tendon.wrap_joint(joint.name, turns)
        return tendon

    def tendon(self, place: str) -> int:
        """The number of a tie's tendon in the model that has them."""
        return int(self.base.ntendon) + [*self.ties].index(place)

    @cached_property
    def motors(self) -> dict[str, tuple[int, ...]]:
        """See `motors_on`."""
        return motors_on(self.model, self.names)

    @cached_property
    def coupled(self) -> dict[str, tuple[str, float]]:
        """Action -> the joint that it alone drives by a multiple of its command, and that multiple."""
        model, out = self.model, {}
        for on, motors in self.motors.items():
            i, none = motors[0], mujoco().mjtBias.mjBIAS_NONE
            strength = float(model.actuator_gear[i, 0] * model.actuator_gainprm[i, 0])
            if len(motors) == 1 and int(model.actuator_biastype[i]) == none and strength > 0.0:
                out[self.names.action.names[i]] = on, strength
        return out

    @property
    def own_step(self) -> float:
        """The model's step [s]."""
        return float(self.model.opt.timestep)

    def joint(self, coordinate: str) -> int:
        """The number of a coordinate's joint."""
        return self.names.joints[[c.name for c in self.names.coordinates].index(coordinate)]

    def lengths(self) -> dict[str, float]:
        """Of every body that moves how long it is [m]."""
        return {self.names.bodies[b]: length_of(self.base, b) for b in moving_bodies(self.base)}


def body_of(
    loaded: Loaded,
    held: tuple[str, ...] = (),
    exact: bool = False,
    contacts: bool = True,
    geometry: tuple[Moved, ...] = (),
) -> Body:
    """What gpsim diagnoses of a model, its joints `held` in a mount; raises UsageError for what it cannot.

    exact: by the classical Runge-Kutta scheme, whatever the model says; contacts: whether bodies touch; geometry: by
    what that of the model is off.
    """
    base, where = loaded.model, loaded.source.reference
    names = names_of(base, where)
    if int(getattr(base, "nhistory", 0)):
        raise UsageError(
            f"{where}: it already delays actuators or sensors; remove delay= from the model: gpsim finds delays"
        )
    in_place = partial(corrected, names=names, moved=geometry) if geometry else copy.copy
    as_asked = partial(_as_asked, names=names, held=held, exact=exact, contacts=contacts)
    base = in_place(base)
    known, surfaces = parameters_of(base, names), surfaces_of(base, names, where)
    parameters = {name: declared for name, (declared, _) in known.items()}
    knobs = {name: knob for name, (_, knob) in known.items()}
    parameters |= {s.parameter: s.declared for s in surfaces}
    knobs |= {s.parameter: s.knob for s in surfaces}
    return Body(
        loaded, base, as_asked(base), names, parameters, knobs, surfaces, activations_of(base, where),
        _ties_of(base, names) if where.lower().endswith(MODEL_FILES) else {}, lambda model: as_asked(in_place(model)),
    )  # fmt: skip


def _ties_of(model: Any, names: Names) -> dict[str, Tie]:
    """Of joints in a row that move alike, hinges or slides, their sum and their difference, from the base on."""
    out, by_dof = {}, dict(zip(names.dofs, names.coordinates, strict=True))
    for dof, coordinate in by_dof.items():
        before = by_dof.get(int(model.dof_parentid[dof]))
        if before and before.force_unit == coordinate.force_unit:
            joints = int(model.dof_jntid[model.dof_parentid[dof]]), int(model.dof_jntid[dof])
            for sign, second in (("+", 1.0), ("-", -1.0)):
                out[f"{before.name}{sign}{coordinate.name}"] = Tie(joints, second)
    return out


def _as_asked(base: Any, names: Names, held: tuple[str, ...], exact: bool, contacts: bool) -> Any:
    """A copy of a model as `body_of` is asked for it."""
    mj, model = mujoco(), copy.copy(base)
    off = mj.mjtDisableBit
    model.opt.disableflags |= int(off.mjDSBL_CLAMPCTRL) | int(off.mjDSBL_ISLAND) | int(off.mjDSBL_SENSOR)
    _let_friction_act(model)
    if not contacts:
        model.opt.disableflags |= int(off.mjDSBL_CONTACT)
    if exact:
        model.opt.integrator = int(mj.mjtIntegrator.mjINT_RK4)
        # Which that scheme makes exact: the other one it makes slow, and longer steps must not act a step early.
        model.actuator_dyntype[model.actuator_dyntype == mj.mjtDyn.mjDYN_FILTEREXACT] = mj.mjtDyn.mjDYN_FILTER
        model.actuator_actearly[:] = False
    model.body_sameframe[:] = mj.mjtSameFrame.mjSAMEFRAME_NONE
    for coordinate, dof in zip(names.coordinates, names.dofs, strict=True):
        if coordinate.name in held:
            model.dof_armature[dof] += HELD
            model.dof_damping[dof] = 0.0
            model.dof_frictionloss[dof] = 0.0
    return model


def _let_friction_act(model: Any) -> None:
    """A model without constraints (or without dry friction) leaves dry friction out, which may be what is missing."""
    off, flags = mujoco().mjtDisableBit, int(model.opt.disableflags)
    if flags & int(off.mjDSBL_CONSTRAINT):
        flags |= int(off.mjDSBL_EQUALITY) | int(off.mjDSBL_LIMIT) | int(off.mjDSBL_CONTACT)
        flags |= int(off.mjDSBL_FRICTIONLOSS)
    if flags & int(off.mjDSBL_FRICTIONLOSS):
        model.dof_frictionloss[:] = 0.0
        model.tendon_frictionloss[:] = 0.0
    model.opt.disableflags = flags & ~int(off.mjDSBL_CONSTRAINT) & ~int(off.mjDSBL_FRICTIONLOSS)


def places_of(body: Body, shown: Sequence[Sequence[str]]) -> Mapping[str, Mapping[str, ModelPlace]]:
    """Of each such family its places; shown: the states, and the coordinates, that a recording shows."""
    states, coordinates = shown
    model, names, lengths = body.base, body.names, body.lengths()
    every = zip(names.coordinates, names.joints, names.dofs, strict=True)
    of_joint = [(c.name, j, d) for c, j, d in every if c.name in coordinates]
    units = body.names.state.units
    least = WHOLE * float(model.body_mass.sum())
    payload = {}
    for b, name in enumerate(names.bodies):
        if name in lengths and int(model.body_simple[b]) == 0:
            size, centre = max(float(model.body_mass[b]), least) or CARRIES, model.body_ipos[b].tolist()
            payload[name] = ModelPlace("kg", size, lengths[name], centre=tuple(centre))
    armature = {
        name: ModelPlace(
            "kg m^2" if units[name] == "rad" else "kg",
            float(model.dof_M0[d]),
            least=float(model.dof_armature[d]),
        )
        for name, _, d in of_joint
    }
    brakes, loads = _drives(body, armature)
    weighs = float(np.linalg.norm(model.opt.gravity))
    tilt = {"gravity": ModelPlace("rad", 1.0)} if weighs > 0.0 else {}
    # Every degree of freedom has an actuator, which may hold it against gravity.
    driven = {int(j) for j in model.actuator_trnid[:, 0]} >= set(range(model.njnt)) and model.njnt == model.nv
    held = tilt and {"gravity": ModelPlace("1", 1.0)} if driven else {}
    offset = {
        name: ModelPlace(units[name], 1.0, steers=servoed(model, j))
        for name, j, _ in of_joint
        if name in states
    }
    along, pushed = _afloat(body, MOTIONS), _afloat(body, (*POSE[:3], *MOTIONS[3:]))
    return {
        "viscous_friction": along,
        "quadratic_drag": along,
        "constant_force": pushed,
        "payload": payload,
        "armature": armature,
        "coupled_friction": brakes,
        "coupled_damping": brakes,
        "coupled_armature": loads,
        "gravity_tilt": tilt,
        "gravity_compensation": held,
        "joint_offset": offset,
    }


def _drives(
    body: Body, rotors: Mapping[str, ModelPlace]
) -> tuple[dict[str, ModelPlace], dict[str, ModelPlace]]:
    """Where a drive may turn with two joints that are shown, as places of its friction and of its rotor.

    The mass matrix has no room for the latter where MuJoCo takes two slides of one body for independent.
    """
    names, brakes, loads = body.names, dict[str, ModelPlace](), dict[str, ModelPlace]()
    every = zip(names.joints, names.coordinates, names.dofs, strict=True)
    joints = {j: (c.name, c.force_unit, int(body.base.dof_simplenum[dof]) == 0) for j, c, dof in every}
    for on, tie in body.ties.items():
        (first, unit, meets), (second, _, meet) = (joints[j] for j in tie.joints)
        if first in rotors and second in rotors:
            size = max(rotors[first].size, rotors[second].size)
            brakes[on] = ModelPlace(unit, size, along=((first, 1.0), (second, tie.second)))
            if meets and meet:
                loads[on] = replace(brakes[on], unit=rotors[first].unit)
    return brakes, loads


def _afloat(body: Body, axes: Sequence[str]) -> dict[str, ModelPlace]:
    """Axes of every free joint, with its mass or its moment of inertia and all that hangs on it."""
    out, model, names = {}, body.base, body.names
    for joint in names.free:
        first = names.dof(f"{joint}.x")
        for axis in axes:
            dof = names.dof(f"{joint}.{axis}")
            half = first if dof < first + 3 else first + 3
            unit, rates = "N" if half == first else "N m", names.rate.names[half : half + 3]
            out[f"{joint}.{axis}"] = ModelPlace(unit, float(model.dof_M0[dof]), afloat=rates)
    return out
