"""Which systems, laws and curves have a compiled form, and under which number."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from gpsim.effects import (
    CATALOGUE,
    ActuatorEffect,
    DriveEffect,
    Effect,
    ForceEffect,
    LateEffect,
    Law,
    ParameterEffect,
    VehicleEffect,
    arguments,
)
from gpsim.kernels import codes
from gpsim.simulators import Ackermann, CartPole, Pendulum, ServoJoint, Simulator, Slider, Unicycle

SYSTEMS: Mapping[type[Simulator], int] = {
    CartPole: codes.CARTPOLE,
    Pendulum: codes.PENDULUM,
    Slider: codes.SLIDER,
    Unicycle: codes.UNICYCLE,
    Ackermann: codes.ACKERMANN,
    ServoJoint: codes.SERVO_JOINT,
}
CURVES: Mapping[str, int] = {
    "force": codes.FORCE_CURVE,
    "grip": codes.GRIP_CURVE,
    "turn": codes.TURN_CURVE,
    "slip": codes.SLIP_CURVE,
    "rate": codes.RATE_CURVE,
    "drive": codes.DRIVE_CURVE,
}
KINDS: Mapping[Any, int] = {
    LateEffect: codes.LATE,
    ActuatorEffect: codes.PASSES,
    DriveEffect: codes.GIVES,
    ParameterEffect: codes.BELIEVED,
    VehicleEffect: codes.TURNS,
}


@dataclass(frozen=True)
class Formula:
    """A law of the catalogue. number: its kind, in hundreds, and its place there; values: with what each is if missing.

    effect: of which it is, which says what it knows and remembers.
    """

    number: int
    law: Law
    values: Mapping[str, float]
    effect: Effect


def _laws() -> Iterator[tuple[int, Law, Effect]]:
    """Kind, law and family of all that compiled code takes from the catalogue."""
    for effect in CATALOGUE.values():
        named = {"": type(effect).law, **{v: getattr(type(effect), name) for v, name in effect.laws.items()}}
        for value, law in named.items():
            kind = next((code for site, code in KINDS.items() if isinstance(effect, site)), None)
            if isinstance(effect, ForceEffect):
                dry = codes.LOADED if effect.loaded_by_command else codes.GRIPS
                dry = codes.WEIGHED if law is not None and effect.weighs({value: 0.0}) else dry
                kind = dry if effect.dry else codes.PUSHES
            if kind is not None and law is not None:
                yield kind, law, effect


def _numbered() -> dict[Law, Formula]:
    found: dict[Law, Formula] = {}
    for kind, law, effect in _laws():
        if law not in found:  # families may share one
            number = kind + sum(
                one.number // codes.KIND_WIDTH * codes.KIND_WIDTH == kind for one in found.values()
            )
            known = {*effect.inputs, *effect.memory}
            values = {n: np.nan if v is None else v for n, v in arguments(law).items() if n not in known}
            found[law] = Formula(number, law, values, effect)
    return found


LAWS: Mapping[Law, Formula] = _numbered()


def of_kind(*kinds: int) -> list[Formula]:
    """The laws of these kinds."""
    return [one for one in LAWS.values() if one.number // codes.KIND_WIDTH * codes.KIND_WIDTH in kinds]


@dataclass(frozen=True)
class Hat:
    """A gate that opens and closes gradually along a channel: 1 at the knot of a place, 0 at its neighbours."""

    along: str
    knots: tuple[float, ...]
    place: int
