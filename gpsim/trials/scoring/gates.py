"""Behind which gates effects act, in a diagnosis and in an answer: a region, a moment of onset."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials.scoring.claims import Identity, Json, claims_of, identity

LEAST_IOU, LARGEST_ONSET = 0.5, 0.1  # of a region; of an onset's error as a share of the recording's duration


class Gate(NamedTuple):
    """One gate of an effect: an interval of a channel, or where `channel` is None the moment of its onset, once."""

    effect: Identity
    channel: str | None
    edges: tuple[float, ...]


def gates_of(effects: Sequence[Json]) -> list[Gate]:
    """Every gate of a list of effects."""
    found = []
    for e in effects:
        found += [Gate(identity(e), channel, tuple(edges)) for channel, edges in e["region"].items()]
        found += [] if e["since"] is None else [Gate(identity(e), None, (e["since"],))]
    return found


def gate_figures(
    truth: Sequence[Json],
    said: Sequence[Json],
    visited: Mapping[str, tuple[float, float]],
    duration: float,
    *,
    stands_in: bool,
) -> dict[str, Any]:
    """gate_right; iou and onset_error, the worst of those that there are to be found.

    Gates are compared effect by effect: that of a true effect with the claimed effect's own, or where the effect is not
    claimed and an equivalent stands in its place (`stands_in`) with any claimed gate of the same channel. visited: from
    where to where each channel went; edges of a region beyond that are anybody's guess. duration [s]: of the recording.
    """
    true, claimed, names = gates_of(truth), gates_of(said), claims_of(said)
    pairs = [
        (t, c)
        for t in true
        for c in claimed
        if t.channel == c.channel and (t.effect == c.effect or (stands_in and t.effect not in names))
    ]
    overlaps, errors = [], []
    for gate in true:
        answers = [c.edges for t, c in pairs if t == gate]
        if gate.channel is not None:
            reach = visited[gate.channel]
            wanted = np.clip(gate.edges, *reach)
            overlaps.append(max((iou(wanted, np.clip(edges, *reach)) for edges in answers), default=0.0))
        else:
            late = [abs(edges[0] - gate.edges[0]) / duration for edges in answers]
            errors.append(min(late, default=1.0))
    spurious = any(c not in [paired for _, paired in pairs] for c in claimed)
    found = all(o >= LEAST_IOU for o in overlaps) and all(e <= LARGEST_ONSET for e in errors)
    worst = ({"iou": min(overlaps)} if overlaps else {}) | ({"onset_error": max(errors)} if errors else {})
    return {"gate_right": found and not spurious, **worst}


def failed_gates(truth: Sequence[Json]) -> dict[str, float]:
    """The gates' figures of a diagnosis that failed: none was found."""
    gates = gates_of(truth)
    out = {"iou": 0.0} if any(g.channel is not None for g in gates) else {}
    return out | ({"onset_error": 1.0} if any(g.channel is None for g in gates) else {})


def iou(first: FloatArray, second: FloatArray) -> float:
    """Length of the intersection of two intervals over that of their union."""
    inner = min(first[1], second[1]) - max(first[0], second[0])
    outer = max(first[1], second[1]) - min(first[0], second[0])
    return float(max(inner, 0.0) / outer) if outer > 0 else 0.0
