"""The fabricated loop under names that hold formulas, tags and letters that no font has."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

ODD = {
    "x": r"$\frac{ (m)",
    "x_dot": r"_v $x_$ \n^ " + "/robot/arm/joint" * 12,
    "theta": "<script>alert(1)</script> 位😀\u200d\ue000",
    "x_acc": r"$\undefined{a}$ & 'b'",
    "theta_acc": "_hidden",
}


def odd_report(make_report: Any) -> Any:
    """The fabricated loop, its channels and rates called otherwise."""

    def renamed(value: Any) -> Any:
        if isinstance(value, dict):
            return {renamed(key): renamed(item) for key, item in value.items()}
        if isinstance(value, list | tuple):
            return type(value)(renamed(item) for item in value)
        return ODD.get(value, value) if isinstance(value, str) else value

    report = make_report(2)
    parts = {
        name: renamed(getattr(report, name))
        for name in ("summary", "fits", "states", "velocities", "units", "limits")
    }
    cuts = {
        ODD[rate]: replace(cut, rate=ODD[rate], channel=ODD[cut.channel], at=renamed(cut.at))
        for rate, cut in report.slices.items()
    }
    return replace(report, slices=cuts, **parts)
