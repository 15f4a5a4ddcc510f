"""What a person states: limits of commands and their rates, a box for the states, where it rests, and settings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gpsim.channels import BoolArray, Channels, FloatArray
from gpsim.errors import UsageError
from gpsim.posterior import Visited
from gpsim.simulators import Simulator

STATED = ("commands", "rates", "box", "rest", "rest_commands")


@dataclass(frozen=True)
class PlanSettings:
    """Weights multiply nats; `probability` and `margin` say what safe means."""

    separation: float = 1.0
    precision: float = 0.1
    novelty: float = 0.02
    enough: float = 10.0
    visible: float = 2.3
    piece: float = 8.0
    settle: float = 3.0
    returns: float = 0.15
    margin: float = 0.1
    probability: float = 0.99
    draws: int = 6
    checked: int = 240
    candidates: int = 40
    best: int = 6
    rounds: int = 2
    slowest: float = 0.1
    fastest: float = 0.4

    def __post_init__(self) -> None:
        for name in ("piece", "enough", "visible", "slowest", "fastest", "returns"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"{name} must be more than 0, got {getattr(self, name):g}")
        for name in ("separation", "precision", "novelty", "settle"):
            if getattr(self, name) < 0.0:
                raise ValueError(f"{name} must be at least 0, got {getattr(self, name):g}")
        for name in ("margin", "probability"):
            if not 0.0 <= getattr(self, name) < 1.0:
                raise ValueError(f"{name} must be in [0, 1), got {getattr(self, name):g}")
        for name, least in (("draws", 1), ("checked", 1), ("candidates", 1), ("best", 1), ("rounds", 0)):
            if getattr(self, name) < least:
                raise ValueError(f"{name} must be at least {least}, got {getattr(self, name)}")
        if self.fastest > 0.5:
            raise ValueError(f"fastest must be at most 0.5 of the rate of commands, got {self.fastest:g}")


@dataclass(frozen=True)
class Limits:
    """low, high, rate [1/s], idle: (A,) of commands; box_low, box_high, rest: (S,) of states, in the channels' units.

    comes_back: (S,) the states that have to be near `rest` again after each piece.
    """

    low: FloatArray
    high: FloatArray
    rate: FloatArray
    idle: FloatArray
    box_low: FloatArray
    box_high: FloatArray
    rest: FloatArray
    comes_back: BoolArray

    @property
    def reach(self) -> FloatArray:
        """(S,) half the width of the box."""
        return (self.box_high - self.box_low) / 2.0

    def inside(self, states: FloatArray, margin: float) -> BoolArray:
        """(...,) whether states (..., S) are in the box, which is smaller by that share of its width at each side."""
        low, high = _less(self.box_low, self.box_high, margin)
        return np.asarray(((states >= low) & (states <= high)).all(axis=-1))

    def back(self, states: FloatArray, share: float) -> BoolArray:
        """(...,) whether states (..., S) are within that share of the box's half width of where the machine rests."""
        near = np.abs(states - self.rest) <= share * self.reach
        return np.asarray((near | ~self.comes_back).all(axis=-1))

    def held(self, commands: FloatArray, dt: float) -> FloatArray:
        """(..., L, A): the commands within their limits and rates; they begin at the idle ones."""
        wanted, out = np.clip(commands, self.low, self.high), np.empty_like(commands)
        last, step = np.broadcast_to(self.idle, wanted[..., 0, :].shape), self.rate * dt
        for k in range(wanted.shape[-2]):
            last = np.clip(wanted[..., k, :], last - step, last + step)
            out[..., k, :] = last
        return out


def _less(low: FloatArray, high: FloatArray, margin: float) -> tuple[FloatArray, FloatArray]:
    """A box that is smaller by that share of its width at each side; what has no edge keeps none."""
    edge = margin * np.where(np.isfinite(high - low), high - low, 0.0)
    return low + edge, high - edge


