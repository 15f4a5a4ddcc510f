"""The result of a diagnosis: the contract's diagnosis.json as one frozen object; and how far each model is off."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib.resources import files
from typing import Any, ClassVar, Literal

from gpsim.errors import UsageError
from gpsim.findings.codec import FLAT, OMITTED, UNWRITTEN, read, written
from gpsim.findings.effects import (
    Alternative,
    Claims,
    Combination,
    Doubt,
    Estimate,
    Explained,
    Kinematics,
    Leads,
    LogFact,
    NamedEffect,
    RankedHypothesis,
    Share,
)

SCHEMA = "gpsim.diagnosis/2"
SCORE_SCHEMA = "gpsim.score/1"
SCHEMAS = "gpsim.diagnosis/"  # of any version: those to come have all of its keys

Verdict = Literal["named", "ambiguous", "partial", "unknown", "none"]
Shape = Literal["constant", "slow wave", "fast wave", "random levels"]
Because = Literal[
    "no command", "constant command", "constant", "held", "not needed", "estimated", "known", "asked", "does nothing",
    "nothing touches",
]  # fmt: skip
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


@dataclass(frozen=True)
class Concentration:
    """The part of one input, or of time, that holds nearly all of a rate's mismatch and few of the samples.

    channel: a state, an action, `t` [s], `episode` (from 0), or `since_reversal:` of an action or a velocity [s];
    interval: in its unit, the part lies inside or outside of it; shares of the mismatch and of the samples [1];
    is_channel: true where a channel is called as one of the others, else not written.
    """

    rate: str
    channel: str
    where: Literal["inside", "outside"]
    interval: tuple[float, float]
    share_of_mismatch: float
    share_of_samples: float
    is_channel: bool | None = field(default=None, metadata=OMITTED)


@dataclass(frozen=True, kw_only=True)
class Location:
    """Where recording and simulator differ.

    channels: of each rate the share of its mean squared residual that the effects account for (verdict unknown: that
    exceeds the noise); region, since [s], since_episode: of the gated effects, as in `NamedEffect`; depends_on: inputs
    on which the base simulator's residual depends, the most telling first.
    """

    channels: Mapping[str, float]
    region: Mapping[str, tuple[float, float]]
    since: float | None
    since_episode: str | None = None
    depends_on: tuple[str, ...]
    concentrated: Concentration | None = None


@dataclass(frozen=True)
class NoGp:
    """Why no Gaussian process models what is left.

    What is left has no structure; or fitting it, or writing it down, failed; or, on unseen training data,
    the process makes the error in `channel` (a rate one step ahead, or a measured channel after a `rollout`) so many
    `times` as large; or it explains nothing. Or it `strays`: it does so along free runs of so many `seconds`.
    """

    reason: Literal["no structure", "harms", "strays", "explains nothing", "not fitted", "not written"]
    channel: str = ""
    rollout: bool = False
    times: float = 1.0
    seconds: float = 0.0


@dataclass(frozen=True)
class RemainderGp:
    """Whether a Gaussian process models what is left: beside the effects, or in their place beside the base alone.

    why_not: in words; refused: in facts, which the file does not hold.
    """

    used: bool
    beside: Literal["effects", "base"] | None
    why_not: str | None
    refused: NoGp | None = field(default=None, metadata=UNWRITTEN, compare=False)


@dataclass(frozen=True)
class Remainder:
    """What the effects leave: whether it has structure, on which inputs it depends, the p-value of its whiteness.

    gp: None in files of versions that always had a Gaussian process; share: of the mismatch [1], that is left; rate:
    the one in which the largest part of what was there is left, None where none was measured; lack_of_fit: a law that
    earlier versions found missing.
    """

    structured: bool
    depends_on: tuple[str, ...]
    p_value: float
    lack_of_fit: Mapping[str, Any] | None = None
    gp: RemainderGp | None = None
    share: float | None = None
    rate: str | None = None


@dataclass(frozen=True, kw_only=True)
class NotAsked:
    """Something that the recording does not show, or that the user has settled, and what is left out for it.

    because: a command that was not recorded and is taken as 0, or that never changes; a state that never changes, is
    held still, was not measured and is not needed, or was not measured and is estimated; a parameter that the user
    knows; a family that the user did not ask for; an effect that is required and does nothing; or a geom that nothing
    touches. channel: of which; value: where it stands, None where nothing does; families: those that are left out,
    empty where none are.
    """

    because: Because
    channel: str
    value: float | None = None
    unit: str = ""
    families: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class EndErrors:
    """Root mean square errors of a channel [unit] at the end of rollouts: of the base and of base + effects."""

    before: float
    after: float
    unit: str


@dataclass(frozen=True, kw_only=True)
class FromOthers:
    """How an account that was learnt from all other recordings does on the whole of this one.

    explained: the share of the mismatch that it takes off; rollout: by measured channel.
    """

    explained: Share | None
    rollout: Mapping[str, EndErrors]


@dataclass(frozen=True)
class OwnValues:
    """Parameters of one effect that are a recording's own."""

    family: str
    on: str
    parameters: Mapping[str, Estimate]


