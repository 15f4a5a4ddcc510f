"""The thesis's own figures (section 4.5), to stand beside ours."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Figure:
    """A mean and the standard deviation that the thesis prints with it."""

    mean: float
    std: float


@dataclass(frozen=True)
class OneStepFigure:
    """A row of Table 4.3: NRMSE (min-max) in per cent, and R2."""

    nrmse: Figure
    r2: Figure | None = None


_CART_POLE_RETURNS = {
    "Source": Figure(144.62, 18.89),
    "Domain randomisation": Figure(253.41, 54.26),
    "GP-Mean": Figure(448.98, 134.79),
    "GP-Sample": Figure(497.86, 29.4),
    "Target": Figure(496.03, 38.89),
}
"""Table 4.4: episode returns on the target, starts that cannot be solved excluded."""


def returns(system: str) -> dict[str, Figure]:
    """What the thesis's policies earn on the target of a base simulator; empty where it prints nothing."""
    return _CART_POLE_RETURNS if system == "cartpole" else {}


_CART_POLE = {
    "x_acc": {
        "mean": OneStepFigure(Figure(1.67, 1.06), Figure(0.998, 0.003)),
        "sample": OneStepFigure(Figure(4.24, 0.39), Figure(0.989, 0.003)),
    },
    "theta_acc": {
        "mean": OneStepFigure(Figure(1.64, 0.98), Figure(0.998, 0.003)),
        "sample": OneStepFigure(Figure(4.42, 0.66), Figure(0.989, 0.004)),
    },
}
_LIMO = {
    "v": {"mean": OneStepFigure(Figure(13.6, 3.9)), "sample": OneStepFigure(Figure(13.7, 3.8))},
    "w": {"mean": OneStepFigure(Figure(15.3, 2.6)), "sample": OneStepFigure(Figure(15.4, 2.6))},
}
_ONE_STEP = {("cartpole", "cartpole"): ("4.3", _CART_POLE), ("limo", "unicycle"): ("4.5", _LIMO)}
"""(experiment, base simulator) to table: 4.3, whose `linear` is x_acc, `angular` theta_acc; 4.5: v and w.

NRMSE is in per cent, the thesis's unit."""


def one_step(experiment: str, system: str) -> Mapping[str, Mapping[str, OneStepFigure]]:
    """Rate to prediction (mean, sample) to the thesis's figures; empty for what is not one of its two experiments."""
    return _ONE_STEP.get((experiment, system), ("", {}))[1]


def one_step_table(experiment: str, system: str) -> str:
    """The number of that table; empty where there is none."""
    return _ONE_STEP.get((experiment, system), ("", {}))[0]
