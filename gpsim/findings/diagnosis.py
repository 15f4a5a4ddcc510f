"""The result of a diagnosis: the contract's diagnosis.json as one frozen object."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib.resources import files
from typing import Any, Literal

from gpsim.errors import UsageError
from gpsim.findings.codec import OMITTED, UNWRITTEN, read, written
from gpsim.findings.effects import (
    Alternative,
    Claims,
    Combination,
    Doubt,
    Estimate,
    Explained,
    Leads,
    LogFact,
    NamedEffect,
    RankedHypothesis,
    Share,
)
from gpsim.findings.fit import HeldOutFit
from gpsim.findings.kinematics import Kinematics

SCHEMA = "gpsim.diagnosis/2"
SCHEMAS = "gpsim.diagnosis/"  # of any version: those to come have all of its keys

Verdict = Literal["named", "ambiguous", "partial", "unknown", "none"]
Shape = Literal["constant", "slow wave", "fast wave", "random levels"]
Because = Literal[
    "no command",
    "constant command",
    "constant",
    "held",
    "not needed",
    "estimated",
    "known",
    "asked",
    "does nothing",
    "nothing touches",
]


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

    What is left has no structure; or fitting it, or writing it down, failed; or, on training data that it had not seen,
    the process makes the error in `channel` (a rate one step ahead, or a measured channel after a `rollout`) so many
    `times` as large; or it explains nothing.
    """

    reason: Literal["no structure", "harms", "explains nothing", "not fitted", "not written"]
    channel: str = ""
    rollout: bool = False
    times: float = 1.0


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
    text = (files("gpsim.findings") / "schema.json").read_text(encoding="utf-8")
    content: dict[str, Any] = json.loads(text)
    return content
