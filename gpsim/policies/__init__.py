"""Policies: what acts, how it is written down for other programs, and the search that teaches it."""

from gpsim.policies.beam import Beam, BeamSearch, balance_search
from gpsim.policies.expert import FAILS, Expert, Visited
from gpsim.policies.policy import Policy

__all__ = ["export"]
