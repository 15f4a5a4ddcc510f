"""Settings of the judgement: what is said of what was selected, and which rivals the data cannot rule out."""

from __future__ import annotations

from dataclasses import dataclass

from gpsim.diagnosis.settings.declare import setting


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
    unnamed: float = setting(
        1e-4, "1", "p-value of whiteness below which something is there even where nothing that is known pays"
    )


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
