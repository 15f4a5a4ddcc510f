"""What may be other than a model believes: its parameters, and how each one's value is written into the model's fields.

Masses, centres of mass, moments of inertia, gains and limits of servos; then what moving bodies stand on, friction and
stiffness of contacts. MuJoCo makes a contact's numbers of two geoms: the one of higher priority alone, else the larger
friction and a mean of the time constants (Todorov 2014; MuJoCo's documentation, Contact parameters). A parameter of a
geom is therefore what its contacts have: the other geom is written along where it would decide otherwise. Told are
contacts of what moves with what is fixed to the world; explicit pairs have numbers of their own, and none of them is a
parameter.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from gpsim.channels import FloatArray
from gpsim.mjcf.geometry import ancestors
from gpsim.mjcf.naming import Names
from gpsim.mjcf.optional import mujoco
from gpsim.recordings import check_name
from gpsim.simulators import Parameter

HEAVIEST = 20.0
"""Times what is believed: the most that a mass, a gain or a friction may be, and 1 / 20 the least."""
LENGTHS = 5.0  # a centre of mass lies no more than so many lengths of its body from where it is believed
SHORT = 0.02  # m, the least length of a body
LIGHT = 1e-5  # of a robot's mass: a part that moves nothing which a recording shows
RUBS = 3  # condim of a contact from which on it has friction
FURTHEST = 2.0  # times its distance, that a foot is from its body's frame at most
SAFE = 2.0  # steps: MuJoCo takes a shorter time constant for one so long
FRICTION, SOLREF, REACH = "friction", "solref", "reach"
Written = Mapping[str, FloatArray]
"""Fields (B, ...) of simulations, by their names."""


@dataclass(frozen=True)
class Knob:
    """One parameter of a model: the fields it changes, and how its value (B,) writes them."""

    fields: tuple[str, ...]
    write: Callable[[Written, FloatArray], None]


def place_knob(name: str, *at: int) -> Knob:
    """The value itself, at one place of a field."""
    where: tuple[slice | int, ...] = (slice(None), *at)

    def write(fields: Written, value: FloatArray) -> None:
        fields[name][where] = value

    return Knob((name,), write)


def scale_knob(believed: float, *places: tuple[str, tuple[int | list[int], ...]]) -> Knob:
    """All that lies at these places of fields, by the ratio of the value to what is believed."""

    def write(fields: Written, value: FloatArray) -> None:
        for name, at in places:
            where = (slice(None), *at)
            part = np.asarray(fields[name][where])
            fields[name][where] = part * (value / believed).reshape(-1, *(1,) * (part.ndim - 1))

    return Knob(tuple(name for name, _ in places), write)


def moving_bodies(model: Any) -> list[int]:
    """Bodies that a joint moves, with a mass that counts."""
    least = LIGHT * float(model.body_mass.sum())
    return [b for b in range(1, model.nbody) if model.body_weldid[b] and float(model.body_mass[b]) > least]


def length_of(model: Any, body: int) -> float:
    """About how long a body is [m]: its geoms, and how far its centre of mass is from its frame."""
    first, count = int(model.body_geomadr[body]), int(model.body_geomnum[body])
    sizes = [float(model.geom_rbound[g]) for g in range(first, first + count)]
    gyration = math.sqrt(float(model.body_inertia[body].max()) / float(model.body_mass[body]))
    return max([*sizes, float(np.linalg.norm(model.body_ipos[body])), gyration, SHORT])


def parameters_of(model: Any, names: Names) -> dict[str, tuple[Parameter, Knob]]:
    """What may be other than the model believes, and how to write it; contacts left out, see `surfaces_of`."""
    found: dict[str, tuple[Parameter, Knob]] = {}

    def add(name: str, unit: str, value: float, text: str, knob: Knob, least: float | None = None) -> None:
        low = value / HEAVIEST if least is None else least
        found[name] = Parameter(unit, value, low, HEAVIEST * value, text, 0.0), knob

    size = float(np.linalg.norm(model.opt.gravity))
    if size > 0.0:
        add("gravity", "m/s^2", size, "acceleration of gravity", scale_knob(size, ("opt.gravity", ())), 0.0)
    for b in moving_bodies(model):
        name, length = names.bodies[b], length_of(model, b)
        add(f"{name}.mass", "kg", float(model.body_mass[b]), f"mass of {name}", place_knob("body_mass", b))
        if int(model.body_simple[b]) == 0:  # else MuJoCo takes its part of the mass matrix for diagonal
            for axis, letter in enumerate("xyz"):
                at, far = float(model.body_ipos[b, axis]), LENGTHS * length
                text = f"centre of mass of {name} along its {letter}"
                declared = Parameter("m", at, at - far, at + far, text, length)
                found[f"{name}.com_{letter}"] = declared, place_knob("body_ipos", b, axis)
        inertia = float(model.body_inertia[b].max())
        if inertia > 0.0 and _turned(model, b):
            text = f"largest moment of inertia of {name} about its centre of mass"
            add(f"{name}.inertia", "kg m^2", inertia, text, scale_knob(inertia, ("body_inertia", (b,))))
    for i, action in enumerate(names.action.names):
        stiff, damped = -float(model.actuator_biasprm[i, 1]), -float(model.actuator_biasprm[i, 2])
        # Where a servo's gain multiplies the command, too, both go together.
        gain, (kp, kv) = ("actuator_gainprm", (i, 0)), (("actuator_biasprm", (i, k)) for k in (1, 2))
        if stiff > 0.0:
            add(f"{action}.kp", "1", stiff, f"position gain of {action}", scale_knob(stiff, kp, gain))
        if damped > 0.0:
            knob = scale_knob(damped, kv, *([gain] if stiff <= 0.0 else []))
            add(f"{action}.kv", "1", damped, f"velocity gain of {action}", knob)
        most = float(np.abs(model.actuator_forcerange[i]).max())
        if model.actuator_forcelimited[i] and most > 0.0:
            text = f"the force or torque limit of {action}"
            add(f"{action}.forcerange", "1", most, text, scale_knob(most, ("actuator_forcerange", (i,))))
    return found


def _turned(model: Any, body: int) -> bool:
    """Whether a body does more than slide along lines: else how it resists turning does not show."""
    slide, carriers = int(mujoco().mjtJoint.mjJNT_SLIDE), ancestors(model, body)
    return any(t != slide and b in carriers for t, b in zip(model.jnt_type, model.jnt_bodyid, strict=True))


@dataclass(frozen=True)
class Surface:
    """One number of the contacts of a geom. others: geoms that it touches; name: of the geom, as in the parameter."""

    geom: int
    name: str
    kind: str
    others: frozenset[int]
    declared: Parameter
    knob: Knob

    @property
    def parameter(self) -> str:
        """Its name as a parameter: floor.friction."""
        return f"{self.name}.{self.kind}"


def surfaces_of(model: Any, names: Names, where: str) -> tuple[Surface, ...]:
    """Friction, then time constants, of every geom that decides some contact between what moves and what does not.

    Then how far feet reach: spheres that lie at some distance from their body's frame. Raises UsageError where a name
    cannot be used; where: whose model it is.
    """
    called, pairs, found = _called(model, names), list(_pairs(model)), []
    for kind, make in ((FRICTION, _friction), (SOLREF, _solref), (REACH, _reach)):
        others: dict[int, set[int]] = defaultdict(set)
        for fixed, moving in pairs:
            if _told(model, fixed, moving, kind):
                decides = moving if kind == REACH else _decider(model, fixed, moving, kind)
                others[decides].add(moving if decides == fixed else fixed)
        for geom in sorted(others):
            check_name(called[geom], f"{where}: geom number {geom}")
            met = frozenset(others[geom])
            # Those of the others that have a say beside the geom that decides.
            led = [g for g in sorted(met) if model.geom_priority[g] == model.geom_priority[geom]]
            declared, knob = make(model, geom, called[geom], led)
            found.append(Surface(geom, called[geom], kind, met, declared, knob))
    return tuple(found)


def _called(model: Any, names: Names) -> dict[int, str]:
    """Every geom by its name, else by its body's where that says which, else geom0 by its number."""
    own = {g: str(model.geom(g).name) for g in range(model.ngeom)}
    taken = {name for name in own.values() if name}
    touch = [g for g in own if model.geom_contype[g] or model.geom_conaffinity[g]]
    bodies = [int(model.geom_bodyid[g]) for g in touch if not own[g]]
    for g in own:
        body = int(model.geom_bodyid[g])
        alone = g in touch and bodies.count(body) == 1 and names.bodies[body] not in taken
        own[g] = own[g] or (names.bodies[body] if alone else f"geom{g}")
    return own


