"""Settings of gates: where they may lie, how their edges are placed, and when a term may have begun."""

from __future__ import annotations

from dataclasses import dataclass

from gpsim.diagnosis.settings.declare import setting

EFFORT = "by hand: 1e7 rows take about a second of one core, and gates are many"
"""Origin of what bounds effort."""


@dataclass(frozen=True)
class GateSettings:
    """Gates, a bin at a time: the region or the moment that promises most for a term."""

    bins: int = setting(
        24, "1", "bins of a channel, or of time, in one of which a term is switched on at a time", least=1
    )
    least_bins: int = setting(3, "1", "bins that a channel must fill, for gates to be looked for there")
    margin: float = setting(
        0.05, "1", "share of a channel's range by which the outer edges lie beyond what was visited"
    )
    least_gain: float = setting(
        5.0, "nats", "linear gain that a gate must promise over the term acting everywhere"
    )
    promising: int = setting(6, "1", "terms, the best that act everywhere, which are looked at behind gates")
    fitted: int = setting(4, "1", "terms behind a gate that are fitted")
    placed: int = setting(2, "1", "terms of those of which the edges are placed")


@dataclass(frozen=True)
class GateEdgeSettings:
    """Edges of gates: scans of the likelihood that narrow, and joint fits of edges and law.

    Reaches and spacings are shares of the range of the gate's channel, or of the time.
    """

    far_reach: float = setting(
        1 / 5, "1", "how far to both sides the first scan looks where an edge is in doubt"
    )
    near_reach: float = setting(1 / 12, "1", "the same where the edge is known to a bin or two")
    places: int = setting(8, "1", "places on each side of an edge that a scan looks at", least=1)
    narrowing: float = setting(5.0, "1", "times shorter than the last is the next scan's reach", least=1.1)
    repeats: int = setting(2, "1", "scans with the same reach that may follow one which moved an edge")
    coarse_spacing: float = setting(1e-2, "1", "least spacing of a scan where gates are only tried")
    fine_spacing: float = setting(2e-4, "1", "least spacing of a scan for what is compared with the leader")
    finest_spacing: float = setting(2e-5, "1", "least spacing of a scan for what is answered in the end")
    indistinct: float = setting(0.2, "nats", "difference that does not tell two places of an edge apart")
    typical_shift: float = setting(
        0.1,
        "1",
        "share of a channel's range that a joint fit takes for the typical size of an edge",
        least=1e-9,
    )
    step_gain: float = setting(
        1.0, "nats", "gain of thresholds of jumping laws, fitted anew, after which edges are placed once more"
    )
    budget: float = setting(
        4.5e7, "simulated rows", "effort for the edges of one gate after which no scan begins", EFFORT
    )
    trial_budget: float = setting(2.5e7, "simulated rows", "the same where gates are only tried", EFFORT)


@dataclass(frozen=True)
class ChangePointSettings:
    """When a term that acts all the time best begins, from one linearisation."""

    trimmed: float = setting(
        0.1,
        "1",
        "share of the windows, at either end, in which nothing is said to begin",
        "by hand; Andrews (1993) recommends 0.15",
    )
    least_gain: float = setting(
        10.0,
        "nats",
        "gain that an onset must promise",
        "by hand: it is the best of many moments, so more than a term needs",
    )
    fitted: int = setting(2, "1", "onsets that are fitted, those that promise most")
    alike: float = setting(0.5, "1", "share of the best onset's gain that another must promise, to be fitted")
