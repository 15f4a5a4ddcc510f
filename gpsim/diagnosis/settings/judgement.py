"""Settings of the judgement: what is said of what was selected, and which rivals the data cannot rule out."""

from __future__ import annotations

from dataclasses import dataclass

from gpsim.diagnosis.settings.declare import check, setting


@dataclass(frozen=True)
class VerdictSettings:
    """How much of the mismatch an account must explain, and when something is there though nothing is named."""

    half: float = setting(
        0.5, "1", "of the mismatch: an account that surely explains less is none", "DESIGN.md: unknown"
    )
    nearly_all: float = setting(
        0.9, "1", "of the mismatch: an account that surely explains less is partial", "DESIGN.md: partial"
    )
    alike: float = setting(
        0.2,
        "1",
        "of what a headline effect does, by which rivals may differ in its size and claim the same",
        "as far as a law may depart from its curve; a Limo's delay is 0.27 s, or 0.13 s beside a lag",
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
    unnamed: float = setting(
        1e-4, "1", "p-value of whiteness below which something is there even where nothing that is known pays"
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
    stands_out: float = setting(
        1.5,
        "1",
        "times what noise alone makes of a rollout: a channel in which the account's error is less is done",
    )
    trifle: float = setting(
        0.005,
        "1",
        "of the base's error: a channel in which the account leaves less is done",
        "a log made in the base's own coarse steps leaves 0.0045 of it, which a process learns",
    )
    least_ratio: float = setting(
        0.1, "1", "of the account's error: in one channel a model counts as no better, nor as so much worse"
    )
    fewest: int = setting(4, "rollouts", "held out: with fewer there is no interval", least=2)
    draws: int = setting(400, "1", "of all rollouts", least=1)
    low: float = setting(0.05, "1", "quantile of the draws that is an interval's lower end", "usual: 90 %")
    high: float = setting(0.95, "1", "quantile of the draws that is its upper end", "usual: 90 %")

    def __post_init__(self) -> None:
        check(self, shares=("more", "low", "high"))


@dataclass(frozen=True)
class RivalSettings:
    """Rivals: other explanations that a recording cannot tell from the leading one."""

    tie: float = setting(2.3, "nats", "behind, up to which a rival cannot be ruled out", "odds of ten")
    most: int = setting(6, "1", "rivals that are named")
    budget: float = setting(
        1.2e8, "simulated rows", "after which no further rival is looked at, the likeliest first"
    )
    nearly: float = setting(
        15.0,
        "nats",
        "behind, up to which one is fitted behind the leader's gates: its own were placed less closely",
    )
    mending: float = setting(
        5.0, "nats", "ahead, from which a richer fit that does not pay mends the leader's last digits"
    )
    far_ahead: float = setting(
        100.0,
        "nats",
        "by which a rival may be ahead on training windows, if held-out ones chose the leader",
        "a probability is a number still",
    )
