"""Settings of the judgement: what is said of what was selected, and which rivals the data cannot rule out."""

from __future__ import annotations

from dataclasses import dataclass

from gpsim.diagnosis.settings.declare import setting


@dataclass(frozen=True)
class VerdictSettings:
    """When an account is partial: how far the residual is from white, and how much of the mismatch is left over."""

    p_value: float = setting(0.01, "1", "of whiteness, below which `unexplained` is too much")
    unexplained: float = setting(0.15, "1", "share of a channel's excess over noise that may then be left")
    low_p_value: float = setting(1e-3, "1", "of whiteness, below which `little_unexplained` is too much")
    little_unexplained: float = setting(
        0.03, "1", "share of a channel's excess over noise that may then be left"
    )
    lacking: float = setting(
        0.003,
        "1",
        "of the squares that the effects take off: more that a smooth law would take off is missing",
    )
    far_from_white: float = setting(
        1e-6, "1", "p-value of whiteness below which `trace` stands in for `lacking`"
    )
    trace: float = setting(
        1e-5,
        "1",
        "the same where the residual is far from white",
        "two tests that say so are not the work of chance; with clean sensors the last digits are",
    )
    pattern: float = setting(1e-15, "1", "p-value of whiteness below which what is left may repeat itself")
    patterned: float = setting(
        0.003, "1", "of the mismatch: more of it in what repeats itself makes the account a partial one"
    )
    unnamed: float = setting(
        1e-4, "1", "p-value of whiteness below which something is there even where nothing that is known pays"
    )
    noise_margin: float = setting(
        1.1, "1", "times the noise's variance that counts as noise where effects are named"
    )
    least_excess: float = setting(
        1.2, "1", "times the noise's variance that a channel's mismatch must be to count"
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
