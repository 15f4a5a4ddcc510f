"""Where each effect goes when a corrected model is written down: an attribute of MJCF, the wrapper, or nowhere.

What becomes of commands is the motor's where MJCF can say gain, bias, range and delay so, else the wrapper's.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from gpsim.effects import (
    RISE,
    ActuatorEffect,
    BristleEffect,
    ElasticDrive,
    ForceEffect,
    Measured,
    SensorEffect,
    Term,
    Values,
    effect_of,
)
from gpsim.mjcf.actuators import plain_drive
from gpsim.mjcf.body import Body
from gpsim.mjcf.naming import axes_of, called
from gpsim.mjcf.optional import mujoco
from gpsim.mjcf.plan import FORCE, Fields, Plan, native_of
from gpsim.mjcf.simulator import MjcfSimulator

Where = Literal["attribute", "wrapper", "attribute and wrapper", "left out"]
Elements = tuple[tuple[str, int], ...]
GRIPS = ("coulomb_friction", "stribeck_friction", "load_friction", "local_friction_patch", "force_curve")
"""Laws of dry friction that the wrapper knows."""
DRAGS = ("viscous_friction", "quadratic_drag")
"""Laws along a floating body's own axes that the wrapper knows."""
READINGS = ("sensor_bias", "sensor_scale", "sensor_delay", "sensor_lag", "sensor_curve", "joint_offset")
"""Laws of sensors that the wrapper knows."""
AFFINE = ("actuator_gain", "actuator_bias")
"""What MJCF's gain and bias can say, at the end of a command's way."""


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
    elements: Elements = ()


@dataclass(frozen=True)
class Motor:
    """An actuator that acts otherwise: force = scale * gain * command + gain * more + bias; limit, delay: if any."""

    index: int
    scale: float = 1.0
    more: float = 0.0
    limit: float | None = None
    delay: float | None = None

    @classmethod
    def of(cls, index: int, tail: Sequence[Term]) -> Motor:
        """What effects at the end of a command's way make of its actuator."""
        scale, more, others = 1.0, 0.0, dict[str, float]()
        for term in tail:
            if term.family == "actuator_gain":
                scale, more = scale * term.values["gain"], more * term.values["gain"]
            elif term.family == "actuator_bias":
                more += term.values["bias"]
            else:
                others |= term.values
        return cls(index, scale, more, others.get("limit"), others.get("delay"))


@dataclass
class Patch:
    """A model's fields (1, ...) as they are to be, its motors, what the wrapper is told, and where each effect went."""

    plan: Plan
    values: Sequence[Values]
    fields: Fields
    told: dict[str, Any]
    motors: list[Motor] = field(default_factory=list)
    went: list[Went] = field(default_factory=list)

    def went_to(self, term: Term, where: Where, why: str = "", elements: Elements = ()) -> None:
        """Note where an effect went."""
        self.went.append(Went(term, where, why, elements))


def patch_of(correction: Correction) -> Patch:
    """Split the effects of a correction."""
    simulator, terms = correction.simulator, correction.terms
    body, plan = simulator.body, Plan(simulator.body, terms, correction.parameters)
    values = [{k: np.array([v]) for k, v in t.values.items()} for t in terms]
    fields = Fields(body, np.array([correction.step]))
    plan.believed(fields)
    plan.write([i for i in plan.lasting if not _is_force(terms[i], body)], fields, values, {})
    told: dict[str, Any] = {
        "control_step": correction.dt,
        "substeps": correction.substeps,
        "age": correction.age,
        "commands": {},
        **{kind: [] for kind in ("laws", "forces", "drags", "yields", "changes", "sensors")},
    }
    patch = Patch(plan, values, fields, told)
    _place_commands(patch, simulator.action.names, correction.step)
    for i, term in enumerate(terms):
        if not isinstance(term.effect, ActuatorEffect):
            _place(i, term, patch)
    told["sensors"].sort(key=lambda s: effect_of(s["family"]).order)
    told["channels"] = _channels(simulator, told)
    joints = (body.model.joint(j) for j in body.names.joints)
    told["moving"] = [[int(j.qposadr[0]), int(j.dofadr[0])] for j in joints]
    return patch


def _place_commands(patch: Patch, names: Sequence[str], step: float) -> None:
    """The actuators that MJCF can correct, and what the wrapper does to commands.

    Gain and bias at the end of the way are the motor's own; a limit or a delay before them, if nothing else acts and
    no friction asks what the motor gives. Nothing is where a spring is between motor and joint.
    """
    body, terms = patch.plan.body, patch.plan.terms
    loaded = any(isinstance(t.effect, ForceEffect) and t.effect.loaded_by_command for t in terms)
    elastic = {t.on for t in terms if isinstance(t.effect, ElasticDrive)}
    for index, name in enumerate(names):
        own = [t for t in terms if t.on == name and isinstance(t.effect, ActuatorEffect)]
        way = sorted(own, key=lambda t: t.effect.order)
        native = 0 if name in elastic else _native_tail(body, index, way, None if loaded else step)
        wrapped, tail = way[: len(way) - native], way[len(way) - native :]
        if tail:
            patch.motors.append(Motor.of(index, tail))
        if wrapped:
            patch.told["commands"][called(body.base, "actuator", index)] = [
                {"family": t.family, "values": _numbers(t), "region": _region(t)} for t in wrapped
            ]
        for term in wrapped:
            why = WHY.get(term.family, "MJCF has no attribute for it")
            patch.went_to(term, "wrapper", "acts in a region only" if term.gate.region else why)
        for term in tail:
            patch.went_to(term, "attribute", "", (("actuator", index),))


