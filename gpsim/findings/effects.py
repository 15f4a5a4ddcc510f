"""What a diagnosis names: effects with their numbers, what they explain, what they were compared with, and geometry.

Geometry is what a motion capture of a site says of a model: zeros, lengths, turns, the frame, and what stays open.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Any, Literal

from gpsim.effects import FAMILIES, EffectParameter, Place, base_name
from gpsim.findings.codec import OMITTED

Claims = tuple[tuple[str, str], ...]
"""An explanation: of each of its effects the family and what it acts on."""
Role = Literal["headline", "slight"]
Form = Literal["holds", "approximate", "untested"]
Doubt = Literal["left", "form", "black box", "bound", "size", "implausible", "no claim", "odds"]
"""Why an account is not named: much is left, a law holds approximately, a black box foresees more, a size is at its
bound, is not known, no effect is a claim by itself, the odds against an account without one of its claims are low."""
Leads = Literal["likeliest", "simplest"]
"""Which of those that the data cannot tell apart is the account."""
JudgedOn = Literal["held-out rollouts", "cross-fitted rollouts", "fit windows"]


@dataclass(frozen=True)
class Estimate:
    """A parameter's value in its `unit` ("1": a plain ratio), with its 90 % interval [low, high].

    low, high: None where the data do not determine it. at_bound: the value stopped at the bound of the search: it is no
    measurement. usual: the sizes that machines have, where this is none of them.
    """

    value: float
    low: float | None
    high: float | None
    unit: str
    at_bound: bool = False
    usual: tuple[float, float] | None = field(default=None, metadata=OMITTED)


@dataclass(frozen=True)
class Share:
    """A part of the base simulator's mismatch [1] with its 90 % interval, None where there are too few data."""

    share: float
    low: float | None = None
    high: float | None = None


@dataclass(frozen=True)
class Odds:
    """The natural logarithm of the odds against the best explanation without an effect, and which that is.

    nats: None where no explanation without it was fitted.
    """

    nats: float | None
    against: Claims


@dataclass(frozen=True, kw_only=True)
class MeasuredCurve:
    """A law that was measured: piecewise linear between its knots.

    quantity: what it gives (`force on q`), in `unit`; input: of what, in `input_unit`; at: (K,) the knots; values: (K,)
    the curve there, low, high its 90 % band; visited: from where to where the recording went: outside, what the curve
    adds to the base is held, which is extrapolation; freedom: its effective parameters; nearest: laws of the catalogue,
    in files of earlier versions alone.
    """

    quantity: str
    unit: str
    input: str
    input_unit: str
    at: tuple[float, ...]
    values: tuple[float, ...]
    low: tuple[float, ...] = ()
    high: tuple[float, ...] = ()
    visited: tuple[float, float]
    freedom: float
    nearest: tuple[Mapping[str, Any], ...] = ()


@dataclass(frozen=True, kw_only=True)
class NamedEffect:
    """One effect of an explanation.

    family, site: docs/reference/effects.md; on: what it acts on, a coordinate, action, channel or parameter;
    parameters: by name; region: channel -> [low, high] in the channel's unit, where it acts; since: seconds on the
    recording's clock; since_episode: the name of the first episode in which it acts; acts_in: the share of the samples
    in which it acts, None where it always does; probability: of the whole explanation; evidence_gain: nats; explains:
    the share of the residual beyond noise that goes with it; importance: its part of what the account explains
    (Shapley: the parts add up); needed: what the account explains less without it, all others fitted anew; role:
    headline, or a slight correction that is no claim; form: whether its law holds against a free curve of its own
    inputs; sentence: what a person would say; implausible: the same of sizes that no machine of the kind has, None
    where all are usual. Of several recordings: recordings: the only ones in which it acts; own: recording -> parameters
    that differ there from `parameters`, which all others share (where none shares them, `parameters` are those of the
    first recording in which it acts). curve: of an effect whose law is no catalogue's but was measured.
    """

    family: str
    on: str | tuple[str, ...]
    site: str
    parameters: Mapping[str, Estimate]
    region: Mapping[str, tuple[float, float]]
    since: float | None
    since_episode: str | None = None
    acts_in: float | None = None
    probability: float
    odds: Odds | None = None
    evidence_gain: float
    explains: float
    importance: Share | None = None
    needed: Share | None = None
    role: Role = "headline"
    form: Form = "untested"
    sentence: str = ""
    implausible: str | None = None
    recordings: tuple[str, ...] | None = field(default=None, metadata=OMITTED)
    own: Mapping[str, Mapping[str, Estimate]] | None = field(default=None, metadata=OMITTED)
    curve: MeasuredCurve | None = field(default=None, metadata=OMITTED)

    @property
    def place(self) -> str:
        """What it acts on, in one word."""
        return self.on if isinstance(self.on, str) else ",".join(self.on)


@dataclass(frozen=True)
class Alternative:
    """An explanation that the data cannot rule out, and its probability among all that were fitted."""

    effects: tuple[NamedEffect, ...]
    probability: float


@dataclass(frozen=True, kw_only=True)
class RankedHypothesis:
    """An explanation that was fitted, and how many nats it is behind the best.

    gates: of each effect `time`, the channel of its region, `episode`, or nothing; scheme: the step of its integration;
    windows: on which it was fitted, all training windows or those of the search, which are fewer; refused: why it does
    not lead, though it is ahead.
    """

    nats_behind: float
    effects: Claims
    gates: tuple[str, ...] | None = None
    scheme: str
    windows: Literal["all", "search"] = "search"
    refused: str | None = field(default=None, metadata=OMITTED)


