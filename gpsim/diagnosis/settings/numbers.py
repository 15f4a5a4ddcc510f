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

    compiled: bool = setting(True, "yes or no", "use compiled simulation where possible, otherwise NumPy")
    pace: float = setting(0.01, "s", "faster clocks than this are thinned")
    length: int = setting(
        25,
        "transitions",
        "of a window",
        "best of 10, 25 and 60 at 10 to 100 Hz: 10 lost memory, 60 slow effects",
        least=1,
    )
    longest: int = setting(100, "transitions", "length of a window at most, if the clock is fast", least=1)
    searched: int = setting(80, "windows", "windows used in the search, at most", least=4)
    fitted: int = setting(240, "windows", "windows for the final fit, and as many held out, at most", least=4)
    fewest: int = setting(
        4, "windows", "training windows at least; a recording with fewer is refused", least=1
    )


@dataclass(frozen=True)
class LogFactSettings:
    """Rung 0: what is peculiar to a log and no physics (repeated samples, outliers, grids, an uneven clock)."""

    stands_out: float = setting(
        6.0, "1", "size of an outlier's jump, relative to the steps around it",
        "11 standard deviations of white noise, which never exceeds that", least=1,
    )  # fmt: skip
    longest_repeat: int = setting(12, "samples", "longest accidental repetition of a value", least=1)
    angles: bool = setting(True, "yes or no", "test whether an angle is in degrees, or offset by 180 degrees")


@dataclass(frozen=True)
class LawSettings:
    """Rungs 1 and 2: what a law must bring before it stands."""

    law: float = setting(2.0, "nats", "price of every law, in addition to BIC (Schwarz 1978)")
    drag: float = setting(4.0, "nats", "additional price of drag, if no fluid is known", "odds of fifty")
    unusual: float = setting(8.0, "nats", "additional price of an unusual law", "odds of three thousand")
    rare: float = setting(12.0, "nats", "additional price of a very rare or very flexible law")
    gate: float = setting(10.0, "nats", "additional price of a law with a region or a start time")
    crumb: float = setting(
        2e-4,
        "1",
        "share of the base's misfit below which a law is removed",
        "no rollout shows it",
    )
    share: float = setting(0.02, "1", "share of the remaining error that a usual law must remove")
    share_of_drag: float = setting(0.1, "1", "the same for drag")
    share_of_unusual: float = setting(
        0.25, "1", "the same for an unusual law", "small effects cannot be identified beside unknown ones"
    )
    share_of_gate: float = setting(
        0.5, "1", "the same for a gate", "lower values gave wrong start times in real logs"
    )
    material: float = setting(0.01, "1", "share of the base's misfit that an unusual law must also remove")
    nearly_all: float = setting(0.6, "1", "share of the remaining error that is enough instead of `material`")
    held_out: float = setting(0.15, "1", "the same with held-out windows included")
    harmless: float = setting(0.1, "1", "loss allowed on held-out windows, relative to the training gain")
    surely: float = setting(
        0.5,
        "nats",
        "gain by which another account must be better to replace the present one",
    )
    hidden: float = setting(
        10.0, "1", "ratio of the two gains above which the remaining noise decides",
        "a large mismatch counts as noise itself",
    )  # fmt: skip
    robot_leaves: float = setting(
        0.2,
        "1",
        "share of a robot's misfit above which unusual laws are tested",
        "they are expensive",
    )

    def __post_init__(self) -> None:
        shares = ("share", "share_of_drag", "share_of_unusual", "share_of_gate", "material", "nearly_all")
        check(self, shares=shares)


@dataclass(frozen=True)
class PushSettings:
    """Moments at which something from outside acted: windows that the usual machine misses are left out."""

    times: float = setting(
        50.0, "1", "cost of such a window, relative to the median window", "7 times the usual error"
    )
    most: float = setting(0.03, "1", "share of such windows, at most", "more would not be accidental")
    rules: float = setting(
        0.5, "1", "share of the total cost that they must have", "fewer do not affect the fit"
    )
    elsewhere: float = setting(
        0.99,
        "1",
        "quantile of the distances between windows; a sample nearer than that counts as visited by another window",
    )


@dataclass(frozen=True)
class CurveSettings:
    """Rung 3: a measured curve of one input on top of the laws, where these leave something."""

    most: int = setting(2, "1", "number of curves at most; 0 for none", least=0)
    knots: int = setting(9, "1", "knots of a curve of one input", "friction bends at low speed", least=3)
    takes: float = setting(0.35, "1", "share of the remaining error that a curve must remove")


@dataclass(frozen=True)
class RolloutSettings:
    """Held-out rollouts, on which an account is judged."""

    horizon: float = setting(1.0, "s", "length of a rollout, at least a usual window")
    longest: int = setting(200, "transitions", "length of a rollout at most", least=2)
    most: int = setting(120, "rollouts", "rollouts to compare, at most", least=2)
    draws: int = setting(400, "1", "bootstrap samples for intervals", least=1)


@dataclass(frozen=True)
class VerdictSettings:
    """What is told: headlines, verdicts, rivals."""

    half: float = setting(
        0.5, "1", "explained share below which the verdict is `unknown`", "DESIGN.md: unknown"
    )
    nearly_all: float = setting(
        0.9, "1", "explained share below which the verdict is `partial`", "DESIGN.md: partial"
    )
    headline: float = setting(0.05, "1", "least share of a headline effect", "DESIGN.md: headline")
    needed: float = setting(0.02, "1", "least loss when a headline effect is removed")
    tie: float = setting(2.3, "nats", "distance up to which a rival is not excluded", "odds of ten")
    odds: float = setting(3.0, "1", "odds to one below which the verdict is `ambiguous`")
    rivals: int = setting(6, "1", "number of rivals reported, at most", least=0)
    chance: float = setting(1e-2, "1", "p-value of whiteness below which the rest has structure")
    beyond_doubt: float = setting(20.0, "nats", "gain above which an effect is always needed")
    of_left: float = setting(5.0, "1", "loss relative to the rest, if that is less than `needed`")
    decides: float = setting(
        4.0,
        "1",
        "ratio of squared errors above which an effect decides",
        "twice the error",
    )
    seldom: int = setting(
        5, "blocks", "blocks in which a rare headline effect must decide", "an end stop is rarely reached"
    )
    stands_out: float = setting(2.0, "1", "error of the base relative to the noise, in a channel that counts")
    black_box: float = setting(0.25, "1", "share of the error removed by a black box that makes it `partial`")
    implausible: float = setting(
        2.0, "1", "factor outside the usual range above which the verdict is not `named`"
    )


@dataclass(frozen=True)
class IntervalSettings:
    """How well the data know each parameter."""

    level: float = setting(0.90, "1", "probability of an interval", "usual")
    model_error: float = setting(
        0.45, "1", "relative error of a size if the whole mismatch were unexplained",
        "rough worlds, opened seed: coverage of 184 sizes 55 % without it, 88 % with it",
    )  # fmt: skip

    def __post_init__(self) -> None:
        check(self, shares=("level",))


@dataclass(frozen=True)
class GpSettings:
    """Rung 4: the Gaussian process on what is left."""

    rows: int = setting(200, "transitions", "training transitions at most", least=2)
    steps: int = setting(1500, "transitions", "transitions for comparing models, at most", least=2)


@dataclass(frozen=True)
class ClosedStepSettings:
    """Simulators that own their integration (MuJoCo models): steps are dear."""

    fitted: int = setting(60, "windows", "windows for the final fit, and as many held out, at most", least=4)
    searched: int = setting(40, "windows", "windows used in the search, at most", least=4)
