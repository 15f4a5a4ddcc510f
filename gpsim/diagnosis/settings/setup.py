"""Settings of the setup: from a recording to the question, and to what may be missing."""

from __future__ import annotations

from dataclasses import dataclass

from gpsim.diagnosis.settings.declare import check, setting


@dataclass(frozen=True)
class PrepareSettings:
    """How many windows there are to learn from, at most and at least, and when they are longer than usual."""

    searched: int = setting(72, "windows", "that the search looks at, at most", least=1)
    searched_longer: int = setting(
        50, "windows", "that it looks at where they are longer than usual", least=1
    )
    fitted: int = setting(480, "windows", "that the final fits use, and that are held out, at most", least=1)
    cut: int = setting(
        6000, "windows", "that are cut at most: millions of transitions must not fill the memory", least=1
    )
    fewest: int = setting(4, "windows", "to learn from; with fewer a recording is refused", least=1)
    fewest_transitions: int = setting(
        12, "transitions", "below, there are not even that many short windows", least=1
    )
    longer: int = setting(
        2,
        "1",
        "times the usual length, that windows have where noise hides what happens within one",
        "unstable systems forbid more",
        least=1,
    )
    noisy: float = setting(0.02, "1", "noise that does, in parts of what moves within a window")
    enough_longer: int = setting(40, "windows", "of such a length that there must be to learn from")
    filled: float = setting(0.9, "1", "of such windows, that samples must fill, not what pads short episodes")
    least_noise: float = setting(
        1e-8, "1", "of a channel's typical size: no sensor that states no noise is better"
    )
    hidden_scale: float = setting(
        0.1, "1", "of the guess of a channel that nobody measured: its typical size at the least"
    )


@dataclass(frozen=True)
class AngleSettings:
    """Whether an angle is in degrees under the name of radians, or counted from 180 degrees away."""

    asked: bool = setting(True, "yes or no", "ask, before anything else")
    rows: int = setting(20, "transitions", "with fewer nothing is asked", least=1)
    looked_at: int = setting(2000, "transitions", "that the base is compared at, at most", least=1)
    scatter: float = setting(
        0.1,
        "1",
        "of the ratio of a position's speed and its velocity: a unit is a matter of 57.3, noise of less",
    )
    hardly: float = setting(
        0.6,
        "1",
        "of a rate, that the base leaves at least as the angle is said to be",
        "a missing effect may do that, and none of them is mended by another unit",
    )
    well: float = setting(0.25, "1", "of the same rate, that it leaves at most with the angle read otherwise")


@dataclass(frozen=True)
class CandidateSettings:
    """How large things typically are in a recording, which parameters start from."""

    rows: int = setting(4000, "transitions", "that sizes are taken from, at most", least=1)
    typical: float = setting(0.95, "1", "quantile of a channel's sizes that is its typical one")
    unforced: float = setting(
        1e-6, "1", "of the measured rates: a base simulator whose own are smaller tells no size of forces"
    )
    reach: float = setting(
        2.0, "standard deviations", "of a position, to either side, in which a law's places are looked for"
    )
    apart: int = setting(
        100,
        "transitions",
        "without contact that must be left where accelerations leave out those that touch",
        least=1,
    )

    def __post_init__(self) -> None:
        check(self, shares=("typical",))


@dataclass(frozen=True)
class LatentStateSettings:
    """States that nobody measured, completed by what a hypothesis says."""

    iterations: int = setting(12, "1", "of the fit of start states that a recording is completed with")


@dataclass(frozen=True)
class VelocityFilterSettings:
    """Velocities that were differentiated from positions: which filter made them."""

    widest: int = setting(5, "samples", "to either side of a filter", least=1)
    exact: float = setting(
        1e-3, "1", "of a velocity's typical size: how closely a filter has to say what was written down"
    )
    as_good: float = setting(2.0, "1", "times the misfit of the widest filter, that a narrower one may have")
    rows: int = setting(20_000, "samples", "that a filter is fitted to", least=1)
    per_weight: int = setting(
        4, "samples", "for each weight of the widest filter, that there must be", least=1
    )
    iterations: int = setting(
        5, "1", "of the fit of the motion around a sample, to which the filter is applied"
    )
