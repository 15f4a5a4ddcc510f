"""The ladder: usual physics first, all at once; what is unusual beside it; measured curves on top."""

from gpsim.diagnosis.ladder.climb import Climbed, climb

__all__ = ["Climbed", "climb"]
