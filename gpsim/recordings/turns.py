"""Angles that wrap and are not said to: a step of a whole turn from one row to the next."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gpsim.channels import BoolArray, FloatArray, IntArray
from gpsim.errors import UsageError
from gpsim.recordings import episodes as where
from gpsim.recordings.assembling import Assembled
from gpsim.recordings.clock import TOLERANCE
from gpsim.recordings.mapping import ChannelSource, ImportMapping
from gpsim.recordings.sources import Part
from gpsim.recordings.tracks import samples

TURN = 2.0 * np.pi
NEAR = 0.1  # a step this near to a turn, as a share of it
ONE_TURN = 1.01 * TURN  # an angle that never leaves so wide a range, with such steps, wraps


def unmarked_wraps(parts: Sequence[Part], built: Sequence[Assembled]) -> tuple[str, ...]:
    """Warnings of the state channels in rad that step by nearly a turn and have no `wraps`.

    UsageError where such an angle stays within one turn and values were made up on the way across: those lie on the
    other side of the circle. Angles from quaternions are continuous and never concerned.
    """
    found: dict[str, str] = {}
    for part, one in zip(parts, built, strict=True):
        for source in part.mapping.state:
            name = source.channel.name
            if source.field is None or source.channel.unit != "rad" or source.channel.wraps or name in found:
                continue
            said = _look(part, one, source)
            if said:
                found[name] = said
    return tuple(found.values())


def _look(part: Part, one: Assembled, source: ChannelSource) -> str | None:
    """The warning about one channel of one piece of a log."""
    track = part.tracks[source.track]
    spans = [(float(e.t[0]), float(e.t[-1])) for e in one.episodes]
    rows = np.flatnonzero(where.inside(track.t, spans))
    t, values = track.t[rows], samples(source, track, rows)
    whole = np.flatnonzero(_near_a_turn(np.diff(values)) & _same_episode(t, spans))
    if not len(whole):
        return None
    name = source.channel.name
    first = (
        f"{part.name}: {name} steps by {values[whole[0] + 1] - values[whole[0]]:.3g} rad from one row to the next "
        f"({len(whole)} time(s), first at {t[whole[0]]:.6g} s), nearly a turn"
    )
    if np.ptp(values) <= ONE_TURN and (_is_filtered(name, part.mapping) or _between(t, whole, one)):
        raise UsageError(
            f"{first}, and values in between would lie on the other side; say state.{name}.wraps=true"
        )
    return f"{first}; if it is an angle that wraps, say state.{name}.wraps=true"


def _near_a_turn(steps: FloatArray) -> BoolArray:
    return np.asarray(np.abs(np.abs(steps) - TURN) <= NEAR * TURN, dtype=np.bool_)


def _same_episode(t: FloatArray, spans: Sequence[where.Interval]) -> BoolArray:
    """(N - 1,) whether a row and the next lie in one episode: what lies between episodes is a reset, no step."""
    starts = np.array([start for start, _ in spans]) - TOLERANCE
    return np.asarray(np.diff(np.searchsorted(starts, t, side="right")) == 0, dtype=np.bool_)


def _is_filtered(name: str, mapping: ImportMapping) -> bool:
    made = any(source.derivative_of == name for source in mapping.state)
    return made or name in mapping.smoothing.channels


def _between(t: FloatArray, whole: IntArray, one: Assembled) -> bool:
    """Whether a sample of the recording lies between the two rows of one of the steps, and not on either."""
    at = np.concatenate([episode.t for episode in one.episodes])
    first = np.searchsorted(at, t[whole] + TOLERANCE, side="right")
    past = np.searchsorted(at, t[whole + 1] - TOLERANCE, side="left")
    return bool((past > first).any())