def _native_tail(body: Body, index: int, way: Sequence[Term], step: float | None) -> int:
    """How many effects at the end of a command's way MJCF can say; step None: neither limits nor delays."""
    if not plain_drive(body.base, index):
        return 0
    count = 0
    while count < len(way) and way[-1 - count].family in AFFINE and not way[-1 - count].gate.region:
        count += 1
    left = way[: len(way) - count]
    if step is None or len(left) != 1 or left[0].gate.region:
        return count
    # MuJoCo delays as gpsim does by no less than a step, and not where its steps look at commands in between.
    between = int(body.base.opt.integrator) == mujoco().mjtIntegrator.mjINT_RK4
    delays = left[0].family == "actuator_delay" and left[0].values["delay"] >= step and not between
    return count + (delays or left[0].family == "actuator_saturation")


WHY = {
    "actuator_lag": "MuJoCo's own filter acts a step later",
    "actuator_delay": "MuJoCo would round the delay to whole steps, or cannot combine it with other effects",
    **dict.fromkeys(
        (*AFFINE, "actuator_saturation"), "another effect without an MJCF attribute acts after it, or with it"
    ),
}
"""Of an effect on commands why it is the wrapper's, if it acts everywhere."""


def samples(delay: float, step: float) -> int:
    """How many commands MuJoCo must remember for a delay [s]: too few shorten it silently."""
    return math.ceil(delay / step) + 3


def _place(i: int, term: Term, patch: Patch) -> None:
    effect, plan, told, region = term.effect, patch.plan, patch.told, _region(term)
    names = plan.body.names
    if isinstance(effect, (BristleEffect, ElasticDrive)):
        joint, strength = plan.body.coupled.get(term.on, (term.on, 1.0))
        law = {"joint": joint, "strength": strength, "values": {**effect.takes, **_numbers(term)}}
        if joint != term.on:
            law["motor"] = called(plan.body.base, "actuator", names.action.index(term.on))
        told["yields"].append(law)
        patch.went_to(term, "wrapper", "MJCF has no element with presliding memory")
    elif isinstance(effect, SensorEffect):
        if term.family not in READINGS:
            patch.went_to(term, "left out", "the wrapper does not support this sensor")
            return
        elements = _elements(plan.body, _moved(patch, i)) if i in plan.lasting else ()
        told["sensors"].append({"family": term.family, "channel": term.on, "values": _numbers(term)})
        where: Where = "attribute and wrapper" if elements else "wrapper"
        patch.went_to(term, where, "MJCF's sensors have no such fault", elements)
    elif i in plan.lasting and not _is_force(term, plan.body):
        patch.went_to(term, "attribute", "", _elements(plan.body, _moved(patch, i)))
    elif isinstance(effect, ForceEffect) and effect.dry and _gripping(term):
        law = {"family": term.family, "joint": term.on, "values": _numbers(term), "region": region}
        told["laws"].append(law)
        why = (
            "acts in a region only"
            if region
            else "friction in MJCF does not depend on speed, position or load"
        )
        patch.went_to(term, "wrapper", why)
    elif isinstance(effect, Measured) and isinstance(effect, ForceEffect):
        told["forces"].append({"joint": term.on, "of": term.variant, "values": _numbers(term)})
        patch.went_to(term, "wrapper", "MJCF has no such force law")
    elif term.family in DRAGS and term.on in (axes := axes_of(names, names.state)):
        axis = axes[term.on]
        orientation, dof = names.positions[axis.orientation[0]], axis.dofs[0]
        size = {"damping": 0.0, "drag": 0.0, **_numbers(term)}
        told["drags"].append({"dof": dof, "orientation": orientation, "axis": axis.axis, **size})
        patch.went_to(term, "wrapper", "MJCF has no drag along an axis of its own body")
    elif plan.acts_on_state(i) or effect.site == "rate":
        patch.went_to(term, "left out", "neither MJCF nor the wrapper has this law")
    else:
        told["changes"] += [{**change, "region": region} for change in _moved(patch, i)]
        why = "acts in a region only" if region else "MJCF has no constant force on a joint"
        patch.went_to(term, "wrapper", why)


def _gripping(term: Term) -> bool:
    return term.family in GRIPS and term.variant in ("", "friction", RISE)


def _is_force(term: Term, body: Body) -> bool:
    """Whether a term is written as an input, not as an attribute."""
    native = native_of(term, body)
    return native is not None and FORCE in native.fields


def _moved(patch: Patch, i: int) -> list[dict[str, Any]]:
    """Which fields a term changes, element by element, and by how much: it is added while the term acts."""
    plan, made = patch.plan, []
    others = [k for k in plan.lasting if k != i]
    for which in (others, [*others, i]):
        fields = Fields(plan.body, np.array([plan.body.own_step]))
        plan.believed(fields)
        plan.write(which, fields, patch.values, {})
        made.append(fields)
    without, within = made
    changes = []
    for name in list(within):
        change = within[name][0] - without[name][0]
        for at in (tuple(index.tolist()) for index in np.argwhere(change)):
            changes.append({"field": name, "index": list(at), "add": float(change[at])})
    return changes


def _elements(body: Body, changes: list[dict[str, Any]]) -> Elements:
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
        elif kind == "opt.gravity":
            found.append(("option", 0))
        else:
            found.append((kind if kind in ("body", "geom", "actuator", "tendon") else "option", place))
    return tuple(dict.fromkeys(found))


def _numbers(term: Term) -> dict[str, float]:
    return {name: float(value) for name, value in term.values.items()}


def _region(term: Term) -> dict[str, list[float]]:
    return {name: [float(low), float(high)] for name, (low, high) in term.gate.region.items()}


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
