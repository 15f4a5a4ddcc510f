"""An effect tried on made-up batches: what `gpsim effects check` asks of a law before any recording is there."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gpsim.channels import FloatArray
from gpsim.effects.brought import own_effect, read_effects
from gpsim.effects.effect import (
    ActuatorEffect,
    DriveEffect,
    Effect,
    ForceEffect,
    ParameterEffect,
    SensorEffect,
    Values,
    VehicleEffect,
)
from gpsim.effects.place import EffectParameter, Place
from gpsim.errors import UsageError
from gpsim.simulators import Memory

ROWS, STEPS, STEP = 33, 12, 0.01
CLOSE = 1e-9  # relative: what one row and a batch may differ by, and what is nothing


@dataclass(frozen=True)
class Check:
    """One question, and what is wrong ("" where nothing is)."""

    question: str
    wrong: str


PLACE = Place("q", "1", reach=2.0, bounds=(0.2, 5.0), loaded=True)
"""Where a law is tried."""


def check(given: Any) -> list[Check]:
    """Every check of a class or an object of the caller's, or of a file's one effect (`FILE.py:Class`)."""
    (one,) = read_effects(given) if isinstance(given, str) else (own_effect(given),)
    return list(tried(one.effect, PLACE, np.random.default_rng(0)))


def tried(effect: Effect, place: Place, rng: np.random.Generator) -> Iterator[Check]:
    """Every check of a law at a place, in order; a law that raises or gives another shape is a UsageError at once."""
    declared = effect.parameters(place)
    inputs, ask = _asked(effect, rng)
    drawn = _drawn(declared, rng, ROWS)
    whole = ask(inputs, drawn)
    yield Check("shapes", "")  # another shape has raised
    yield Check("finite", _finite(effect, declared, inputs, ask))
    nothing = {p.name: np.full(ROWS, 1e6 * max(abs(p.high), 1.0) if p.falls else p.none) for p in declared}
    before = _identity(effect, inputs)
    yield Check(
        "nothing at neutral parameters", _differs(ask(inputs, nothing), before, "it still does something")
    )
    rows = [
        ask([i[k : k + 1] for i in inputs], {n: v[k : k + 1] for n, v in drawn.items()}) for k in range(ROWS)
    ]
    loop = [np.concatenate([row[part] for row in rows]) for part in range(len(whole))]
    yield Check("batch = loop", _differs(whole, loop, "a row depends on other rows of the batch"))
    yield Check("memory resets", _differs(ask(inputs, drawn), whole, "a second run from the start differs"))


Ask = Callable[[Sequence[FloatArray], Values], list[FloatArray]]
"""ask(inputs, values): what a law makes of a batch, begun anew."""


def _asked(effect: Effect, rng: np.random.Generator) -> tuple[list[FloatArray], Ask]:
    """Inputs of a batch, at rest and of either sign among them, and how the law is asked."""
    one, two, three = (_some(rng) for _ in range(3))
    if isinstance(effect, ForceEffect):
        return [one, two], lambda inputs, values: [_force(effect, inputs, values)]
    if isinstance(effect, DriveEffect):
        return [one, two], lambda inputs, values: [effect.delivered(inputs[0], inputs[1], values)]
    if isinstance(effect, ParameterEffect):
        return [np.abs(one) + 0.1], lambda inputs, values: [effect.corrected(inputs[0], values)]
    if isinstance(effect, VehicleEffect):
        return [one, two, three], lambda inputs, values: list(
            effect.twist(inputs[0], inputs[1], inputs[2], values)
        )
    if isinstance(effect, SensorEffect):
        return [one], lambda inputs, values: [_measured(effect, inputs[0], values)]
    if isinstance(effect, ActuatorEffect):
        commands = np.stack([_some(rng) for _ in range(STEPS)], axis=1)
        return [commands], lambda inputs, values: [_actuated(effect, inputs[0], values)]
    raise UsageError(f"{effect.family}: a law at the site {effect.site} cannot be tested alone")


def _force(effect: ForceEffect, inputs: Sequence[FloatArray], values: Values) -> FloatArray:
    position, speed = inputs
    found = (
        effect.friction_limit(position, speed, values, None)
        if effect.dry
        else effect.force(position, speed, values)
    )
    assert found is not None
    return found


def _measured(effect: SensorEffect, reading: FloatArray, values: Values) -> FloatArray:
    step = np.full(len(reading), STEP)
    return effect.measure(reading[:, None], (0,), values, {}, step)[:, 0]


def _actuated(effect: ActuatorEffect, commands: FloatArray, values: Values) -> FloatArray:
    """(B, K) what becomes of commands (B, K), from rest."""
    count, times = commands.shape
    memory: Memory = effect.begin(count, 0.5, STEP)
    column = {name: value[:, None] for name, value in values.items()}
    step = np.full(commands.shape, STEP)
    return effect.actuate(commands.copy(), column, memory, step, step * np.arange(times))


def _some(rng: np.random.Generator) -> FloatArray:
    """(B,) of either sign, some of them 0."""
    out = rng.normal(size=ROWS)
    out[:3] = 0.0, -1.0, 1.0
    return np.asarray(out)


def _drawn(declared: Sequence[EffectParameter], rng: np.random.Generator, rows: int) -> dict[str, FloatArray]:
    """(B,) values about where a fit starts, within the bounds."""
    return {
        p.name: np.clip(p.starts[0] + 0.3 * p.scale * rng.uniform(-1, 1, rows), p.low, p.high)
        for p in declared
    }


def _finite(
    effect: Effect, declared: Sequence[EffectParameter], inputs: Sequence[FloatArray], ask: Ask
) -> str:
    """At the ends of the bounds, too."""
    for p in declared:
        for end in (p.low, p.high):
            values = {o.name: np.full(ROWS, end if o is p else o.starts[0]) for o in declared}
            with np.errstate(all="ignore"):
                said = ask(inputs, values)
            if not all(np.isfinite(part).all() for part in said):
                return f"not finite at {p.name} = {end:g}: correct the formula or its bounds"
    return ""


def _identity(effect: Effect, inputs: Sequence[FloatArray]) -> list[FloatArray]:
    """What is where the effect does nothing."""
    if isinstance(effect, ForceEffect):
        return [np.zeros(ROWS)]
    if isinstance(effect, VehicleEffect):
        return list(inputs)
    return [inputs[0]]


def _differs(said: Sequence[FloatArray], expected: Sequence[FloatArray], why: str) -> str:
    """Empty where both are the same."""
    for one, other in zip(said, expected, strict=True):
        size = max(float(np.abs(other).max(initial=0.0)), 1.0)
        gap = float(np.abs(one - other).max(initial=0.0))
        if not gap <= CLOSE * size:
            return f"{why} (by {gap:.3g})"
    return ""
