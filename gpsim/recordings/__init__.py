"""Recordings: what really happened, in episodes on one clock."""

from gpsim.recordings.files import read_recording, write_recording
from gpsim.recordings.recording import Episode, HeldOut, Recording, Transitions

__all__ = ["Episode", "HeldOut", "Recording", "Transitions", "read_recording", "write_recording"]
