"""A term: one effect at one place with its parameter values, and the gate that limits it in space or time.

Where several recordings of one machine are judged together, a value that all share has its parameter's name. One that
belongs to recording k alone is called `name@k` and stands in the place of the shared one there: a sensor's offset on
one day, a payload in one log.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Any, Final

import numpy as np

from gpsim.channels import Channels, FloatArray, IntArray
from gpsim.effects.effect import Effect, Values
from gpsim.effects.registry import effect_of
from gpsim.errors import UsageError

OWN = "@"
FROM, TO, IN_EPISODE = "from", "to", "episode"
"""Values that a search gives every row beside a law's own: edges of its gate, and which episode it is in."""


def own_name(name: str, recording: int) -> str:
    """What a recording's own value of a parameter is called."""
    return f"{name}{OWN}{recording}"


def base_name(name: str) -> str:
    """The parameter's name, whoever's value it is."""
    return name.partition(OWN)[0]


def owner_of(name: str) -> int | None:
    """The recording whose own a value is; None of one that is shared."""
    owner = name.partition(OWN)[2]
    return int(owner) if owner else None


def own_values(values: Values, recordings: IntArray | None) -> Values:
    """(B,) values by name as they are in the recording of each row (B,); None: in one without any of its own."""
    out = {name: value for name, value in values.items() if owner_of(name) is None}
    for name, value in values.items():
        owner = owner_of(name)
        if owner is not None and recordings is not None:
            base = base_name(name)
            out[base] = np.where(recordings == owner, value, out[base])
    return out


class Moment(Enum):
    """What a gate may look at that is no channel, whatever channels are called: which episode it is."""

    EPISODE = "episode"


EPISODE: Final = Moment.EPISODE
LooksAt = str | Moment | None
"""A channel's name, `EPISODE`, or None for time."""


@dataclass(frozen=True)
class Gate:
    """Where and when an effect acts: intervals of channels (state or action), moments [s] of the recording's clock.

    since_episode: the first episode (from 0) in which it acts; what is not one of a recording comes after them all.
    """

    region: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    since: float | None = None
    until: float | None = None
    since_episode: int | None = None

    def __bool__(self) -> bool:
        return bool(self.region) or self.since is not None or self.since_episode is not None

    @property
    def looks_at(self) -> LooksAt:
        """The channel whose region it is; `EPISODE`, or None for time."""
        return next(iter(self.region), None if self.since_episode is None else EPISODE)

    @property
    def opened(self) -> Gate:
        """What is left of it once everything has begun."""
        return Gate(region=self.region)

    def share(
        self,
        path: tuple[FloatArray, FloatArray],
        action: FloatArray,
        t: FloatArray,
        step: FloatArray,
        channels: Channels,
        values: Values,
    ) -> FloatArray:
        """The share in [0, 1] of the time from `t` (...) to t + step (...) in which it acts.

        path: the states (..., S) at both ends of that time, a straight line between them; `channels` are the columns of
        state and action (..., A). step: 0 asks about the moment t; negative where time runs backwards. values: a
        search gives every row of the batch edges of its own as the values FROM and TO.
        """
        share = np.ones(t.shape)
        for name, (low, high) in self.region.items():
            column = channels.index(name)
            width = path[0].shape[-1]
            begin, end = (s[..., column] if column < width else action[..., column - width] for s in path)
            edges = values.get(FROM, low), values.get(TO, high)
            if channels.wraps[column]:
                begin, end = _nearest_turn(begin, end, *edges)
            share *= _between(begin, end, *edges)
        if self.since is not None:
            share *= _after(values.get(FROM, self.since), t, step)
        if self.until is not None:
            share *= 1.0 - _after(values.get(TO, self.until), t, step)
        if self.since_episode is not None:
            share *= np.asarray(values.get(IN_EPISODE, np.inf)) >= self.since_episode
        return share


def _nearest_turn(
    begin: FloatArray, end: FloatArray, low: FloatArray | float, high: FloatArray | float
) -> tuple[FloatArray, FloatArray]:
    """An angle that has run on, in the turn in which it is nearest to [low, high]; edges are known modulo 2 pi."""
    turns = 2.0 * np.pi * np.round((begin - 0.5 * (low + high)) / (2.0 * np.pi))
    return np.asarray(begin - turns), np.asarray(end - turns)


