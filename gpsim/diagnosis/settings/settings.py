"""All settings of a diagnosis: a frozen dataclass a step, read from the configuration's `diagnose` section."""

from __future__ import annotations

import dataclasses
import difflib
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from gpsim.diagnosis.settings.assessment import (
    BootstrapSettings,
    CombinationSettings,
    ComparisonSettings,
    ConcentrationSettings,
    ExperimentDesignSettings,
    IntervalSettings,
    LocationSettings,
    RemainderGPSettings,
    RolloutSettings,
    TraceSettings,
)
from gpsim.diagnosis.settings.attribution import AttributionSettings, SupportSettings
from gpsim.diagnosis.settings.data import (
    DecimationSettings,
    HeavyTailSettings,
    LogFactSettings,
    WindowSettings,
)
from gpsim.diagnosis.settings.declare import too_small
from gpsim.diagnosis.settings.differences import DifferenceSettings
from gpsim.diagnosis.settings.fitting import (
    ClosedStepSettings,
    DiscretisationSettings,
    EvidenceSettings,
    PatchworkSettings,
    ScoreTestSettings,
    SensorInversionSettings,
    ShootingSettings,
)
from gpsim.diagnosis.settings.form import FormSettings
from gpsim.diagnosis.settings.gates import ChangePointSettings, GateEdgeSettings, GateSettings
from gpsim.diagnosis.settings.judgement import BlackBoxSettings, RivalSettings, VerdictSettings
from gpsim.diagnosis.settings.refit import PruningSettings, RefitSettings
from gpsim.diagnosis.settings.run import CostSettings, SharingSettings
from gpsim.diagnosis.settings.schedules import ScheduleSettings
from gpsim.diagnosis.settings.selection import (
    AcceptanceSettings,
    EliminationSettings,
    GridCheckSettings,
    LackOfFitSettings,
    SearchSettings,
    StepwiseSettings,
    SubstitutionSettings,
)
from gpsim.diagnosis.settings.setup import (
    AngleSettings,
    CandidateSettings,
    LatentStateSettings,
    PrepareSettings,
    VelocityFilterSettings,
)
from gpsim.errors import UsageError
from gpsim.settings import build

WHERE = "diagnose"


@dataclass(frozen=True)
class Settings:
    """The steps of a diagnosis, each with its settings; what is not named keeps its default."""

    cost: CostSettings = field(default_factory=CostSettings)
    sharing: SharingSettings = field(default_factory=SharingSettings)
    windows: WindowSettings = field(default_factory=WindowSettings)
    decimation: DecimationSettings = field(default_factory=DecimationSettings)
    log_facts: LogFactSettings = field(default_factory=LogFactSettings)
    heavy_tails: HeavyTailSettings = field(default_factory=HeavyTailSettings)
    prepare: PrepareSettings = field(default_factory=PrepareSettings)
    angles: AngleSettings = field(default_factory=AngleSettings)
    candidates: CandidateSettings = field(default_factory=CandidateSettings)
    latent_states: LatentStateSettings = field(default_factory=LatentStateSettings)
    velocity_filter: VelocityFilterSettings = field(default_factory=VelocityFilterSettings)
    discretisation: DiscretisationSettings = field(default_factory=DiscretisationSettings)
    closed_step: ClosedStepSettings = field(default_factory=ClosedStepSettings)
    shooting: ShootingSettings = field(default_factory=ShootingSettings)
    evidence: EvidenceSettings = field(default_factory=EvidenceSettings)
    score_test: ScoreTestSettings = field(default_factory=ScoreTestSettings)
    sensor_inversion: SensorInversionSettings = field(default_factory=SensorInversionSettings)
    patchwork: PatchworkSettings = field(default_factory=PatchworkSettings)
    schedules: ScheduleSettings = field(default_factory=ScheduleSettings)
    acceptance: AcceptanceSettings = field(default_factory=AcceptanceSettings)
    search: SearchSettings = field(default_factory=SearchSettings)
    gates: GateSettings = field(default_factory=GateSettings)
    gate_edges: GateEdgeSettings = field(default_factory=GateEdgeSettings)
    change_points: ChangePointSettings = field(default_factory=ChangePointSettings)
    stepwise: StepwiseSettings = field(default_factory=StepwiseSettings)
    substitution: SubstitutionSettings = field(default_factory=SubstitutionSettings)
    elimination: EliminationSettings = field(default_factory=EliminationSettings)
    lack_of_fit: LackOfFitSettings = field(default_factory=LackOfFitSettings)
    grid_check: GridCheckSettings = field(default_factory=GridCheckSettings)
    differences: DifferenceSettings = field(default_factory=DifferenceSettings)
    refit: RefitSettings = field(default_factory=RefitSettings)
    pruning: PruningSettings = field(default_factory=PruningSettings)
    attribution: AttributionSettings = field(default_factory=AttributionSettings)
    support: SupportSettings = field(default_factory=SupportSettings)
    rivals: RivalSettings = field(default_factory=RivalSettings)
    verdict: VerdictSettings = field(default_factory=VerdictSettings)
    black_box: BlackBoxSettings = field(default_factory=BlackBoxSettings)
    form: FormSettings = field(default_factory=FormSettings)
    comparison: ComparisonSettings = field(default_factory=ComparisonSettings)
    rollouts: RolloutSettings = field(default_factory=RolloutSettings)
    bootstrap: BootstrapSettings = field(default_factory=BootstrapSettings)
    remainder_gp: RemainderGPSettings = field(default_factory=RemainderGPSettings)
    location: LocationSettings = field(default_factory=LocationSettings)
    concentration: ConcentrationSettings = field(default_factory=ConcentrationSettings)
    experiment_design: ExperimentDesignSettings = field(default_factory=ExperimentDesignSettings)
    traces: TraceSettings = field(default_factory=TraceSettings)
    intervals: IntervalSettings = field(default_factory=IntervalSettings)
    combinations: CombinationSettings = field(default_factory=CombinationSettings)


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
