"""The result of a diagnosis: the contract's diagnosis.json as one frozen object."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib.resources import files
from typing import Any, Literal

from gpsim.diagnosis.report.codec import OMITTED, UNWRITTEN, read, written
from gpsim.diagnosis.report.effects import Alternative, Doubt, Leads, NamedEffect, RankedHypothesis
from gpsim.diagnosis.report.explained import Combination, Curve, Explained, LogFact
from gpsim.diagnosis.report.facts import Discrimination, NoGp
from gpsim.diagnosis.report.fit import HeldOutFit
from gpsim.diagnosis.report.kinematics import Kinematics
from gpsim.diagnosis.report.not_asked import NotAsked
from gpsim.diagnosis.report.recordings import OneRecording
from gpsim.errors import UsageError

SCHEMA = "gpsim.diagnosis/2"
SCHEMAS = "gpsim.diagnosis/"  # of any version: those to come have all of its keys

Verdict = Literal["named", "ambiguous", "partial", "unknown", "none"]


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


@dataclass(frozen=True, kw_only=True)
class MissingLaw:
    """The smooth law that would take off most of what is left.

    Of which rate and of what (`on`); memory: where given, also of the command's average over so long before [s]; nats:
    what it would gain; p_value: of that gain by chance; curve: what it looks like, where it has one input.
    """

    rate: str
    on: tuple[str, ...]
    memory: float | None = None
    nats: float
    p_value: float
    curve: Curve | None = None


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
    the one in which the largest part of what was there is left, None where none was measured.
    """

    structured: bool
    depends_on: tuple[str, ...]
    p_value: float
    lack_of_fit: MissingLaw | None = None
    gp: RemainderGp | None = None
    share: float | None = None
    rate: str | None = None


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
    tell apart `effects` holds; curves: free ones beside their laws; combinations: parameters that only act
    together; log_facts: what is peculiar to the log, in words; facts: the same, which the file does not hold.
    tell_apart: which recording would separate the rivals, in words; discrimination: in facts, which the file does not
    hold. integration: the step of the explanation, `fine` or the base's integrator. tuned: ratios by which tuning alone
    changed the base's parameters [1]. dt: the step [s] of what was looked at, every `thinned`-th sample. not_measured:
    states that were estimated; not_asked: what the recording does not show, and families left out for it.
    ranking: all that was fitted, the best first. recordings: those that were judged together, None of one alone.
    brought: where families of effects and rivals are from that are not the catalogue's, None where all are.
    kinematics: what a motion capture says of the model's geometry, None where there was none.
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
    curves: tuple[Curve, ...] = ()
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
        (files("gpsim.diagnosis") / "schema.json").read_text(encoding="utf-8")
    )
    return content
