"""Recordings: what really happened, in episodes on one clock."""

from typing import TYPE_CHECKING

from gpsim.doors import opened

if TYPE_CHECKING:
    from gpsim.recordings.episodes import LONGEST_STEP, OverGaps, gaps, pieces, steps_to_next
    from gpsim.recordings.export import Predictions, start_times, write_mcap, write_table
    from gpsim.recordings.files import (
        Described,
        read_bare_table,
        read_recording,
        recording_of,
        write_recording,
    )
    from gpsim.recordings.guessing import Guess, System, bare_mapping, guess, likeliest, listed
    from gpsim.recordings.importing import ImportReport, import_logs
    from gpsim.recordings.inspection import Inspection, Statistics, inspect_log
    from gpsim.recordings.mapping import (
        TOP_KEYS,
        ChannelSource,
        ImportMapping,
        changes_of_words,
        merged,
        parse_mapping,
    )
    from gpsim.recordings.raw import (
        SUFFIXES,
        FolderLog,
        NamedLog,
        Opener,
        RawLog,
        Topic,
        find_logs,
        is_bag_folder,
    )
    from gpsim.recordings.readers import open_log
    from gpsim.recordings.recording import (
        PLACE,
        TURN,
        Episode,
        HeldOut,
        Recording,
        Transitions,
        Velocities,
        apart,
        evenly,
        joined,
        pose_channels,
        without_poses,
    )
    from gpsim.recordings.soundness import find_bad_rows
    from gpsim.recordings.tracks import TopicCount, finds_all
    from gpsim.recordings.values import check_channels, check_name, one_line
    from gpsim.recordings.yaml_data import check_bounded, parse_yaml, read_yaml
else:
    __getattr__ = opened(__name__)

__all__ = [
    "LONGEST_STEP", "PLACE", "SUFFIXES", "TOP_KEYS", "TURN", "ChannelSource", "Described", "Episode", "FolderLog",
    "Guess", "HeldOut", "ImportMapping", "ImportReport", "Inspection", "NamedLog", "Opener", "OverGaps",
    "Predictions", "RawLog", "Recording", "Statistics", "System", "Topic", "TopicCount", "Transitions",
    "Velocities", "apart", "bare_mapping", "changes_of_words", "check_bounded", "check_channels", "check_name",
    "evenly", "export", "find_bad_rows", "find_logs", "finds_all", "gaps", "guess", "import_logs", "inspect_log",
    "is_bag_folder", "joined", "likeliest", "listed", "merged", "one_line", "open_log", "parse_mapping",
    "parse_yaml", "pieces", "pose_channels", "read_bare_table", "read_recording", "read_yaml", "recording_of",
    "start_times", "steps_to_next", "without_poses", "write_mcap", "write_recording", "write_table",
]  # fmt: skip