def _pairs(model: Any) -> Iterator[tuple[int, int]]:
    """(fixed, moving): geoms that may touch by MuJoCo's rules."""
    mj, flags = mujoco(), int(model.opt.disableflags)
    off = int(mj.mjtDisableBit.mjDSBL_CONTACT) | int(mj.mjtDisableBit.mjDSBL_CONSTRAINT)
    if flags & off or int(model.opt.enableflags) & int(mj.mjtEnableBit.mjENBL_OVERRIDE):
        return
    body, kind, affinity = model.geom_bodyid, model.geom_contype, model.geom_conaffinity
    stands = model.body_weldid[body] == 0
    said = {frozenset(p) for p in zip(model.pair_geom1.tolist(), model.pair_geom2.tolist(), strict=True)}
    apart = set(model.exclude_signature.tolist())
    for a in np.flatnonzero(stands).tolist():
        meet = ~stands & (((kind[a] & affinity) != 0) | ((kind & affinity[a]) != 0))
        for b in np.flatnonzero(meet).tolist():
            low, high = sorted((int(body[a]), int(body[b])))
            if frozenset((a, b)) not in said and (low << 16) + high not in apart:
                yield a, b


def _told(model: Any, fixed: int, moving: int, kind: str) -> bool:
    """Whether a contact has such a number at all, and one that a ratio changes."""
    if kind == REACH:
        mj = mujoco()
        ball = int(model.geom_type[moving]) == int(mj.mjtGeom.mjGEOM_SPHERE)
        # Of one that lies where a frame of its body does MuJoCo does not look at its place.
        frames = (int(mj.mjtSameFrame.mjSAMEFRAME_BODY), int(mj.mjtSameFrame.mjSAMEFRAME_INERTIA))
        return ball and int(model.geom_sameframe[moving]) not in frames
    first = model.geom_priority[[fixed, moving]].max()
    decide = [g for g in (fixed, moving) if model.geom_priority[g] == first]
    if kind == SOLREF:  # negative ones are a stiffness and a damping
        return bool((model.geom_solref[decide] > 0.0).all())
    return bool(model.geom_condim[decide].max() >= RUBS and model.geom_friction[decide, 0].max() > 0.0)


