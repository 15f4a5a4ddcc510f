"""All settings of a diagnosis: a frozen dataclass a step, read from the configuration's `diagnose` section."""

from __future__ import annotations

import dataclasses
import difflib
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from gpsim.diagnosis.settings.account import (
    AttributionSettings,
    BlackBoxSettings,
    ComparisonSettings,
    ExperimentDesignSettings,
    FormSettings,
    IntervalSettings,
    RemainderGPSettings,
    RivalSettings,
    RolloutSettings,
    SupportSettings,
    VerdictSettings,
)
from gpsim.diagnosis.settings.declare import too_small
from gpsim.diagnosis.settings.recording import (
    AngleSettings,
    CandidateSettings,
    ClosedStepSettings,
    DecimationSettings,
    DiscretisationSettings,
    LogFactSettings,
    PrepareSettings,
    SharingSettings,
    WindowSettings,
)
from gpsim.diagnosis.settings.selection import (
    AcceptanceSettings,
    DifferenceSettings,
    GateEdgeSettings,
    GateSettings,
    LackOfFitSettings,
    SearchSettings,
    StepwiseSettings,
)
from gpsim.errors import UsageError
from gpsim.settings import build

WHERE = "diagnose"


@dataclass(frozen=True)
class Settings:
    """The steps of a diagnosis, each with its settings; what is not named keeps its default."""

    sharing: SharingSettings = field(default_factory=SharingSettings)
    windows: WindowSettings = field(default_factory=WindowSettings)
    decimation: DecimationSettings = field(default_factory=DecimationSettings)
    log_facts: LogFactSettings = field(default_factory=LogFactSettings)
    prepare: PrepareSettings = field(default_factory=PrepareSettings)
    angles: AngleSettings = field(default_factory=AngleSettings)
    candidates: CandidateSettings = field(default_factory=CandidateSettings)
    discretisation: DiscretisationSettings = field(default_factory=DiscretisationSettings)
    closed_step: ClosedStepSettings = field(default_factory=ClosedStepSettings)
    acceptance: AcceptanceSettings = field(default_factory=AcceptanceSettings)
    search: SearchSettings = field(default_factory=SearchSettings)
    gates: GateSettings = field(default_factory=GateSettings)
    gate_edges: GateEdgeSettings = field(default_factory=GateEdgeSettings)
    stepwise: StepwiseSettings = field(default_factory=StepwiseSettings)
    lack_of_fit: LackOfFitSettings = field(default_factory=LackOfFitSettings)
    differences: DifferenceSettings = field(default_factory=DifferenceSettings)
    attribution: AttributionSettings = field(default_factory=AttributionSettings)
    support: SupportSettings = field(default_factory=SupportSettings)
    rivals: RivalSettings = field(default_factory=RivalSettings)
    verdict: VerdictSettings = field(default_factory=VerdictSettings)
    black_box: BlackBoxSettings = field(default_factory=BlackBoxSettings)
    form: FormSettings = field(default_factory=FormSettings)
    comparison: ComparisonSettings = field(default_factory=ComparisonSettings)
    rollouts: RolloutSettings = field(default_factory=RolloutSettings)
    remainder_gp: RemainderGPSettings = field(default_factory=RemainderGPSettings)
    experiment_design: ExperimentDesignSettings = field(default_factory=ExperimentDesignSettings)
    intervals: IntervalSettings = field(default_factory=IntervalSettings)


def read_settings(values: Mapping[str, Any]) -> Settings:
    """Settings from a mapping step -> setting -> value; raises UsageError that names the key and the nearest one."""
    steps: dict[str, Any] = {f.name: f.default_factory for f in dataclasses.fields(Settings)}
    for name, content in values.items():
        if name not in steps:
            raise UsageError(
                f"{WHERE}: no step '{name}'{_nearest(name, steps)}; there are: {', '.join(steps)}"
            )
        if not isinstance(content, Mapping):
            raise UsageError(
                f"{WHERE}.{name}: expected settings, as {WHERE}.{name}.key=value, got {content!r}"
            )
        known = [f.name for f in dataclasses.fields(steps[name])]
        for key in content:
            if key not in known:
                raise UsageError(f"{WHERE}.{name}: no setting '{key}'{_nearest(key, known)}")
    read = {name: build(steps[name], content, f"{WHERE}.{name}") for name, content in values.items()}
    for name, step in read.items():
        for key, value, least in too_small(step):
            raise UsageError(f"{WHERE}.{name}.{key}: expected at least {least:g}, got {value!r}")
    return Settings(**read)


def _nearest(name: str, known: Any) -> str:
    near = difflib.get_close_matches(str(name), list(known), n=1)
    return f" (did you mean '{near[0]}'?)" if near else ""


def as_mapping(settings: Settings) -> dict[str, dict[str, Any]]:
    """Step -> setting -> value, as `read_settings` takes it and conf/diagnose/default.yaml holds it."""
    return {
        step: {name: list(v) if isinstance(v, tuple) else v for name, v in values.items()}
        for step, values in dataclasses.asdict(settings).items()
    }
