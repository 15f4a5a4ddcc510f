"""How much of the mismatch an account explains, how much of it each effect is, and whether their laws hold."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from gpsim.diagnosis.report.effects import Claims, Share

JudgedOn = Literal["held-out rollouts", "cross-fitted rollouts", "fit windows"]


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
class Curve:
    """A free curve beside the laws that it stands in for, over one input.

    effects: whose laws, empty where it is what is missing; quantity: what it is of (`force on q`), in `unit`; input: of
    what, in `input_unit`; at, law, free, low, high: (K,) the input's values, the named laws there, the curve there and
    its 90 % band; given: another input that was held at a value; gain: how much more of the mismatch it explains.
    """

    effects: Claims
    quantity: str
    unit: str
    input: str
    input_unit: str
    at: tuple[float, ...]
    law: tuple[float, ...]
    free: tuple[float, ...]
    low: tuple[float, ...] = ()
    high: tuple[float, ...] = ()
    given: Mapping[str, float] = field(default_factory=dict)
    gain: Share | None = None


@dataclass(frozen=True, kw_only=True)
class Combination:
    """Parameters that only act together: what of them the data fix, and the direction that they leave open.

    of: the parameters, as `family on place: name`; fixed, open: in words; exponents: of each parameter in the product
    that is fixed, or weights: of how far each is from its `neutral` value in the sum that is fixed; value, low, high,
    unit: of that product or sum.
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

    kind: Literal[
        "repeated", "missing", "quantised", "jitter", "outliers", "late", "drift", "touching", "pushed"
    ]  # fmt: skip
    channel: str = ""
    count: int = 0
    value: float | None = None
    unit: str = ""
