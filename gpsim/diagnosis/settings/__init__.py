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
from gpsim.diagnosis.settings.settings import GONE, WHERE, Settings, as_mapping, gone, read_settings
