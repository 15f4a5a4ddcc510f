"""Setup: from a recording to the question and to what may be missing."""

from gpsim.diagnosis.setup.candidates import candidates, offers_of
from gpsim.diagnosis.setup.contacts import apart
from gpsim.diagnosis.setup.latent_states import Completions, completed, smoothed
from gpsim.diagnosis.setup.log_facts import LogLook, flagged, look_at, mended
from gpsim.diagnosis.setup.not_asked import not_asked
from gpsim.diagnosis.setup.prepare import Question, prepare, spread_out
from gpsim.diagnosis.setup.readings import telling
from gpsim.diagnosis.setup.sight import Sight, check_moves, look
from gpsim.diagnosis.setup.sizes import FEWEST_WITHOUT_CONTACT
from gpsim.diagnosis.setup.velocity_filter import filters, undone

__all__ = [
    "FEWEST_WITHOUT_CONTACT",
    "Completions",
    "LogLook",
    "Question",
    "Sight",
    "apart",
    "candidates",
    "check_moves",
    "completed",
    "filters",
    "flagged",
    "look",
    "look_at",
    "mended",
    "not_asked",
    "offers_of",
    "prepare",
    "smoothed",
    "spread_out",
    "telling",
    "undone",
]
