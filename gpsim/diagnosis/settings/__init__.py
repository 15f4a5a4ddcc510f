"""Settings: every threshold of the diagnosis, step by step, with unit, meaning, default and origin."""

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
from gpsim.diagnosis.settings.declare import described
from gpsim.diagnosis.settings.fitting import (
    DiscretisationSettings,
    EvidenceSettings,
    PatchworkSettings,
    ScoreTestSettings,
    SensorInversionSettings,
    ShootingSettings,
)
from gpsim.diagnosis.settings.form import FormSettings
from gpsim.diagnosis.settings.gates import GateSettings
from gpsim.diagnosis.settings.judgement import BlackBoxSettings, RivalSettings, VerdictSettings
from gpsim.diagnosis.settings.known import NAMES, NOTHING_KNOWN, Known, read_known
from gpsim.diagnosis.settings.reference import as_page, as_yaml
from gpsim.diagnosis.settings.run import CostSettings, SharingSettings
from gpsim.diagnosis.settings.selection import AcceptanceSettings, LackOfFitSettings, SearchSettings
from gpsim.diagnosis.settings.settings import Settings, as_mapping, read_settings
from gpsim.diagnosis.settings.setup import (
    AngleSettings,
    CandidateSettings,
    LatentStateSettings,
    PrepareSettings,
    VelocityFilterSettings,
)

__all__ = [
    "NAMES",
    "NOTHING_KNOWN",
    "AcceptanceSettings",
    "AngleSettings",
    "AttributionSettings",
    "BlackBoxSettings",
    "BootstrapSettings",
    "CandidateSettings",
    "CombinationSettings",
    "ComparisonSettings",
    "ConcentrationSettings",
    "CostSettings",
    "DecimationSettings",
    "DiscretisationSettings",
    "EvidenceSettings",
    "ExperimentDesignSettings",
    "FormSettings",
    "GateSettings",
    "HeavyTailSettings",
    "IntervalSettings",
    "Known",
    "LackOfFitSettings",
    "LatentStateSettings",
    "LocationSettings",
    "LogFactSettings",
    "PatchworkSettings",
    "PrepareSettings",
    "RemainderGPSettings",
    "RivalSettings",
    "RolloutSettings",
    "ScoreTestSettings",
    "SearchSettings",
    "SensorInversionSettings",
    "Settings",
    "SharingSettings",
    "ShootingSettings",
    "SupportSettings",
    "TraceSettings",
    "VelocityFilterSettings",
    "VerdictSettings",
    "WindowSettings",
    "as_mapping",
    "as_page",
    "as_yaml",
    "described",
    "read_known",
    "read_settings",
]
