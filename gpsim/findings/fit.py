"""How far each model is off: on held-out data, and an existing answer on another recording."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal

from gpsim.errors import UsageError
from gpsim.findings.codec import FLAT, OMITTED, read, written
from gpsim.findings.effects import Explained, Share

Kind = Literal["before", "tuned", "gp", "after", "after_gp", "noise_floor"]
BoxKind = Literal["gp", "after_gp", "curve"]
"""A model that names nothing: a Gaussian process alone, one beside the account, a free curve in some laws' place."""


@dataclass(frozen=True)
class Ratio:
    """A ratio [1] with its 90 % interval, None where there are too few samples.

    value: None where a simulation ran away.
    """

    value: float | None
    low: float | None
    high: float | None


@dataclass(frozen=True, kw_only=True)
class ModelErrors:
    """A figure of the error of each model; NaN where its simulation ran away.

    before: the base simulator; tuned: with its own parameters fitted; gp: base + Gaussian process; after: base +
    effects; after_gp: the corrected simulator with the Gaussian process of `Remainder.gp`, else as `after`;
    noise_floor: what the sensors' noise alone makes.
    """

    before: float
    tuned: float = math.nan
    gp: float = math.nan
    after: float
    after_gp: float = math.nan
    noise_floor: float = math.nan

    def of(self, kind: Kind) -> float:
        """The figure of a model by its name."""
        return float(getattr(self, kind))


@dataclass(frozen=True, kw_only=True)
class RolloutModelErrors(ModelErrors):
    """The same, as rollouts are written: `after_gp` before `after`."""

    ORDER: ClassVar[tuple[str, ...]] = ("before", "tuned", "gp", "after_gp", "after", "noise_floor")


@dataclass(frozen=True)
class OverBefore:
    """Each model's root mean square error over the base's, by a paired bootstrap."""

    tuned: Ratio
    gp: Ratio
    after: Ratio
    after_gp: Ratio


@dataclass(frozen=True, kw_only=True)
class StepErrors(ModelErrors):
    """Root mean square errors of a rate [unit] in single held-out steps.

    nrmse: over the standard deviation of the measured rate [1]; typical: from the median, which glitches do not move
    [unit]; after_over_before: that of `after`; finely: the base's with fine steps [unit], where nothing else is amiss;
    black_box: that of `HeldOutFit.black_box` [unit].
    """

    unit: str
    nrmse: ModelErrors | None = None
    typical: ModelErrors | None = None
    over_before: OverBefore | None = None
    after_over_before: Ratio | None = None
    finely: float | None = field(default=None, metadata=OMITTED)
    black_box: float | None = None


@dataclass(frozen=True, kw_only=True)
class RolloutErrors(RolloutModelErrors):
    """Root mean square errors of a measured channel [unit] at the end of held-out rollouts; see `StepErrors`."""

    unit: str
    typical: RolloutModelErrors | None = None
    over_before: OverBefore | None = None
    after_over_before: Ratio | None = None
    black_box: float | None = None


@dataclass(frozen=True)
class Rollout:
    """Errors by measured channel after `horizon_s` seconds from measured samples; none where no stretch is so long."""

    horizon_s: float
    channels: Mapping[str, RolloutErrors] = field(default_factory=dict, metadata=FLAT)


@dataclass(frozen=True)
class BlackBox:
    """The model that names nothing and foresees most of held-out rollouts.

    takes_off: off the account's error beyond the noise, over channels by their geometric mean, less than 0 where it is
    worse; of: of what a curve is; depends_on: on what that, or what the account leaves, depends.
    """

    model: BoxKind
    takes_off: Share
    of: str = ""
    depends_on: tuple[str, ...] = ()


@dataclass(frozen=True)
class HeldOutFit:
    """Errors on what nothing was learnt from. held_out: its episodes, whole ones or the last part of their time.

    one_step: by rate, those that follow from what was measured; rollout: by channel; black_box: None where what the
    account leaves looks like noise or its error does not stand out of it, and in files of earlier versions.
    """

    held_out: tuple[str, ...]
    one_step: Mapping[str, StepErrors]
    rollout: Rollout
    black_box: BlackBox | None = None


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
