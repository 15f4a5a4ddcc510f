"""How an existing answer does on another recording: nothing is fitted, all of the recording counts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from gpsim.diagnosis.report.codec import read, written
from gpsim.diagnosis.report.explained import Explained
from gpsim.diagnosis.report.fit import Ratio
from gpsim.errors import UsageError

SCORE_SCHEMA = "gpsim.score/1"


@dataclass(frozen=True, kw_only=True)
class Scored:
    """Root mean square errors of one rate or channel, in its `unit`.

    before: of the base; after: of base and effects; after_gp: of both and the Gaussian process, None without one;
    spread: of what was measured; over_before: after over before with its 90 % interval.
    """

    unit: str
    before: float
    after: float
    after_gp: float | None = None
    spread: float
    over_before: Ratio


@dataclass(frozen=True, kw_only=True)
class Score:
    """Errors by rate one step ahead, and by channel after `horizon_s` [s].

    transitions: of the recording as it was looked at, every `thinned`-th sample; steps, rollouts: how many were judged;
    explained: which share of the base's mismatch the effects take off, all along rollouts; without_gp: why
    there is no Gaussian process, "" where there is one.
    """

    one_step: Mapping[str, Scored]
    rollout: Mapping[str, Scored]
    horizon_s: float
    transitions: int
    steps: int
    rollouts: int
    thinned: int = 1
    explained: Explained | None = None
    without_gp: str = ""

    def to_dict(self) -> dict[str, Any]:
        """score.json, schema `gpsim.score/1`."""
        return {"schema": SCORE_SCHEMA, **written(self)}

    @classmethod
    def from_dict(cls, content: Any, where: str = "score.json") -> Score:
        """Of what `to_dict` wrote; raises UsageError, which begins with `where`."""
        name = content.get("schema") if isinstance(content, Mapping) else None
        if name != SCORE_SCHEMA:
            raise UsageError(f"{where}: not a score: expected the schema {SCORE_SCHEMA}, got {name!r}")
        return read(cls, content, where)
