"""Recordings: what really happened, in episodes on one clock."""

from gpsim.recordings.bare_table import read_bare_table
from gpsim.recordings.export import Predictions, write_mcap, write_table
from gpsim.recordings.files import read_recording, write_recording
from gpsim.recordings.gaps import LONGEST_STEP, OverGaps, gaps, pieces, steps_to_next
from gpsim.recordings.import_report import ImportReport, as_text, render
from gpsim.recordings.importing import import_logs
from gpsim.recordings.inspection import Inspection, bare_mapping, inspect_log, render_inspection
from gpsim.recordings.log_parts import NamedLog
from gpsim.recordings.mapping import ChannelSource
from gpsim.recordings.mapping_files import parse_mapping
from gpsim.recordings.raw import RawLog
from gpsim.recordings.readers import open_log
from gpsim.recordings.recording import Episode, HeldOut, Recording, Transitions
from gpsim.recordings.soundness import find_bad_rows
from gpsim.recordings.sources import FolderLog, find_logs
from gpsim.recordings.subsample import evenly

__all__ = [
    "LONGEST_STEP",
    "ChannelSource",
    "Episode",
    "FolderLog",
    "HeldOut",
    "ImportReport",
    "Inspection",
    "NamedLog",
    "OverGaps",
    "Predictions",
    "RawLog",
    "Recording",
    "Transitions",
    "as_text",
    "bag_writing",
    "bare_mapping",
    "evenly",
    "find_bad_rows",
    "find_logs",
    "gaps",
    "import_logs",
    "inspect_log",
    "open_log",
    "parse_mapping",
    "pieces",
    "read_bare_table",
    "read_recording",
    "render",
    "render_inspection",
    "steps_to_next",
    "write_mcap",
    "write_recording",
    "write_table",
]
