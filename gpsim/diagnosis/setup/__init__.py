"""Setup: from a recording to the question and to what may be missing."""

from gpsim.diagnosis.setup.candidates import candidates, offers_of
from gpsim.diagnosis.setup.latent_states import Completions, completed, guessed, hidden_channels, smoothed
from gpsim.diagnosis.setup.log_facts import LogLook, flagged, look_at, mended
from gpsim.diagnosis.setup.prepare import Question, prepare, settled_question, spread_out
from gpsim.diagnosis.setup.velocity_filter import filters, undone

__all__ = [
    "Completions",
    "LogLook",
    "Question",
    "candidates",
    "completed",
    "filters",
    "flagged",
    "guessed",
    "hidden_channels",
    "look_at",
    "mended",
    "offers_of",
    "prepare",
    "settled_question",
    "smoothed",
    "spread_out",
    "undone",
]