def _between(
    begin: FloatArray, end: FloatArray, low: FloatArray | float, high: FloatArray | float
) -> FloatArray:
    """The share of the way from begin to end that lies in [low, high]."""
    left, right = np.minimum(begin, end), np.maximum(begin, end)
    way = right - left
    moving = way > 0
    inside = np.minimum(right, high) - np.maximum(left, low)
    if moving.all():  # as nearly always
        return np.asarray(np.minimum(np.maximum(inside / way, 0.0), 1.0))
    share = np.minimum(np.maximum(inside / np.where(moving, way, 1.0), 0.0), 1.0)
    return np.asarray(np.where(moving, share, (begin >= low) & (begin <= high)))


def _after(moment: FloatArray | float, t: FloatArray, step: FloatArray) -> FloatArray:
    """The share of the time from t to t + step that lies after `moment`."""
    size = np.abs(step)
    late = np.maximum(t, t + step) - moment
    return np.asarray(np.where(size > 0, np.clip(late / np.where(size > 0, size, 1.0), 0.0, 1.0), late >= 0))


@dataclass(frozen=True)
class Term:
    """One effect on `on` with parameter values; `variant` names the law where a family has several.

    Some values may be one recording's own, where several are judged together: see this file. also: further
    actions on which it acts alike: commands over one bus come equally late.
    """

    family: str
    on: str
    values: Mapping[str, float] = field(default_factory=dict)
    gate: Gate = field(default_factory=Gate)
    variant: str = ""
    also: tuple[str, ...] = field(default=(), kw_only=True)

    @property
    def places(self) -> tuple[str, ...]:
        """Everything that it acts on."""
        return self.on, *self.also

    @property
    def apart(self) -> tuple[Term, ...]:
        """The same, a term for each place."""
        return tuple(replace(self, on=on, also=()) for on in self.places)

    @property
    def effect(self) -> Effect:
        """The family's law; of a measured curve with the term's own shape."""
        return effect_of(self.family).of_term(self.values, self.variant)

    @property
    def identity(self) -> tuple[str, str]:
        """What it claims, whatever the numbers: family and place."""
        return self.family, self.on

    @property
    def owners(self) -> tuple[int, ...]:
        """The recordings that have values of their own."""
        found = {owner_of(name) for name in self.values}
        return tuple(sorted(owner for owner in found if owner is not None))

    def in_recording(self, recording: int | None) -> Term:
        """The term as it acts in one of several recordings; None: in one that has no values of its own."""
        if not self.owners:
            return self
        of = None if recording is None else np.array([recording])
        values = own_values({name: np.array([value]) for name, value in self.values.items()}, of)
        return replace(self, values={name: float(value[0]) for name, value in values.items()})


def to_json(term: Term) -> dict[str, Any]:
    """Plain data."""
    return {
        "family": term.family,
        "on": term.on,
        "variant": term.variant,
        "values": {k: float(v) for k, v in term.values.items()},
        "region": {k: [float(low), float(high)] for k, (low, high) in term.gate.region.items()},
        "since": term.gate.since,
        "since_episode": term.gate.since_episode,
    } | ({"also": list(term.also)} if term.also else {})


def from_json(data: Mapping[str, Any]) -> Term:
    """The inverse of `to_json`; raises UsageError."""
    try:
        region = {str(k): (float(v[0]), float(v[1])) for k, v in data["region"].items()}
        since = None if data["since"] is None else float(data["since"])
        episode = data.get("since_episode")  # earlier versions knew none
        gate = Gate(region, since, since_episode=None if episode is None else int(episode))
        values = {str(k): float(v) for k, v in data["values"].items()}
        also = tuple(str(on) for on in data.get("also", ()))
        term = Term(str(data["family"]), str(data["on"]), values, gate, str(data["variant"]), also=also)
    except (KeyError, TypeError, ValueError, IndexError) as error:
        raise UsageError(
            f"an effect needs family, on, variant, values, region and since, got {data!r}"
        ) from error
    effect_of(term.family)
    return term
