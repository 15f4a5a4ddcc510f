"""Settings of the data: windows and thinned clocks."""

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
