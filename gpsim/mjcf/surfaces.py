"""What moving bodies stand on: friction and stiffness of contacts, each a parameter of the geom that decides it.

MuJoCo makes a contact's numbers of two geoms: the one of higher priority alone, else the larger friction and a mean of
the time constants (Todorov 2014; MuJoCo's documentation, Contact parameters). A parameter of a geom is therefore what
its contacts have: the other geom is written along where it would decide otherwise. Told are contacts of what moves
with what is fixed to the world; explicit pairs have numbers of their own, and none of them is a parameter.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from gpsim.channels import FloatArray
from gpsim.mjcf.knobs import HEAVIEST, Knob
from gpsim.mjcf.naming import Names
from gpsim.mjcf.optional import mujoco
from gpsim.recordings import check_name
from gpsim.simulators import Parameter

RUBS = 3  # condim of a contact from which on it has friction
SAFE = 2.0  # steps: MuJoCo takes a shorter time constant for one so long
FRICTION, SOLREF = "friction", "solref"


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

    Raises UsageError where a name cannot be used; where: whose model it is.
    """
    called = _called(model, names)
    pairs = list(_pairs(model))
    found = []
    for kind in (FRICTION, SOLREF):
        others: dict[int, set[int]] = defaultdict(set)
        for fixed, moving in pairs:
            if _told(model, fixed, moving, kind):
                decides = _decider(model, fixed, moving, kind)
                others[decides].add(moving if decides == fixed else fixed)
        make = _friction if kind == FRICTION else _solref
        for geom in sorted(others):
            check_name(called[geom], f"{where}: geom number {geom}")
            met = frozenset(others[geom])
            declared, knob = make(model, geom, called[geom], _led(model, geom, met))
            found.append(Surface(geom, called[geom], kind, met, declared, knob))
    return tuple(found)


def surface_names(surfaces: tuple[Surface, ...]) -> dict[int, str]:
    """What the geoms are called that are a parameter's."""
    return {s.geom: s.name for s in surfaces}


def touched(surfaces: tuple[Surface, ...], pairs: frozenset[frozenset[int]]) -> frozenset[str]:
    """The parameters of surfaces of which something touches, by pairs of geoms that do."""
    return frozenset(
        s.parameter for s in surfaces if any(frozenset((s.geom, other)) in pairs for other in s.others)
    )


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
    both = [fixed, moving]
    priority = model.geom_priority[both]
    decide = both if priority[0] == priority[1] else [both[int(np.argmax(priority))]]
    if kind == SOLREF:  # negative ones are a stiffness and a damping
        return bool((model.geom_solref[decide] > 0.0).all())
    return bool(model.geom_condim[decide].max() >= RUBS and model.geom_friction[decide, 0].max() > 0.0)


def _decider(model: Any, fixed: int, moving: int, kind: str) -> int:
    """Which of two geoms has a contact's number: by priority, the rougher one, else what stands still."""
    priority, friction = model.geom_priority, model.geom_friction[:, 0]
    if priority[fixed] != priority[moving]:
        return fixed if priority[fixed] > priority[moving] else moving
    return moving if kind == FRICTION and friction[moving] > friction[fixed] else fixed


def _led(model: Any, geom: int, others: frozenset[int]) -> list[int]:
    """Those of the others that have a say beside the geom that decides."""
    return [g for g in sorted(others) if model.geom_priority[g] == model.geom_priority[geom]]


def _friction(model: Any, geom: int, name: str, led: list[int]) -> tuple[Parameter, Knob]:
    """Sliding friction: of the others none may be rougher."""
    value = float(model.geom_friction[geom, 0])

    def write(fields: Mapping[str, FloatArray], friction: FloatArray) -> None:
        own = fields["geom_friction"]
        own[:, geom, 0] = friction
        own[:, led, 0] = np.minimum(own[:, led, 0], friction[:, None])

    text = f"sliding friction of what touches the geom {name}"
    return Parameter("1", value, value / HEAVIEST, HEAVIEST * value, text), Knob(("geom_friction",), write)


def _solref(model: Any, geom: int, name: str, led: list[int]) -> tuple[Parameter, Knob]:
    """The time constant of contacts: of the geom and of the others by one ratio, by which their mean changes, too."""
    value, every = float(model.geom_solref[geom, 0]), [geom, *led]
    least = min(value, max(value / HEAVIEST, SAFE * float(model.opt.timestep)))

    def write(fields: Mapping[str, FloatArray], constant: FloatArray) -> None:
        fields["geom_solref"][:, every, 0] *= (constant / value)[:, None]

    text = f"time constant of contacts with the geom {name}: the longer, the softer"
    return Parameter("s", value, least, HEAVIEST * value, text), Knob(("geom_solref",), write)
