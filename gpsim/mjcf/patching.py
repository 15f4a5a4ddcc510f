"""Where each effect goes when a corrected model is written down: an attribute of MJCF, the wrapper, or nowhere."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from gpsim.channels import FloatArray
from gpsim.effects import (
    RISE,
    ActuatorEffect,
    BristleEffect,
    ElasticDrive,
    ForceEffect,
    Measured,
    SensorEffect,
    Term,
    effect_of,
)
from gpsim.mjcf.afloat import axes_of
from gpsim.mjcf.body import Body
from gpsim.mjcf.commanding import Motor, actuator_name, motors_of
from gpsim.mjcf.native import FORCE, Fields, native_of
from gpsim.mjcf.simulator import MjcfSimulator
from gpsim.mjcf.stepping import Plan

Where = Literal["attribute", "wrapper", "attribute and wrapper", "left out"]
GRIPS = ("coulomb_friction", "stribeck_friction", "load_friction", "local_friction_patch", "force_curve")
"""Laws of dry friction that the wrapper knows."""
DRAGS = ("viscous_friction", "quadratic_drag")
"""Laws along a floating body's own axes that the wrapper knows."""
READINGS = ("sensor_bias", "sensor_scale", "sensor_delay", "sensor_lag", "sensor_curve", "joint_offset")
"""Laws of sensors that the wrapper knows."""


@dataclass(frozen=True)
class Correction:
    """What is to be written down: a model, what is believed of it, the effects, and the steps it is simulated in.

    age: s on the recording's clock at which an episode begins, for what changes with time.
    """

    simulator: MjcfSimulator
    parameters: Mapping[str, float]
    terms: tuple[Term, ...]
    dt: float
    substeps: int
    age: float = 0.0

    @property
    def step(self) -> float:
        """The model's step [s]."""
        return self.dt / self.substeps


@dataclass(frozen=True)
class Went:
    """Where an effect went, and why where that is not an attribute; elements: (kind, index) that it changes."""

    term: Term
    where: Where
    why: str = ""
    elements: tuple[tuple[str, int], ...] = ()


@dataclass
class Patch:
    """A model's fields (1, ...) as they are to be, its motors, what the wrapper is told, and where each effect went."""

    fields: Fields
    motors: Sequence[Motor]
    told: dict[str, Any]
    went: list[Went] = field(default_factory=list)


def patch_of(correction: Correction) -> Patch:
    """Split the effects of a correction."""
    simulator = correction.simulator
    body, plan = simulator.body, Plan(simulator.body, correction.terms, correction.parameters)
    values = [{k: np.array([v]) for k, v in t.values.items()} for t in correction.terms]
    fields = Fields(body, 1, np.array([correction.step]), {})
    plan.believed(fields)
    plan.write([i for i in plan.lasting if not _is_force(correction.terms[i], body)], fields, values, {})
    motors, commands, went = motors_of(body, simulator.action.names, correction.terms, correction.step)
    patch = Patch(fields, motors, {}, [])
    for term, where, why in went:
        index = simulator.action.index(term.on)
        patch.went.append(Went(term, where, why, (("actuator", index),) if where == "attribute" else ()))
    told = patch.told = {
        "control_step": correction.dt,
        "substeps": correction.substeps,
        "age": correction.age,
        "commands": commands,
        "laws": [],
        "forces": [],
        "drags": [],
        "yields": [],
        "changes": [],
        "sensors": [],
    }
    for i, term in enumerate(correction.terms):
        _place(i, term, plan, values, patch)
    told["sensors"].sort(key=lambda s: _order(s["family"]))
    told["channels"] = _channels(simulator, told)
    joints = (body.model.joint(j) for j in body.names.joints)
    told["moving"] = [[int(j.qposadr[0]), int(j.dofadr[0])] for j in joints]
    return patch


