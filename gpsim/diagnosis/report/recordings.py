"""Several recordings that were judged together: what is each one's own, and how the account does on each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from gpsim.diagnosis.report.codec import OMITTED
from gpsim.diagnosis.report.effects import Estimate, Share


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
