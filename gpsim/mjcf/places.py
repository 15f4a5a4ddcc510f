"""Where the families act that only models of bodies know, and how large things are there."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from gpsim.mjcf.body import Body
from gpsim.mjcf.naming import MOTIONS, POSE, servoed
from gpsim.simulators import ModelPlace

CARRIES = 0.5  # kg, a payload on a body that weighs next to nothing
WHOLE = 0.1
"""Of all that moves, what a payload is counted in where its body weighs less (arms lift up to half of their weight)."""


def places_of(body: Body, shown: Sequence[Sequence[str]]) -> Mapping[str, Mapping[str, ModelPlace]]:
    """Of each such family its places; shown: the states, and the coordinates, that a recording shows."""
    states, coordinates = shown
    model, names, lengths = body.base, body.names, body.lengths()
    of_joint = [
        (c.name, j, d)
        for c, j, d in zip(names.coordinates, names.joints, names.dofs, strict=True)
        if c.name in coordinates
    ]
    least = WHOLE * float(model.body_mass.sum())
    payload = {
        name: ModelPlace(
            "kg",
            max(float(model.body_mass[b]), least) or CARRIES,
            lengths[name],
            centre=tuple(float(x) for x in model.body_ipos[b]),
        )
        for b, name in enumerate(names.bodies)
        if name in lengths and int(model.body_simple[b]) == 0
    }
    unit = {name: "kg m^2" if _turning(body, name) else "kg" for name, _, _ in of_joint}
    armature = {
        name: ModelPlace(unit[name], float(model.dof_M0[d]), least=float(model.dof_armature[d]))
        for name, _, d in of_joint
    }
    weighs = float(np.linalg.norm(model.opt.gravity))
    tilt = {"gravity": ModelPlace("rad", 1.0)} if weighs > 0.0 else {}
    held = {"gravity": ModelPlace("1", 1.0)} if weighs > 0.0 and _all_driven(body) else {}
    offset = {
        name: ModelPlace(body.names.state.units[name], 1.0, steers=servoed(model, j))
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
        "gravity_tilt": tilt,
        "gravity_compensation": held,
        "joint_offset": offset,
    }


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


def _all_driven(body: Body) -> bool:
    """Whether every degree of freedom has an actuator, which may hold it against gravity."""
    model = body.model
    return {int(j) for j in model.actuator_trnid[:, 0]} >= set(range(model.njnt)) and model.njnt == model.nv


def _turning(body: Body, joint: str) -> bool:
    return body.names.state.units[joint] == "rad"