@dataclass(frozen=True, kw_only=True)
class Explained:
    """Which share of the base's mismatch, on squares and beyond the noise, the named effects take off.

    rollout: over all channels that count, None where nothing could be compared; channels: each of them; one_step: rate
    by rate, which decides nothing; judged_on: which data, cross-fitted where too few are held out, and fit windows
    where in no rollout's channel the mismatch stands out of the noise (`counts` is false then).
    """

    rollout: Share | None = None
    channels: Mapping[str, Share] = field(default_factory=dict)
    one_step: Mapping[str, Share] = field(default_factory=dict)
    judged_on: JudgedOn = "held-out rollouts"
    counts: bool = True


@dataclass(frozen=True, kw_only=True)
class Combination:
    """Parameters that only act together: what of them the data fix, and the direction that they leave open.

    of: the parameters, as `family on place: name`; fixed, open: in words; exponents: of each parameter in the product
    that is fixed; value, low, high, unit: of that product; weights, neutral: of a sum, in files of earlier versions.
    """

    of: tuple[str, ...]
    fixed: str
    open: str
    exponents: tuple[float, ...] = ()
    value: float | None = None
    low: float | None = None
    high: float | None = None
    unit: str = "1"
    weights: tuple[float, ...] = ()
    neutral: tuple[float, ...] = ()


@dataclass(frozen=True)
class LogFact:
    """Something about the log itself, which is no physics.

    kind: what; channel: of which, empty of the whole log; count: of samples, 0 where it is all of them; value: how
    much, in `unit`.
    """

    kind: Literal["repeated", "missing", "quantised", "jitter", "outliers", "touching", "pushed"]
    channel: str = ""
    count: int = 0
    value: float | None = None
    unit: str = ""


WIDEST = 2.0  # times a size: an interval that is wider does not know it
NOTHING = 3 * WIDEST  # times a size: of one that is as wide nothing is known at all


def sized(family: str, parameters: Mapping[str, Estimate]) -> bool:
    """Whether some parameter's interval excludes what does nothing, and is not wider than twice the size.

    One is enough: of two gains one may be as it should, of a law's shape little need be known.
    """
    return _some(family, parameters, WIDEST)


def no_size(family: str, parameters: Mapping[str, Estimate]) -> bool:
    """Whether nothing is known of any parameter: 0 +- 1100 N."""
    return not _some(family, parameters, NOTHING)


def _some(family: str, parameters: Mapping[str, Estimate], widest: float) -> bool:
    """Whether some interval is no wider than `widest` times its size; of a size it excludes what does nothing, too."""
    declared, asked = _declared(family), False
    for name, size in parameters.items():
        known = declared.get(base_name(name))
        if known is not None and known.place:
            continue
        asked, none = True, known.none if known else 0.0
        if size.low is not None and size.high is not None:
            outside = widest > WIDEST or not size.low <= none <= size.high
            if outside and size.high - size.low <= widest * abs(size.value - none):
                return True
    return not asked


@cache
def _declared(family: str) -> Mapping[str, EffectParameter]:
    """The parameters of a family of the catalogue by name; none of another's."""
    if family not in FAMILIES:
        return {}
    effect, place = FAMILIES[family], Place("q", "1", loaded=True)
    return {p.name: p for variant in effect.variants for p in effect.parameters(place, variant)}


GeometryKind = Literal[
    "frame turn", "frame place", "joint zero", "body place", "body turn", "site place", "site turn", "delay"
]  # fmt: skip


@dataclass(frozen=True)
class GeometryPlace:
    """One number of a model's geometry.

    kind: `frame`: of the motion capture against the model's world, turned about the first joint; `joint zero`: what is
    to be added to the encoder's reading; `body place`: along its parent's axes; `body turn`: about its own axes;
    `site`: of the marker on its body; `delay`: by how much its columns come late. on: the joint, body or site, "" of
    the frame; axis: x, y, z, "" where there is none.
    """

    kind: GeometryKind
    on: str
    axis: str


@dataclass(frozen=True, kw_only=True)
class InPlaceOf:
    """What would explain the same, and how large it would be; exact: no sample tells the two apart at all."""

    place: GeometryPlace
    value: float
    unit: str
    exact: bool


@dataclass(frozen=True, kw_only=True)
class GeometryFound:
    """A number that is off. model: whether it is the robot's, and corrected; else it is the laboratory's."""

    place: GeometryPlace
    size: Estimate
    model: bool
    instead: tuple[InPlaceOf, ...] = ()
    sentence: str = ""


@dataclass(frozen=True, kw_only=True)
class Inseparable:
    """A number that no sample tells from others; weights: how large a unit of it is in each of them."""

    place: GeometryPlace
    of: tuple[GeometryPlace, ...] = ()
    weights: tuple[float, ...] = ()
    sentence: str = ""


@dataclass(frozen=True, kw_only=True)
class ToolError:
    """Root mean square distance of model and marker [m] on held-out samples.

    before: as model and recording stand; placed: with the laboratory's numbers (frame, delay) fitted alone; after: with
    the robot's, too; noise: what is left in training, of all directions together.
    """

    before: float
    placed: float
    after: float
    noise: float


@dataclass(frozen=True, kw_only=True)
class Kinematics:
    """The geometry of a model as a motion capture saw it.

    targets: the sites and bodies that were seen; samples: looked at; lost: of these, seen by nobody or leaping;
    held_out: of these, judged on alone; independent: how many samples in training count, as errors are alike in
    neighbours; error: of each target. found: what is off; inseparable: what cannot be told from others.
    """

    targets: tuple[str, ...]
    samples: int
    lost: int
    held_out: int
    independent: float
    found: tuple[GeometryFound, ...]
    error: Mapping[str, ToolError]
    inseparable: tuple[Inseparable, ...] = ()
