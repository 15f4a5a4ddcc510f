"""The ladder: usual physics first, all at once; what is unusual beside it; measured curves on top."""

from gpsim.diagnosis.ladder.climb import Climbed, climb
from gpsim.diagnosis.ladder.laws import USUAL, Law, laws_of
from gpsim.diagnosis.ladder.offers import Offer, Offers
