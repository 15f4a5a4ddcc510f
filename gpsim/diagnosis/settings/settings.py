"""All settings of a diagnosis: a frozen dataclass a step, read from the configuration's `diagnose` section."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from gpsim.diagnosis.settings.numbers import (
    ClosedStepSettings,
    CurveSettings,
    GpSettings,
    IntervalSettings,
    LawSettings,
    LogFactSettings,
    PushSettings,
    RolloutSettings,
    VerdictSettings,
    WindowSettings,
    too_small,
)
from gpsim.errors import UsageError, near
from gpsim.settings import build

WHERE = "diagnose"
GONE = frozenset(
    [
        "sharing",
        "decimation",
        "prepare",
        "angles",
        "candidates",
        "discretisation",
        "acceptance",
        "search",
        "gates",
        "gate_edges",
        "stepwise",
        "lack_of_fit",
        "differences",
        "attribution",
        "support",
        "rivals",
        "black_box",
        "form",
        "comparison",
        "remainder_gp",
        "experiment_design",
    ]
)
"""Steps of the search that the ladder replaced."""


@dataclass(frozen=True)
class Settings:
    """The steps of a diagnosis, each with its settings; what is not named keeps its default."""

    windows: WindowSettings = field(default_factory=WindowSettings)
    log_facts: LogFactSettings = field(default_factory=LogFactSettings)
    laws: LawSettings = field(default_factory=LawSettings)
    pushes: PushSettings = field(default_factory=PushSettings)
    curves: CurveSettings = field(default_factory=CurveSettings)
    rollouts: RolloutSettings = field(default_factory=RolloutSettings)
    verdict: VerdictSettings = field(default_factory=VerdictSettings)
    intervals: IntervalSettings = field(default_factory=IntervalSettings)
    gp: GpSettings = field(default_factory=GpSettings)
    closed_step: ClosedStepSettings = field(default_factory=ClosedStepSettings)


def gone(name: str) -> str:
    """That a step went with the old search, and what decides now; empty of all others."""
    return (
        f"{WHERE}.{name}: was removed; use {WHERE}.laws, .curves and .verdict instead "
        "(docs/reference/settings.md)"
        if name in GONE
        else ""
    )


def read_settings(values: Mapping[str, Any]) -> Settings:
    """Settings from a mapping step -> setting -> value; raises UsageError that names the key and the nearest one."""
    steps: dict[str, Any] = {f.name: f.default_factory for f in dataclasses.fields(Settings)}
    for name, content in values.items():
        if told := gone(name):
            raise UsageError(told)
        if name not in steps:
            raise UsageError(
                f"{WHERE}: no step '{name}'{near(str(name), steps)}; there are: {', '.join(steps)}"
            )
        if not isinstance(content, Mapping):
            raise UsageError(
                f"{WHERE}.{name}: expected settings, as {WHERE}.{name}.key=value, got {content!r}"
            )
        known = [f.name for f in dataclasses.fields(steps[name])]
        for key in content:
            if key not in known:
                raise UsageError(f"{WHERE}.{name}: no setting '{key}'{near(str(key), known)}")
    read = {name: build(steps[name], content, f"{WHERE}.{name}") for name, content in values.items()}
    for name, step in read.items():
        for key, value, least in too_small(step):
            raise UsageError(f"{WHERE}.{name}.{key}: expected at least {least:g}, got {value!r}")
    return Settings(**read)


def as_mapping(settings: Settings) -> dict[str, dict[str, Any]]:
    """Step -> setting -> value, as `read_settings` takes it and conf/diagnose/default.yaml holds it."""
    return {
        step: {name: list(v) if isinstance(v, tuple) else v for name, v in values.items()}
        for step, values in dataclasses.asdict(settings).items()
    }
