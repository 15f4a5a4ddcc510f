"""Watching: later recordings of a machine against an old account, stretch by stretch, by a sequential test."""

from gpsim.watching.account import Account, Stretch, looked_at
from gpsim.watching.monitor import Alarm, Monitor, WatchSettings

__all__ = ["Account", "Alarm", "Monitor", "Stretch", "WatchSettings", "looked_at"]
