"""What becomes of commands: gain, bias, range and delay are the motor's where MJCF can say so, else the wrapper's."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

from gpsim.effects import ActuatorEffect, ElasticDrive, ForceEffect, Term
from gpsim.mjcf.body import Body
from gpsim.mjcf.motors import plain_drive
from gpsim.mjcf.optional import mujoco

AFFINE = ("actuator_gain", "actuator_bias")
"""What MJCF's gain and bias can say, at the end of the way."""
Placed = tuple[Term, Literal["attribute", "wrapper"], str]


@dataclass(frozen=True)
class Motor:
    """An actuator that acts otherwise: force = scale * gain * command + gain * more + bias; limit, delay: if any."""

    index: int
    scale: float = 1.0
    more: float = 0.0
    limit: float | None = None
    delay: float | None = None


def motors_of(
    body: Body, names: Sequence[str], terms: Sequence[Term], step: float
) -> tuple[list[Motor], dict[str, list[dict[str, Any]]], list[Placed]]:
    """The actuators that MJCF can correct, what the wrapper does to commands, and what went where.

    Gain and bias at the end of the way are the motor's own; a limit or a delay before them, if nothing else acts and
    no friction asks what the motor gives. Nothing is where a spring is between motor and joint.
    """
    motors: list[Motor] = []
    commands: dict[str, list[dict[str, Any]]] = {}
    went: list[Placed] = []
    loaded = any(isinstance(t.effect, ForceEffect) and t.effect.loaded_by_command for t in terms)
    elastic = {t.on for t in terms if isinstance(t.effect, ElasticDrive)}
    for index, name in enumerate(names):
        own = [t for t in terms if t.on == name and isinstance(t.effect, ActuatorEffect)]
        way = sorted(own, key=lambda t: t.effect.order)
        if not way:
            continue
        native = 0 if name in elastic else _native_tail(body, index, way, None if loaded else step)
        wrapped, tail = way[: len(way) - native], way[len(way) - native :]
        if tail:
            motors.append(_motor(index, tail))
        if wrapped:
            commands[actuator_name(body, name)] = [_told(t) for t in wrapped]
        went += [(t, "wrapper", _why(t)) for t in wrapped]
        went += [(t, "attribute", "") for t in tail]
    return motors, commands, went


def actuator_name(body: Body, action: str) -> str:
    """What an action's actuator is called in the model."""
    index = body.names.action.index(action)
    return str(body.base.actuator(index).name) or f"actuator{index}"


def _native_tail(body: Body, index: int, way: Sequence[Term], step: float | None) -> int:
    """How many effects at the end of a command's way MJCF can say; step None: neither limits nor delays."""
    model = body.base
    plain = plain_drive(model, index)
    count = 0
    while plain and count < len(way) and way[-1 - count].family in AFFINE and not way[-1 - count].gate.region:
        count += 1
    left = way[: len(way) - count]
    alone = plain and len(left) == 1 and not left[0].gate.region
    if (
        step is not None
        and alone
        and (left[0].family == "actuator_saturation" or _delays(body, left[0], step))
    ):
        count += 1
    return count


def _delays(body: Body, term: Term, step: float) -> bool:
    """Whether MuJoCo delays as gpsim does: no less than a step, and not where its steps look at commands in between."""
    between = int(body.base.opt.integrator) == mujoco().mjtIntegrator.mjINT_RK4
    return term.family == "actuator_delay" and term.values["delay"] >= step and not between


def _motor(index: int, tail: Sequence[Term]) -> Motor:
    scale, more, limit, delay = 1.0, 0.0, None, None
    for term in tail:
        if term.family == "actuator_gain":
            scale, more = scale * term.values["gain"], more * term.values["gain"]
        elif term.family == "actuator_bias":
            more += term.values["bias"]
        elif term.family == "actuator_saturation":
            limit = term.values["limit"]
        else:
            delay = term.values["delay"]
    return Motor(index, scale, more, limit, delay)


def _told(term: Term) -> dict[str, Any]:
    region = {name: [float(low), float(high)] for name, (low, high) in term.gate.region.items()}
    return {"family": term.family, "values": {k: float(v) for k, v in term.values.items()}, "region": region}


def _why(term: Term) -> str:
    if term.gate.region:
        return "acts in a region only"
    if term.family == "actuator_lag":
        return "MuJoCo's own filter acts a step later"
    if term.family == "actuator_delay":
        return "MuJoCo delays by whole steps here, or beside nothing else"
    if term.family in (*AFFINE, "actuator_saturation"):
        return "something else that MJCF cannot say acts after it, or with it"
    return "MJCF has no attribute for it"


def samples(delay: float, step: float) -> int:
    """How many commands MuJoCo must remember for a delay [s]: too few shorten it silently."""
    return math.ceil(delay / step) + 3