def limits_of(
    stated: Mapping[str, Any], simulator: Simulator, visited: Visited, margin: float = 0.0
) -> Limits:
    """Limits as stated; what nobody states is as large as it was in the recording. Raises UsageError.

    margin: of the box. A recording may begin at the edge of its own range: where neither box nor rest are stated, the
    machine rests as near to that as the margin allows.
    """
    strange = sorted(set(stated) - set(STATED))
    if strange:
        raise UsageError(f"plan.{strange[0]}: no limit of this name; valid names: {', '.join(STATED)}")
    state, action = simulator.state, simulator.action
    low, high = _pairs(stated, "commands", action, (visited.action_low, visited.action_high))
    rate = _numbers(stated, "rates", action, np.full(len(action), np.inf))
    own = np.array([n in (stated.get("commands") or {}) for n in action.names])
    idle = _numbers(stated, "rest_commands", action, np.where(own, 0.0, np.clip(0.0, low, high)))
    # An angle goes round, and no edge holds it.
    known = np.isfinite(visited.state_low) & ~np.array(state.wraps)
    edges = ((visited.state_low, -np.inf), (visited.state_high, np.inf))
    usual = [np.where(known, edge, far) for edge, far in edges]
    box_low, box_high = _pairs(stated, "box", state, (usual[0], usual[1]))
    speeds = {c.velocity for c in simulator.coordinates}
    guess = np.where(np.isfinite(visited.start), visited.start, 0.0)
    usual_box = np.array([n not in (stated.get("box") or {}) for n in state.names])
    guess = np.where(usual_box, np.clip(guess, *_less(box_low, box_high, margin)), guess)
    rest = _numbers(stated, "rest", state, np.where([n in speeds for n in state.names], 0.0, guess))
    named = {n for c in simulator.coordinates for n in (c.name, c.velocity)} | set(stated.get("rest") or {})
    comes_back = np.array([n in named for n in state.names]) & np.isfinite(box_high - box_low)
    made = Limits(low, high, rate, idle, box_low, box_high, rest, comes_back)
    _check(made, state, action)
    return made


def _check(limits: Limits, state: Channels, action: Channels) -> None:
    for i, name in enumerate(action.names):
        where = f"plan.commands.{name}: [{limits.low[i]:g}, {limits.high[i]:g}]"
        if not limits.low[i] < limits.high[i]:
            raise UsageError(f"{where} leaves no possible command; give a range")
        if not limits.low[i] <= limits.idle[i] <= limits.high[i]:
            raise UsageError(
                f"{where} excludes the command at rest, {limits.idle[i]:g}; widen it, or set plan.rest_commands"
            )
        if not limits.rate[i] > 0.0:
            raise UsageError(f"plan.rates.{name}: expected more than 0 per second, got {limits.rate[i]:g}")
    for name, low, high in zip(state.names, limits.box_low, limits.box_high, strict=True):
        if not low < high:
            raise UsageError(f"plan.box.{name}: [{low:g}, {high:g}] is empty; give a range")


def check_first(limits: Limits, state: Channels, margin: float) -> None:
    """Raise UsageError where the state at rest, in which a plan begins, is out of the box or nearly so."""
    if limits.inside(limits.rest, margin):
        return
    middle = (limits.box_low + limits.box_high) / 2.0
    for i, name in enumerate(state.names):
        only = np.where(np.arange(len(limits.rest)) == i, limits.rest, middle)
        if not limits.inside(np.where(np.isfinite(only), only, 0.0), margin):
            raise UsageError(
                f"plan.box.{name}: [{limits.box_low[i]:g}, {limits.box_high[i]:g}] minus its margin of {margin:.0%} "
                f"does not contain the first state, {limits.rest[i]:g}; widen it, or set plan.rest"
            )


def _numbers(stated: Mapping[str, Any], key: str, channels: Channels, usual: FloatArray) -> FloatArray:
    """(C,) a number a channel."""
    out = np.array(usual, dtype=np.float64)
    for i, value in _given(stated, key, channels):
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise UsageError(f"plan.{key}.{channels.names[i]}: expected a number, got {value!r}")
        out[i] = float(value)
    return out


def _pairs(
    stated: Mapping[str, Any], key: str, channels: Channels, usual: tuple[FloatArray, FloatArray]
) -> tuple[FloatArray, FloatArray]:
    """Two (C,): the ends of a range a channel."""
    low, high = (np.array(end, dtype=np.float64) for end in usual)
    for i, value in _given(stated, key, channels):
        where = f"plan.{key}.{channels.names[i]}"
        if not isinstance(value, Sequence) or len(value) != 2 or isinstance(value, str):
            raise UsageError(f"{where}: expected [low, high], got {value!r}")
        if not all(isinstance(v, int | float) and not isinstance(v, bool) for v in value):
            raise UsageError(f"{where}: expected two numbers, got {value!r}")
        low[i], high[i] = map(float, value)
    return low, high


def _given(stated: Mapping[str, Any], key: str, channels: Channels) -> list[tuple[int, Any]]:
    content = stated.get(key) or {}
    if not isinstance(content, Mapping):
        raise UsageError(
            f"plan.{key}: expected channels, as plan.{key}={{{channels.names[0]}: ...}}, got {content!r}"
        )
    for name in content:
        if name not in channels.names:
            raise UsageError(f"plan.{key}: no channel '{name}'; there are: {channels.listed()}")
    return [(channels.names.index(name), value) for name, value in content.items()]
