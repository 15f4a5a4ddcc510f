"""Settings of the data: windows, thinned clocks, and what is peculiar to a log."""

from __future__ import annotations

from dataclasses import dataclass

from gpsim.diagnosis.settings.declare import check, setting


@dataclass(frozen=True)
class WindowSettings:
    """The short pieces into which a recording is cut."""

    length: int = setting(
        25,
        "transitions",
        "of a window",
        "best of 10, 25 and 60 in a trial on 100 concealed worlds at 10 to 100 Hz: 10 lost memory, 60 slow effects",
        least=1,
    )
    longest: int = setting(
        100, "transitions", "of a window at most, where a clock is fast or noise hides much", least=1
    )
    least_part: int = setting(
        3, "1", "a shorter piece than one in so many parts of a window is left out", least=1
    )
    fewest: int = setting(
        3, "transitions", "and one with fewer than these, unless windows are as short", least=1
    )
    at_once: int = setting(
        2000,
        "windows",
        "that are completed together, however long a recording is: memory, no answer",
        least=1,
    )


@dataclass(frozen=True)
class DecimationSettings:
    """Fast clocks: which samples are read."""

    pace: float = setting(0.01, "s", "faster clocks than this are thinned")
    kept_share: float = setting(
        0.99, "1", "of every action's variance, that the means over skipped samples must keep"
    )

    def __post_init__(self) -> None:
        check(self, shares=("kept_share",))


@dataclass(frozen=True)
class LogFactSettings:
    """What is peculiar to a log and no physics: repeated samples, outliers, grids, an uneven clock.

    On clean recordings none of it may be found; what it costs is that slight or frequent defects are not seen.
    """

    around: int = setting(
        10, "samples", "on either side, with which a sample is compared: what is usual there", least=1
    )
    stands_out: float = setting(
        6.0,
        "1",
        "times the leaps around it, and the common ones of its channel, that an outlier leaps",
        "11 standard deviations of white noise, of which none is ever an outlier",
        least=1,
    )
    usual_share: float = setting(
        0.8,
        "1",
        "quantile of the leaps around an outlier with which it is compared",
        "two more outliers nearby leave it alone",
    )
    common_share: float = setting(
        0.98,
        "1",
        "quantile of a channel's spikes that are taken for common",
        "what happens more often than twice in a hundred samples is chatter, no accident",
    )
    ordinary_share: float = setting(
        0.9,
        "1",
        "quantile of a channel's leaps over the whole recording that are ordinary",
        "a body that slips for a moment and is held again moves as others do",
    )
    longest_outlier: int = setting(5, "samples", "of a run that leaps away and comes back, at most", least=1)
    comes_back: float = setting(0.25, "1", "of an outlier's leap, within which it returns")
    stays_away: float = setting(0.5, "1", "of an outlier's leap, that it stays away in between")
    outlier_quanta: float = setting(5.0, "1", "steps of a channel's grid that an outlier leaps at least")
    commanded_share: float = setting(
        0.5, "1", "of the largest change of a command: two such changes, as far apart, are a cause"
    )
    commanded_often: float = setting(
        0.25,
        "1",
        "of the samples that such a pair of changes precedes: where more are, it says nothing",
        "what commands do that often is common in the channel, too",
    )
    reacts_within: int = setting(
        12, "samples", "after a change of a command in which it acts", "the longest delay that is looked for"
    )
    longest_repeat: int = setting(12, "samples", "that one value may be repeated by an accident", least=1)
    steady_on: int = setting(
        3, "values", "on either side of a repeated one that must move on steadily", least=1
    )
    steady: float = setting(
        0.4,
        "1",
        "by which slopes between values may differ from their median where motion is steady",
        "a body that stood still for one sample has half the slope",
    )
    plain_motion: float = setting(
        6.0, "1", "steps of its grid that a channel moves each sample, where a repeated value is no chance"
    )
    fewest_steps: int = setting(50, "1", "changes of a channel by which its grid is known", least=1)
    fewest_sizes: int = setting(
        3, "1", "different changes, in steps of the grid, standstill among them", least=1
    )
    multiples: tuple[int, ...] = setting(
        (1, 3, 10, 30), "1", "of the grid's step, by which it is known ever more exactly", least=1
    )
    grid_tolerance: float = setting(0.05, "1", "of the grid's step: what is nearer to a multiple is one")
    on_grid: float = setting(
        0.98, "1", "of a channel's changes that are multiples of its grid's step", "outliers may be none"
    )
    quiet: float = setting(
        0.1, "1", "of a recording, where a channel moves least: there its noise is seen beside its grid"
    )
    few_levels: int = setting(
        16, "1", "levels of command, of which each may change a speed by always the same", least=1
    )
    jitter: float = setting(0.01, "1", "of the clock's step, by which steps must scatter to be uneven")

    def __post_init__(self) -> None:
        check(self, lists=("multiples",), shares=("usual_share", "common_share", "on_grid", "comes_back"))


@dataclass(frozen=True)
class HeavyTailSettings:
    """A channel whose noise has a heavy tail: when it has one, and what its samples still weigh."""

    core: float = setting(
        3.0,
        "standard deviations",
        "of the core: a sample farther out counts as one there",
        "0.3 % of a Gaussian's samples lie beyond, their squares are 3 % of all",
        least=1,
    )
    far: float = setting(
        5.0, "standard deviations", "of the core, beyond which a Gaussian has no samples", least=1
    )
    fewest: int = setting(
        10,
        "samples",
        "so far out, that make a tail",
        "with fewer nobody can tell on what they depend",
        least=1,
    )
    above_floor: float = setting(
        2.0,
        "1",
        "times the simulation's error, that a core must be to be a sensor's noise, where none is stated",
    )
    least_share: float = setting(0.001, "1", "of the samples so far out, that make a tail")
    most_share: float = setting(
        0.05,
        "1",
        "of the samples beyond the core: where more lie there it is no tail, but what the model lacks",
    )
    chance: float = setting(
        0.005,
        "1",
        "p-value below which samples far out depend on a state or a command, and are physics",
        "Kolmogorov and Smirnov's test, two for each input",
    )
