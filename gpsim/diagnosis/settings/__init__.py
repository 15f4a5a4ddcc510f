"""Settings: what a user may turn, step by step, with unit, meaning, default and origin; the rest are constants."""

from gpsim.diagnosis.settings import schedules
from gpsim.diagnosis.settings.account import (
    AttributionSettings,
    BlackBoxSettings,
    FormSettings,
    IntervalSettings,
    RivalSettings,
    VerdictSettings,
)
from gpsim.diagnosis.settings.declare import described
from gpsim.diagnosis.settings.known import NAMES, NOTHING_KNOWN, Known, read_known
from gpsim.diagnosis.settings.recording import (
    AngleSettings,
    CandidateSettings,
    DecimationSettings,
    LogFactSettings,
    SharingSettings,
    WindowSettings,
)
from gpsim.diagnosis.settings.reference import as_page, as_yaml
from gpsim.diagnosis.settings.selection import (
    AcceptanceSettings,
    GateSettings,
    LackOfFitSettings,
    SearchSettings,
)
from gpsim.diagnosis.settings.settings import Settings, as_mapping, read_settings

__all__ = [
    "NAMES",
    "NOTHING_KNOWN",
    "AcceptanceSettings",
    "AngleSettings",
    "AttributionSettings",
    "BlackBoxSettings",
    "CandidateSettings",
    "DecimationSettings",
    "FormSettings",
    "GateSettings",
    "IntervalSettings",
    "Known",
    "LackOfFitSettings",
    "LogFactSettings",
    "RivalSettings",
    "SearchSettings",
    "Settings",
    "SharingSettings",
    "VerdictSettings",
    "WindowSettings",
    "as_mapping",
    "as_page",
    "as_yaml",
    "described",
    "read_known",
    "read_settings",
    "schedules",
]
