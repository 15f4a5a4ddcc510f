"""Settings of the account: attribution, the form of laws, rivals, the verdict, held-out comparisons, intervals."""

from __future__ import annotations

from dataclasses import dataclass

from gpsim.diagnosis.settings.declare import check, setting

BY_PROOF = "usual; the blind tests count how many of the intervals hold"  # origin of the intervals' level


@dataclass(frozen=True)
class AttributionSettings:
    """Rollouts that overlap, blocks that are drawn together, and when an effect is a headline."""

    most: int = setting(120, "rollouts", "that are judged on, evenly spread, at most", least=2)
    folds: int = setting(5, "1", "parts of the whole recording, each judged by what the others say", least=2)
    draws: int = setting(400, "1", "of all blocks", least=1)
    headline: float = setting(
        0.05, "1", "share of the mismatch that a headline effect accounts for at the least"
    )
    large: float = setting(
        0.2,
        "1",
        "share of the mismatch from which an effect is a headline if it is needed by what is left, if not by `needed`",
        "a machine of seed 77: Coulomb friction of 42 % was needed by 2.3 %, with 1 % left",
    )
    needed: float = setting(
        0.055,
        "1",
        "share that goes when it goes, at the least",
        "rough worlds of seed 2040 after it was opened: 12 of 39 stand-ins for nuisances were needed by less, and 4 of "
        "171 true effects",
    )

    def __post_init__(self) -> None:
        check(self, shares=("headline", "needed"))


@dataclass(frozen=True)
class SupportSettings:
    """Whether a slight effect, or one behind a gate, holds in both halves of where it acts, and none does harm."""

    rounds: int = setting(3, "1", "of taking terms out and searching on without them, at most", least=1)


@dataclass(frozen=True)
class FormSettings:
    """Whether a law holds: a free curve of its own inputs is fitted beside it and judged on held-out rollouts."""

    approximate: float = setting(
        0.1,
        "1",
        "of what a group of laws explains, that the low end of what a free curve explains more must exceed",
        "a roboticist's tenth: below it the law is right to the accuracy at which sizes are read",
    )
    departs: float = setting(
        0.2,
        "1",
        "of what a group of laws does, in root mean square, that the low end of the curve's difference from it must "
        "exceed, where the curve noticeably explains more",
        "friction without its Stribeck part is off by 0.44 and explains 94 %; laws that are right: less than 0.01",
    )
    windows: int = setting(
        240, "1", "windows, of the usual length, that a curve is fitted to", "as many as lack of fit", least=1
    )
    knots: int = setting(
        16,
        "1",
        "knots of a curve of one input",
        "of 10, 14, 16 and 18 the fewest with which cubic springs and root-shaped friction come out within 2 %",
        least=2,
    )
    rounds: int = setting(
        5,
        "1",
        "times that a curve is fitted, each around the last",
        "by hand: smooth laws need one or two, friction that sticks is no line and needs more",
        least=1,
    )
    curves: int = setting(
        3,
        "1",
        "measured curves, at most, that stand in the place of laws that do not hold, or of what has none",
        least=0,
    )


@dataclass(frozen=True)
class VerdictSettings:
    """How much of the mismatch an account must explain, and when something is there though nothing is named."""

    half: float = setting(
        0.5, "1", "of the mismatch: an account that surely explains less is none", "DESIGN.md: unknown"
    )
    nearly_all: float = setting(
        0.9, "1", "of the mismatch: an account that surely explains less is partial", "DESIGN.md: partial"
    )
    odds: float = setting(
        3.0,
        "1",
        "to one, against an account without one of its claims: one whose odds are lower is not named",
    )
    implausible: float = setting(
        2.0,
        "1",
        "times beyond the usual sizes: an account with a headline effect so far out is not named",
        "an open car's speed gain of -1.9 beside a bias of 2.3 m/s, which took off 92 % of the mismatch",
    )


@dataclass(frozen=True)
class BlackBoxSettings:
    """What models that name nothing foresee of the error that an account leaves."""

    more: float = setting(
        0.25,
        "1",
        "of the account's error, that one surely takes off an account that is partial",
        "a quarter is more than any two fits of one law differ by",
    )

    def __post_init__(self) -> None:
        check(self, shares=("more",))


@dataclass(frozen=True)
class RivalSettings:
    """Rivals: other explanations that a recording cannot tell from the leading one."""

    tie: float = setting(2.3, "nats", "behind, up to which a rival cannot be ruled out", "odds of ten")
    most: int = setting(6, "1", "rivals that are named")
    budget: float = setting(
        1.2e8, "simulated rows", "after which no further rival is looked at, the likeliest first"
    )


@dataclass(frozen=True)
class ComparisonSettings:
    """Single steps on which models are compared, and the base simulator tuned as an identification tool would."""

    steps: int = setting(3000, "transitions", "to learn from, and as many held out, at most", least=2)


@dataclass(frozen=True)
class RolloutSettings:
    """Rollouts on held-out data."""

    horizon: float = setting(1.0, "s", "of a rollout; a usual window at least")
    longest: int = setting(200, "transitions", "of a rollout at most", least=2)
    most: int = setting(400, "rollouts", "that are compared, at most", least=1)


@dataclass(frozen=True)
class RemainderGPSettings:
    """The Gaussian process on what is left, and when simulations are better with it."""

    rows: int = setting(250, "transitions", "that it learns from, at most", least=2)


@dataclass(frozen=True)
class ExperimentDesignSettings:
    """Which excitations are tried to tell rivals apart."""

    seconds: float = setting(3.0, "s", "of an excitation")


@dataclass(frozen=True)
class IntervalSettings:
    """How well the data know each parameter."""

    level: float = setting(0.90, "1", "probability with which an interval holds its parameter", BY_PROOF)
    model_error: float = setting(
        0.45,
        "1",
        "of what a size does: its standard deviation by what has no name, if that were all of the mismatch",
        "rough worlds of seed 2040 after it was opened: intervals held 55 % of 184 sizes without it, 88 % with it",
    )

    def __post_init__(self) -> None:
        check(self, shares=("level",))
