"""The numbers that decide, all of them, each with its unit, its meaning and its reason."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

Value = TypeVar("Value")

BY_HAND = "by hand, on tuning worlds; other values were not searched"
"""Origin of what nobody has varied systematically."""


def setting(default: Value, unit: str, meaning: str, origin: str = BY_HAND, *, least: float = 0.0) -> Value:
    """A field of a frozen dataclass of settings.

    unit: "1" of a pure number; meaning: what it decides, in a line; origin: where the default comes from: a figure of a
    tuning run, a paper, or BY_HAND; least: the smallest value, of a tuple's every one, with which the step can work.
    """
    return dataclasses.field(
        default=default, metadata={"unit": unit, "meaning": meaning, "origin": origin, "least": least}
    )


def too_small(step: Any) -> Iterator[tuple[str, Any, float]]:
    """(name, value, the least that it may be) of every setting of a step that is too small, or no number."""
    for f in dataclasses.fields(step):
        value, least = getattr(step, f.name), f.metadata["least"]
        for one in value if isinstance(value, tuple) else (value,):
            if isinstance(one, int | float) and not one >= least:
                yield f.name, one, least


def described(step: Any) -> list[tuple[str, Any, str, str, str]]:
    """(name, default, unit, meaning, origin) of every setting of a step, in the order of their declaration."""
    return [
        (f.name, getattr(step, f.name), f.metadata["unit"], f.metadata["meaning"], f.metadata["origin"])
        for f in dataclasses.fields(step)
    ]


def check(step: Any, *, lists: Sequence[str] = (), shares: Sequence[str] = ()) -> None:
    """Raise ValueError where one of the named lists is empty, or one of the named shares is more than 1."""
    for name in lists:
        if not getattr(step, name):
            raise ValueError(f"{name} is empty")
    for name in shares:
        if getattr(step, name) > 1.0:
            raise ValueError(f"{name} is a share of at most 1, got {getattr(step, name)!r}")


@dataclass(frozen=True)
class WindowSettings:
    """The short pieces into which a recording is cut, and how many of them laws are fitted to."""

    compiled: bool = setting(
        True, "yes or no", "simulate by compiled code what has such a form, else by NumPy"
    )
    pace: float = setting(0.01, "s", "faster clocks than this are thinned")
    length: int = setting(
        25,
        "transitions",
        "of a window",
        "best of 10, 25 and 60 at 10 to 100 Hz: 10 lost memory, 60 slow effects",
        least=1,
    )
    longest: int = setting(100, "transitions", "of a window at most, where a clock is fast", least=1)
    searched: int = setting(80, "windows", "that laws are fitted to while they are sought, at most", least=4)
    fitted: int = setting(
        240, "windows", "that the account is fitted to, and as many held out, at most", least=4
    )
    fewest: int = setting(4, "windows", "to learn from; with fewer a recording is refused", least=1)


@dataclass(frozen=True)
class LogFactSettings:
    """Rung 0: what is peculiar to a log and no physics (repeated samples, outliers, grids, an uneven clock)."""

    stands_out: float = setting(
        6.0, "1", "times the leaps around it, that an outlier leaps",
        "11 standard deviations of white noise, of which none is ever an outlier", least=1,
    )  # fmt: skip
    longest_repeat: int = setting(12, "samples", "that one value may be repeated by an accident", least=1)
    angles: bool = setting(True, "yes or no", "test whether an angle is in degrees, or offset by 180 degrees")


@dataclass(frozen=True)
class LawSettings:
    """Rungs 1 and 2: what a law must bring before it stands."""

    law: float = setting(2.0, "nats", "beside the BIC price of its parameters (Schwarz 1978), of every law")
    drag: float = setting(4.0, "nats", "more, of drag where no fluid is known", "odds of fifty")
    unusual: float = setting(
        8.0, "nats", "more, of a law that a machine seldom has", "odds of three thousand"
    )
    rare: float = setting(
        12.0, "nats", "more, of a law that a machine hardly ever has, or that bends to anything"
    )
    gate: float = setting(10.0, "nats", "more, of a law that acts in a region, or from a moment on, only")
    crumb: float = setting(
        2e-4,
        "1",
        "of the base's misfit: a law that takes off less goes, no curve is asked for",
        "no rollout shows it",
    )
    share: float = setting(0.02, "1", "of what is left beyond the noise, that a usual law takes off at least")
    share_of_drag: float = setting(0.1, "1", "the same of drag")
    share_of_unusual: float = setting(
        0.25, "1", "the same of an unusual law", "what is slight beside all that is not known has no name"
    )
    share_of_gate: float = setting(0.5, "1", "the same of a gate", "onsets crept into real logs with less")
    material: float = setting(0.01, "1", "of the base's misfit, that an unusual law takes off, too")
    nearly_all: float = setting(0.6, "1", "of what is left, that is as good as `material`")
    held_out: float = setting(
        0.15, "1", "of what is left, that an unusual law is worth with held-out windows counted in"
    )
    harmless: float = setting(
        0.1, "1", "of what a law gains in training, that held-out windows may lose by it"
    )
    surely: float = setting(
        0.5,
        "nats",
        "by which another account, or the base's own step, must be better to take the account's place",
    )
    hidden: float = setting(
        10.0, "1", "times what a law gains, that it gains by the noise it leaves: then that one judges it",
        "a large mismatch counts as noise itself",
    )  # fmt: skip
    robot_leaves: float = setting(
        0.2,
        "1",
        "of a robot's misfit, that usual laws must leave before unusual ones are asked for",
        "they are dear",
    )

    def __post_init__(self) -> None:
        shares = ("share", "share_of_drag", "share_of_unusual", "share_of_gate", "material", "nearly_all")
        check(self, shares=shares)


@dataclass(frozen=True)
class PushSettings:
    """Moments at which something from outside acted: windows that the usual machine misses are left out."""

    times: float = setting(
        50.0, "1", "the median window's cost, that such a window's is", "7 times the usual error"
    )
    most: float = setting(0.03, "1", "of all windows, at most", "where more are missed it is no accident")
    rules: float = setting(
        0.5, "1", "of what all windows cost, that they cost together", "others rule no fit"
    )
    elsewhere: float = setting(
        0.99,
        "1",
        "quantile of how far samples lie from those of other windows: nearer ones were met elsewhere",
    )


@dataclass(frozen=True)
class CurveSettings:
    """Rung 3: a measured curve of one input on top of the laws, where these leave something."""

    most: int = setting(2, "1", "curves, at most; 0 asks for none", least=0)
    knots: int = setting(9, "1", "knots of a curve of one input", "friction bends at low speed", least=3)
    takes: float = setting(0.35, "1", "of what is left beyond the noise, that it takes off at least")


@dataclass(frozen=True)
class RolloutSettings:
    """Held-out rollouts, on which an account is judged."""

    horizon: float = setting(1.0, "s", "of a rollout; a usual window at least")
    longest: int = setting(200, "transitions", "of a rollout at most", least=2)
    most: int = setting(120, "rollouts", "that are compared, at most", least=2)
    draws: int = setting(400, "1", "of blocks of them, of which intervals are made", least=1)


@dataclass(frozen=True)
class VerdictSettings:
    """What is told: headlines, verdicts, rivals."""

    half: float = setting(
        0.5, "1", "of the mismatch: an account that surely explains less is none", "DESIGN.md: unknown"
    )
    nearly_all: float = setting(
        0.9, "1", "of the mismatch: one that explains less is partial", "DESIGN.md: partial"
    )
    headline: float = setting(
        0.05, "1", "of the mismatch, that a headline effect accounts for", "DESIGN.md: headline"
    )
    needed: float = setting(0.02, "1", "of the mismatch, that goes when a headline effect goes")
    tie: float = setting(2.3, "nats", "behind, up to which a rival cannot be ruled out", "odds of ten")
    odds: float = setting(
        3.0, "1", "to one, against an account without one of its claims: with less it is ambiguous"
    )
    rivals: int = setting(6, "1", "that are told, at most", least=0)
    chance: float = setting(1e-2, "1", "p-value of whiteness, below which something is left over")
    beyond_doubt: float = setting(
        20.0, "nats", "that an effect is worth, which is needed whatever rollouts show"
    )
    of_left: float = setting(
        5.0, "1", "times what is left, that goes with a headline, if that is less than `needed`"
    )
    decides: float = setting(
        4.0,
        "1",
        "times the squares with an effect, or of noise, without it, where it decides",
        "twice the error",
    )
    seldom: int = setting(
        5, "blocks", "in which an effect decides that is a headline for that", "a stop is met seldom"
    )
    stands_out: float = setting(
        2.0, "1", "times the noise's error, that the base's is in a channel that counts"
    )
    black_box: float = setting(
        0.25, "1", "of the account's error, that a model without names takes off: partial"
    )
    implausible: float = setting(2.0, "1", "times beyond usual sizes: a headline so far out is not named")


@dataclass(frozen=True)
class IntervalSettings:
    """How well the data know each parameter."""

    level: float = setting(0.90, "1", "probability with which an interval holds its parameter", "usual")
    model_error: float = setting(
        0.45, "1", "of what a size does: its deviation by what has no name, if that were all of the mismatch",
        "rough worlds of seed 2040 after it was opened: intervals held 55 % of 184 sizes without it, 88 % with it",
    )  # fmt: skip

    def __post_init__(self) -> None:
        check(self, shares=("level",))


@dataclass(frozen=True)
class GpSettings:
    """Rung 4: the Gaussian process on what is left."""

    rows: int = setting(200, "transitions", "that it learns from, at most", least=2)
    steps: int = setting(1500, "transitions", "on which models are compared, at most", least=2)


@dataclass(frozen=True)
class ClosedStepSettings:
    """Simulators that own their integration (MuJoCo models): steps are dear."""

    fitted: int = setting(
        60, "windows", "that the account is fitted to, and as many held out, at most", least=4
    )
    searched: int = setting(40, "windows", "that laws are fitted to while they are sought, at most", least=4)