@dataclass(frozen=True, kw_only=True)
class OneRecording:
    """One of several recordings.

    transitions: as it was looked at; held_out: its episodes of which something was held out; own: effects with values
    of its own; explained: the share of its mismatch that the account takes off, None where there is none to speak of;
    rollout: by measured channel, on what it held out; from_others: where there are three recordings or more.
    """

    name: str
    transitions: int
    held_out: tuple[str, ...]
    own: tuple[OwnValues, ...]
    explained: Share | None
    rollout: Mapping[str, EndErrors]
    from_others: FromOthers | None = field(default=None, metadata=OMITTED)


@dataclass(frozen=True)
class Excitation:
    """What an action is driven with; size: of the level, the amplitude or the largest level, in the action's unit."""

    action: str
    shape: Shape
    size: float


@dataclass(frozen=True)
class Separation:
    """A recording that tells explanations apart.

    They then differ by up to `difference` standard deviations of the noise in `channel`, the two nearest ones that is.
    """

    excitation: Excitation
    explanations: tuple[Claims, ...]
    channel: str
    difference: float


@dataclass(frozen=True)
class Discrimination:
    """The fewest recordings that separate the rivals, and the pairs that no excitation separates of those tried."""

    recordings: tuple[Separation, ...]
    inseparable: tuple[tuple[Claims, Claims], ...]


@dataclass(frozen=True)
class BroughtFrom:
    """Where a family is from that a user brought.

    reference: FILE.py:Class, or MODULE:Class of an installed package; sha256: of that file, "" where none has it.
    """

    reference: str
    sha256: str


@dataclass(frozen=True, kw_only=True)
class Diagnosis:
    """What a recording says about a simulator: which physics was left out, how much of it, and how sure that is.

    verdict: named (one explanation stands out), ambiguous (`alternatives` cannot be ruled out), partial (the effects
    explain most of it, not all, or a law only approximately), unknown (they explain less than half) or none.
    explained: how much they explain; doubts: why it is not named; leads: which of the explanations that the data cannot
    tell apart `effects` holds; curves: free ones, in files of earlier versions; combinations: parameters that only act
    together; log_facts: what is peculiar to the log, in words; tell_apart: which recording would separate the rivals,
    in words; facts, discrimination: the same, which the file does not hold. integration: the step of the explanation,
    `fine` or the base's integrator. tuned: ratios by which tuning alone changed the base's parameters [1]. dt: the step
    [s] of what was looked at, every `thinned`-th sample. not_measured: states that were estimated; not_asked: what the
    recording does not show, and families left out for it. ranking: all that was fitted, the best first. recordings:
    those that were judged together, None of one alone. brought: where families are from that are not the catalogue's,
    None where all are. kinematics: what a motion capture says of the model's geometry, None where there was none.
    """

    verdict: Verdict
    location: Location
    effects: tuple[NamedEffect, ...]
    alternatives: tuple[Alternative, ...]
    tell_apart: str | None
    fit: HeldOutFit
    remainder: Remainder
    integration: str
    tuned: Mapping[str, float]
    dt: float | None = None
    thinned: int = 1
    not_measured: tuple[str, ...] = ()
    not_asked: tuple[NotAsked, ...] = ()
    explained: Explained = field(default_factory=Explained)
    doubts: tuple[Doubt, ...] = ()
    leads: Leads = "likeliest"
    curves: tuple[Mapping[str, Any], ...] = ()
    combinations: tuple[Combination, ...] = ()
    log_facts: tuple[str, ...] = ()
    ranking: tuple[RankedHypothesis, ...]
    recordings: tuple[OneRecording, ...] | None = field(default=None, metadata=OMITTED)
    brought: Mapping[str, BroughtFrom] | None = field(default=None, metadata=OMITTED)
    kinematics: Kinematics | None = field(default=None, metadata=OMITTED)
    discrimination: Discrimination | None = field(default=None, metadata=UNWRITTEN, compare=False)
    facts: tuple[LogFact, ...] = field(default=(), metadata=UNWRITTEN, compare=False)

    def to_dict(self) -> dict[str, Any]:
        """diagnosis.json, schema `gpsim.diagnosis/2`: JSON's own types, keys in the order of the file."""
        return {"schema": SCHEMA, **written(self)}

    @classmethod
    def from_dict(cls, content: Any, where: str = "diagnosis.json") -> Diagnosis:
        """Of what `to_dict` wrote, this version or another; raises UsageError, which begins with `where`.

        Later keys may be missing, keys that nobody knows are passed over.
        """
        name = content.get("schema") if isinstance(content, Mapping) else None
        if not (isinstance(name, str) and name.startswith(SCHEMAS)):
            raise UsageError(f"{where}: not a diagnosis: expected the schema {SCHEMA}, got {name!r}")
        return read(cls, content, where)

    def settled(self) -> Diagnosis:
        """As it is read again, its facts kept: Python's own numbers, NaN or None for what is not finite."""
        return read(Diagnosis, self, "diagnosis")


def schema() -> dict[str, Any]:
    """The JSON Schema (draft 2020-12) of diagnosis.json."""
    content: dict[str, Any] = json.loads(
        (files("gpsim.findings") / "schema.json").read_text(encoding="utf-8")
    )
    return content