def _decider(model: Any, fixed: int, moving: int, kind: str) -> int:
    """Which of two geoms has a contact's number: by priority, the rougher one, else what stands still."""
    priority, friction = model.geom_priority, model.geom_friction[:, 0]
    rougher = kind == FRICTION and friction[moving] > friction[fixed]
    return moving if (priority[moving], rougher) > (priority[fixed], False) else fixed


def _friction(model: Any, geom: int, name: str, led: list[int]) -> tuple[Parameter, Knob]:
    """Sliding friction: of the others none may be rougher."""
    value = float(model.geom_friction[geom, 0])

    def write(fields: Written, friction: FloatArray) -> None:
        own = fields["geom_friction"]
        own[:, geom, 0] = friction
        own[:, led, 0] = np.minimum(own[:, led, 0], friction[:, None])

    text = f"sliding friction of contacts with the geom {name}"
    return Parameter("1", value, value / HEAVIEST, HEAVIEST * value, text), Knob(("geom_friction",), write)


def _reach(model: Any, geom: int, name: str, led: list[int]) -> tuple[Parameter, Knob]:
    """How far a foot is from the frame of its body, in the direction in which it is: longer or shorter shanks."""
    value = float(np.linalg.norm(model.geom_pos[geom]))
    text = f"distance of the foot {name} from its body's frame"
    declared = Parameter("m", value, value / FURTHEST, FURTHEST * value, text)
    return declared, scale_knob(value, ("geom_pos", ([geom],)))


def _solref(model: Any, geom: int, name: str, led: list[int]) -> tuple[Parameter, Knob]:
    """The time constant of contacts: of the geom and of the others by one ratio, by which their mean changes, too."""
    value = float(model.geom_solref[geom, 0])
    least = min(value, max(value / HEAVIEST, SAFE * float(model.opt.timestep)))
    text = f"time constant of contacts with the geom {name} (longer is softer)"
    declared = Parameter("s", value, least, HEAVIEST * value, text)
    return declared, scale_knob(value, ("geom_solref", ([geom, *led], 0)))