def _place(i: int, term: Term, plan: Plan, values: list[dict[str, FloatArray]], patch: Patch) -> None:
    effect, told = term.effect, patch.told
    region = {name: [float(low), float(high)] for name, (low, high) in term.gate.region.items()}
    if isinstance(effect, ActuatorEffect):
        return
    if isinstance(effect, (BristleEffect, ElasticDrive)):
        joint, strength = plan.body.coupled.get(term.on, (term.on, 1.0))
        law = {"joint": joint, "strength": strength, "values": {**effect.takes, **_numbers(term)}}
        told["yields"].append(
            {**law, "motor": actuator_name(plan.body, term.on)} if joint != term.on else law
        )
        patch.went.append(Went(term, "wrapper", "MJCF has nothing that yields and remembers how far"))
        return
    if isinstance(effect, SensorEffect):
        elements = _elements(plan.body, _moved(plan, i, values)) if i in plan.lasting else ()
        if term.family not in READINGS:
            patch.went.append(Went(term, "left out", "the wrapper does not know this sensor"))
            return
        told["sensors"].append({"family": term.family, "channel": term.on, "values": _numbers(term)})
        where: Where = "attribute and wrapper" if elements else "wrapper"
        patch.went.append(Went(term, where, "MJCF's sensors have no such fault", elements))
    elif i in plan.lasting and not _is_force(term, plan.body):
        patch.went.append(Went(term, "attribute", "", _elements(plan.body, _moved(plan, i, values))))
    elif (
        isinstance(effect, ForceEffect)
        and effect.dry
        and term.family in GRIPS
        and term.variant in ("", "friction", RISE)
    ):
        told["laws"].append(
            {"family": term.family, "joint": term.on, "values": _numbers(term), "region": region}
        )
        why = "acts in a region only" if region else "MJCF's friction does not depend on speed, place or load"
        patch.went.append(Went(term, "wrapper", why))
    elif isinstance(effect, Measured) and isinstance(effect, ForceEffect):
        told["forces"].append({"joint": term.on, "of": term.variant, "values": _numbers(term)})
        patch.went.append(Went(term, "wrapper", "MJCF has no force of such a form"))
    elif term.family in DRAGS and term.on in (axes := axes_of(plan.body.names, plan.body.names.state)):
        axis = axes[term.on]
        orientation, dof = plan.body.names.positions[axis.orientation[0]], axis.dofs[0]
        size = {"damping": 0.0, "drag": 0.0, **_numbers(term)}
        told["drags"].append({"dof": dof, "orientation": orientation, "axis": axis.axis, **size})
        patch.went.append(Went(term, "wrapper", "MJCF has no drag along an axis of its own body"))
    elif plan.acts_on_state(i) or effect.site == "rate":
        patch.went.append(Went(term, "left out", "neither MJCF nor the wrapper knows this law"))
    else:
        told["changes"] += [{**change, "region": region} for change in _moved(plan, i, values)]
        why = "acts in a region only" if region else "MJCF has no constant force on a joint"
        patch.went.append(Went(term, "wrapper", why))


def _is_force(term: Term, body: Body) -> bool:
    """Whether a term is written as an input, not as an attribute."""
    native = native_of(term, body)
    return native is not None and FORCE in native.fields


def _moved(plan: Plan, i: int, values: list[dict[str, FloatArray]]) -> list[dict[str, Any]]:
    """Which fields a term changes, element by element, and by how much: it is added while the term acts."""
    made = []
    for acts in (False, True):
        fields = Fields(plan.body, 1, np.array([plan.body.own_step]), {})
        plan.believed(fields)
        others = [k for k in plan.lasting if k != i]
        plan.write([*others, i] if acts else others, fields, values, {})
        made.append(fields)
    without, within = made
    changes = []
    for name in list(within):
        change = within[name][0] - without[name][0]
        for index in np.argwhere(change):
            at = tuple(int(k) for k in index)
            changes.append({"field": name, "index": list(at), "add": float(change[at])})
    return changes


def _elements(body: Body, changes: list[dict[str, Any]]) -> tuple[tuple[str, int], ...]:
    """Which elements of the model such changes are of."""
    model = body.base
    of_position = {int(model.jnt_qposadr[j]): j for j in range(model.njnt)}
    found = []
    for change in changes:
        kind, place = change["field"].split("_")[0], (change["index"] or [0])[0]
        if kind == "dof":
            found.append(("joint", int(model.dof_jntid[place])))
        elif kind in ("jnt", "qpos"):
            found.append(("joint", place if kind == "jnt" else of_position[place]))
        else:
            found.append(
                (
                    kind if kind in ("body", "geom", "actuator") else "option",
                    0 if kind == "opt.gravity" else place,
                )
            )
    return tuple(dict.fromkeys(found))


def _numbers(term: Term) -> dict[str, float]:
    return {name: float(value) for name, value in term.values.items()}


def _order(family: str) -> int:
    return effect_of(family).order


def _channels(simulator: MjcfSimulator, told: Mapping[str, Any]) -> dict[str, list[Any]]:
    """Of every channel that the wrapper looks at: where it lies, and whether it wraps."""
    regions = [e["region"] for way in told["commands"].values() for e in way]
    regions += [each["region"] for each in (*told["laws"], *told["changes"])]
    looked = {name for region in regions for name in region} | {s["channel"] for s in told["sensors"]}
    names, found = simulator.body.names, {}
    for channel, q, v in zip(names.state, names.positions, names.velocities, strict=True):
        found[channel.name] = ["qpos", q] if q >= 0 else ["qvel", v]
    found |= {name: ["ctrl", i] for i, name in enumerate(names.action.names)}
    wraps = {c.name: c.wraps for c in (*simulator.state, *simulator.action)}
    return {name: [*found[name], wraps.get(name, False)] for name in sorted(looked)}
