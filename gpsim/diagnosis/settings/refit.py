"""Settings of the refit on all training windows and of the pruning on held-out ones."""

from __future__ import annotations

from dataclasses import dataclass

from gpsim.diagnosis.settings.declare import setting


@dataclass(frozen=True)
class RefitSettings:
    """Which hypotheses of the search are fitted again on all training windows."""

    most: int = setting(8, "hypotheses", "that are fitted again, the best of the search")
    most_of_a_robot: int = setting(3, "hypotheses", "the same where every step is dear")
    within: float = setting(12.0, "nats", "behind the best of the search, that a hypothesis may be")


@dataclass(frozen=True)
class PruningSettings:
    """When held-out windows speak against a term that training windows are in favour of."""

    contradicts: float = setting(
        0.05,
        "1",
        "of what a term gains on training windows: what it loses on held-out ones beyond that speaks against it",
        "a delay that gained 219 nats on a sweep must not go for 2.5 nats on nine held-out windows",
    )
    plain: float = setting(
        50.0,
        "nats",
        "of gain on training windows, from which on only a sure loss on held-out ones speaks against a term",
        "as `acceptance.beyond_all_doubt`; a pendulum's friction, 100 nats, was lost for one push by hand",
    )
    sure: float = setting(0.05, "1", "chance of such a loss where nothing is lost, below which it is sure")
    nothing: float = setting(
        2.0, "nats", "for each of its parameters, below which an effect that the user requires does nothing"
    )
