"""What was found and has no key of its own in diagnosis.json, which holds it in words: they are made in reports."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from gpsim.diagnosis.report.effects import Claims

Shape = Literal["constant", "slow wave", "fast wave", "random levels"]


@dataclass(frozen=True)
class Excitation:
    """What an action is driven with; size: of the level, the amplitude or the largest level, in the action's unit."""

    action: str
    shape: Shape
    size: float


@dataclass(frozen=True)
class Separation:
    """A recording that tells explanations apart.

    They then differ by up to `difference` standard deviations of the noise in `channel`, the two nearest ones that is.
    """

    excitation: Excitation
    explanations: tuple[Claims, ...]
    channel: str
    difference: float


@dataclass(frozen=True)
class Discrimination:
    """The fewest recordings that separate the rivals, and the pairs that no excitation separates of those tried."""

    recordings: tuple[Separation, ...]
    inseparable: tuple[tuple[Claims, Claims], ...]


@dataclass(frozen=True)
class NoGp:
    """Why no Gaussian process models what is left.

    What is left has no structure; or fitting it, or writing it down, failed; or, on training data that it had not seen,
    the process makes the error in `channel` (a rate one step ahead, or a measured channel after a `rollout`) so many
    `times` as large; or it explains nothing.
    """

    reason: Literal["no structure", "harms", "explains nothing", "not fitted", "not written"]
    channel: str = ""
    rollout: bool = False
    times: float = 1.0
