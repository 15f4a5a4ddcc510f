"""Watching: later recordings of a machine against an old account, stretch by stretch, by a sequential test."""

from gpsim.watching.monitor import Account, Alarm, Monitor, Stretch, WatchSettings, looked_at
