"""Setup: from a recording to the question and to what may be missing."""

from gpsim.diagnosis.setup.estimated import Completions, completed, filters, smoothed, undone
from gpsim.diagnosis.setup.log_facts import look_at, mended, telling
from gpsim.diagnosis.setup.offers import candidates, not_asked, offers_of
from gpsim.diagnosis.setup.prepare import PreparedProblem, prepare, spread_out
from gpsim.diagnosis.setup.sight import check_moves, look
from gpsim.diagnosis.setup.sizes import FEWEST_WITHOUT_CONTACT, apart
