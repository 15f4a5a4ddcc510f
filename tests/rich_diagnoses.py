"""Made diagnoses in which every figure of an account is there: one a verdict."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
from made_diagnoses import made_diagnosis, made_effect, made_location, made_remainder

from gpsim.diagnosis import Diagnosis
from gpsim.findings import (
    Alternative,
    Combination,
    Concentration,
    Estimate,
    Explained,
    HeldOutFit,
    LogFact,
    MeasuredCurve,
    NamedEffect,
    Odds,
    OverBefore,
    Ratio,
    RemainderGp,
    Rollout,
    RolloutErrors,
    Share,
    StepErrors,
)

TELL = (
    "record a slow wave of force with amplitude 12.3: Coulomb friction on x and actuator dead zone on force then "
    "differ by up to 14.2 standard deviations of the noise in x"
)


def size(value: float, half: float, unit: str, **changes: Any) -> Estimate:
    return Estimate(value, value - half, value + half, unit, **changes)


def share(value: float, half: float = 0.02) -> Share:
    return Share(value, value - half, value + half)


def friction(**changes: Any) -> NamedEffect:
    parts: dict[str, Any] = {
        "family": "coulomb_friction", "on": "x", "parameters": {"force": size(8.7123, 0.0561, "N")},
        "importance": share(0.74, 0.03), "needed": share(0.5), "odds": Odds(812.0, (("quadratic_drag", "x"),)),
        "form": "holds", "sentence": "", "evidence_gain": 812.0, "probability": 0.62,
    }  # fmt: skip
    return made_effect(**parts | changes)


def viscous(**changes: Any) -> NamedEffect:
    return friction(**{
        "family": "viscous_friction", "parameters": {"damping": size(1.234, 0.21, "N s/m")},
        "importance": share(0.19), "odds": Odds(math.log(118.0), ()), "form": "approximate",
    } | changes)  # fmt: skip


def gain(**changes: Any) -> NamedEffect:
    return friction(**{
        "family": "actuator_gain", "on": "force", "site": "actuator", "parameters": {"gain": size(0.93, 0.012, "1")},
        "importance": share(0.012, 0.01), "odds": Odds(4.0, ()), "form": "untested", "role": "slight",
        "since": 63.6,
    } | changes)  # fmt: skip


def stribeck(**changes: Any) -> NamedEffect:
    parameters = {
        "static_force": size(12.31, 0.4, "N"), "force": size(8.2, 0.1, "N"),
        "stribeck_velocity": Estimate(0.012, None, None, "m/s"),
    }  # fmt: skip
    return friction(
        **{"family": "stribeck_friction", "on": "theta", "parameters": parameters, "importance": share(0.08),
           "region": {"x": (-1.1, -0.4)}, "form": "untested"} | changes
    )  # fmt: skip


def fit(after: bool = True) -> HeldOutFit:
    def ratios(value: float) -> OverBefore:
        one = Ratio(value, 0.9 * value, 1.1 * value)
        return OverBefore(Ratio(0.97, 0.9, 1.0), Ratio(0.1, 0.08, 0.12), one, one)

    def errors(kind: type, before: float, left: float, unit: str) -> Any:
        last = left if after else before
        return kind(
            before=before, tuned=0.97 * before, gp=0.1 * before, after=last, after_gp=0.09 * before if not after else left,
            noise_floor=0.9 * left, unit=unit, over_before=ratios(last / before),
        )  # fmt: skip

    steps = {
        "x_acc": errors(StepErrors, 9.213, 0.11, "m/s^2"),
        "theta_acc": errors(StepErrors, 13.1, 2.02, "rad/s^2"),
    }
    runs = {
        "x": errors(RolloutErrors, 0.623, 0.0102, "m"),
        "x_dot": errors(RolloutErrors, 1.62, 0.031, "m/s"),
        "theta": errors(RolloutErrors, 0.31, 0.012, "rad"),
        "theta_dot": errors(RolloutErrors, 2.21, 0.15, "rad/s"),
    }
    return HeldOutFit(("17", "18"), steps, Rollout(1.0, runs))


def measured(name: str = "x", **changes: Any) -> NamedEffect:
    """A force that no law follows, measured over the speed."""
    at = np.linspace(-2.0, 2.0, 41)
    force, band = -8.7 * np.tanh(12 * at) - 0.4 * at - 0.3 * at**3, 0.4 + 0.1 * at**2
    curve = {
        "quantity": f"force on {name}", "unit": "N", "input": f"{name}_dot", "input_unit": "m/s", "at": tuple(at),
        "values": tuple(force), "low": tuple(force - band), "high": tuple(force + band), "visited": (-2.0, 2.0),
        "freedom": 8.0,
    }  # fmt: skip
    return friction(
        family="force_curve", on=name, curve=MeasuredCurve(**curve | changes), importance=share(0.01)
    )


def _base(**changes: Any) -> Diagnosis:
    parts: dict[str, Any] = {
        "location": made_location(channels={"x_acc": 0.93, "theta_acc": 0.41}, depends_on=("x_dot", "force")),
        "fit": fit(),
        "dt": 0.02,
    }
    return made_diagnosis(**parts | changes)


def named() -> Diagnosis:
    return _base(
        verdict="named",
        effects=(viscous(form="holds"), friction(), gain()),
        explained=Explained(
            rollout=Share(0.972, 0.951, 0.984), channels={"x": share(0.98), "theta": share(0.95)},
            one_step={"x_acc": share(0.99, 0.005), "theta_acc": share(0.31)},
        ),
        remainder=made_remainder(p_value=0.4, share=0.028, rate="theta_acc"),
        combinations=(
            Combination(
                of=("parameter_offset on cart_mass: ratio", "actuator_gain on force: gain"), fixed="", open="",
                exponents=(1.0, -1.0), value=2.5, low=2.4, high=2.6,
            ),
        ),
        facts=(LogFact("repeated", "theta", 3), LogFact("quantised", "theta", 0, 0.001, "rad"), LogFact("outliers", "x", 12)),
    )  # fmt: skip


def ambiguous() -> Diagnosis:
    zone = friction(
        family="actuator_dead_zone", on="force", site="actuator", parameters={"width": size(8.1, 0.2, "N")}
    )
    return replace(
        named(),
        verdict="ambiguous",
        alternatives=(Alternative((viscous(form="holds"), zone), 0.38),),
        tell_apart=TELL,
        facts=(),
        combinations=(),
    )


def partial() -> Diagnosis:
    return _base(
        verdict="partial",
        effects=(friction(importance=share(0.66)), viscous(), stribeck(), gain(importance=share(0.001))),
        location=made_location(
            channels={"x_acc": 0.93, "theta_acc": 0.41}, depends_on=("x_dot", "force"),
            concentrated=Concentration("x_acc", "x", "inside", (-1.1, -0.4), 0.93, 0.2),
        ),
        explained=Explained(rollout=Share(0.931, 0.88, 0.96), one_step={"x_acc": share(0.9), "theta_acc": share(0.28)}),
        remainder=made_remainder(
            structured=True, p_value=8.7e-154, share=0.069, rate="theta_acc", depends_on=("theta_dot",),
            gp=RemainderGp(True, "effects", None),
        ),
        facts=(LogFact("jitter", "", 0, 0.4, "ms"),),
    )  # fmt: skip


def unknown() -> Diagnosis:
    return _base(
        verdict="unknown",
        fit=fit(after=False),
        explained=Explained(rollout=Share(0.21, 0.1, 0.34)),
        remainder=made_remainder(
            structured=True, p_value=1e-40, share=0.98, rate="theta_acc", depends_on=("theta_dot", "force"),
            gp=RemainderGp(True, "base", None),
        ),
    )  # fmt: skip


def nothing() -> Diagnosis:
    return _base(verdict="none", fit=fit(after=False), location=made_location())


RICH = {
    "named": named,
    "ambiguous": ambiguous,
    "partial": partial,
    "unknown": unknown,
    "none": nothing,
}
