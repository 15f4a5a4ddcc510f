"""Settings of the selection: which of the candidates are taken."""

from __future__ import annotations

from dataclasses import dataclass

from gpsim.diagnosis.settings.declare import setting


@dataclass(frozen=True)
class AcceptanceSettings:
    """When one hypothesis is worth taking over another: the twelve thresholds of `accepts`."""

    per_term: float = setting(
        4.0,
        "nats",
        "that a term must bring beside its parameters' price",
        "the log of their number: dozens",
    )
    good_share: float = setting(0.02, "1", "of the variance left over in some channel, that it must remove")
    least_part: float = setting(
        1e-4,
        "1",
        "of what the base simulator leaves over there, that it must remove",
        "a hundredth of the amplitude: with clean sensors the last digits of a law are mended by another one",
    )
    slight_share: float = setting(
        0.002,
        "1",
        "of the variance left over, that is enough where the gain is beyond doubt and what is left is white",
    )
    beyond_doubt: float = setting(10.0, "nats", "of gain that are beyond doubt for a slight share")
    better_law: float = setting(
        5.0,
        "nats",
        "of gain that are beyond doubt for a richer law in a simpler one's place",
        "it is not one of dozens, so less than `beyond_doubt` will do",
    )
    seldom_part: float = setting(
        1e-5,
        "1",
        "of the mismatch, that a richer law which acts seldom must remove beside a good share of the rest",
    )
    beyond_all_doubt: float = setting(50.0, "nats", "of gain for so small a part of the mismatch")
    most_of_it: float = setting(
        0.5,
        "1",
        "of the variance left over, that a richer law may remove instead: any part of the mismatch will do",
    )
    no_last_digits: float = setting(200.0, "nats", "of gain for that: the last digits of a law gain less")
    ordinary: float = setting(
        1.5,
        "1",
        "times the median of all windows' costs: below, nothing unusual is left of a window",
    )
    structured: float = setting(
        0.01, "1", "p-value below which a residual is not white", "usual significance"
    )
