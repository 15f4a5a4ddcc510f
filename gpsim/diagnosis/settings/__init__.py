"""Settings: every threshold of the diagnosis, step by step, with unit, meaning, default and origin."""

from gpsim.diagnosis.settings.declare import described
from gpsim.diagnosis.settings.gates import GateSettings
from gpsim.diagnosis.settings.judgement import VerdictSettings
from gpsim.diagnosis.settings.reference import as_page, as_yaml
from gpsim.diagnosis.settings.selection import AcceptanceSettings, LackOfFitSettings, SearchSettings
from gpsim.diagnosis.settings.settings import Settings, as_mapping, read_settings

__all__ = [
    "AcceptanceSettings",
    "GateSettings",
    "LackOfFitSettings",
    "SearchSettings",
    "Settings",
    "VerdictSettings",
    "as_mapping",
    "as_page",
    "as_yaml",
    "described",
    "read_settings",
]
