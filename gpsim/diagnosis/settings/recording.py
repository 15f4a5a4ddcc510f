"""Settings of what comes before the search: sharing, the log, windows, the setup, dear steps."""

from __future__ import annotations

from dataclasses import dataclass

from gpsim.diagnosis.settings.declare import check, setting

NEAR_BY = (
    1.5,
    1.0,
    0.7,
    0.5,
    0.35,
    0.25,
    0.15,
    0.1,
    0.06,
    0.04,
    0.02,
    0.01,
)  # the near places of both patterns
OF_STEPS = "of a parameter's own finite-difference steps"  # unit of the patterns


@dataclass(frozen=True)
class SharingSettings:
    """How work is cut for several processes, and what is remembered: seconds, no answer."""

    compiled: bool = setting(
        True, "yes or no", "simulate by compiled code what has such a form, else by NumPy"
    )


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


@dataclass(frozen=True)
class LogFactSettings:
    """What is peculiar to a log and no physics: repeated samples, outliers, grids, an uneven clock.

    On clean recordings none of it may be found; what it costs is that slight or frequent defects are not seen.
    """

    stands_out: float = setting(
        6.0,
        "1",
        "times the leaps around it, and the common ones of its channel, that an outlier leaps",
        "11 standard deviations of white noise, of which none is ever an outlier",
        least=1,
    )
    longest_repeat: int = setting(12, "samples", "that one value may be repeated by an accident", least=1)


@dataclass(frozen=True)
class PrepareSettings:
    """How many windows there are to learn from, at most and at least, and when they are longer than usual."""

    searched: int = setting(72, "windows", "that the search looks at, at most", least=1)
    fitted: int = setting(480, "windows", "that the final fits use, and that are held out, at most", least=1)
    cut: int = setting(
        6000, "windows", "that are cut at most: millions of transitions must not fill the memory", least=1
    )
    fewest: int = setting(4, "windows", "to learn from; with fewer a recording is refused", least=1)


@dataclass(frozen=True)
class AngleSettings:
    """Whether an angle is in degrees under the name of radians, or counted from 180 degrees away."""

    asked: bool = setting(True, "yes or no", "ask, before anything else")


@dataclass(frozen=True)
class CandidateSettings:
    """How large things typically are in a recording, which parameters start from."""

    reach: float = setting(
        2.0, "standard deviations", "of a position, to either side, in which a law's places are looked for"
    )


@dataclass(frozen=True)
class DiscretisationSettings:
    """Substeps of the fine scheme, and the numerical error that they leave."""

    substeps: tuple[int, ...] = setting(
        (2, 3, 4, 6, 8, 12, 16, 24), "1", "of a transition, that the fine scheme may take", least=1
    )

    def __post_init__(self) -> None:
        check(self, lists=("substeps",))


@dataclass(frozen=True)
class ClosedStepSettings:
    """Simulators that own their integration (MuJoCo models): steps are dear, their length is a part of the model."""

    fitted: int = setting(
        100,
        "windows",
        "that the final fits use, and that are held out, at most",
        "a step costs ten times that of closed equations",
        least=1,
    )
    searched: int = setting(56, "windows", "that the search looks at, at most", least=1)
    dry_finer: tuple[int, ...] = setting(
        (1, 3, 6),
        "1",
        "times as many steps where dry friction acts, the first that will do: it stops a body at the end of a step",
        "by hand, on concealed pendulums whose dry friction was given for Stribeck's, or a slight mass beside it",
    )
    dry_joints: int = setting(
        3,
        "joints",
        "of a model, at most, whose dry friction is stepped finely",
        "by hand: an arm of six spent what it may before it had named all that was missing",
    )
    unstable: float = setting(
        10.0,
        "1",
        "times as far apart that two simulations may be at a window's end that began slightly apart: longer are cut",
        "by hand: on poles that fall, windows of 25 transitions lead fits into local minima; robots that are held "
        "stay below 7",
        least=1.0,
    )
    shows: float = setting(
        0.002,
        "1",
        "of the mismatch, that a slight effect explains at least: less no rollout shows",
        "by hand, on concealed robots: beside dry friction, whose stops the model rounds to ends of its own steps, a "
        "mass that is not changed explains up to 0.0017; true slight effects 0.004 and more",
    )

    def __post_init__(self) -> None:
        check(self, lists=("dry_finer",))
