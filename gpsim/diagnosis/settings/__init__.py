"""Settings: what a user may turn, step by step, with unit, meaning, default and reason."""

from gpsim.diagnosis.settings.known import NAMES, NOTHING_KNOWN, Known, read_known
from gpsim.diagnosis.settings.numbers import (
    IntervalSettings,
    LawSettings,
    LogFactSettings,
    PushSettings,
    RolloutSettings,
    VerdictSettings,
    WindowSettings,
    described,
)
from gpsim.diagnosis.settings.settings import WHERE, Settings, as_mapping, read_settings

__all__ = [
    "NAMES",
    "NOTHING_KNOWN",
    "WHERE",
    "IntervalSettings",
    "Known",
    "LawSettings",
    "LogFactSettings",
    "PushSettings",
    "RolloutSettings",
    "Settings",
    "VerdictSettings",
    "WindowSettings",
    "as_mapping",
    "described",
    "read_known",
    "read_settings",
]
