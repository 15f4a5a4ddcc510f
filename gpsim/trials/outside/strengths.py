"""How strong physics outside the catalogue is: the draws of all generations."""

from __future__ import annotations

from collections.abc import Mapping

from gpsim.trials.catalogue.strengths import Draw
from gpsim.trials.outside import (
    strengths_2026,
    strengths_2028,
    strengths_2029,
    strengths_2030,
    strengths_2031,
    strengths_everybody,
)

OUTSIDE: Mapping[str, Draw] = {
    **strengths_everybody.STRENGTHS,
    **strengths_2026.STRENGTHS,
    **strengths_2028.STRENGTHS,
    **strengths_2029.STRENGTHS,
    **strengths_2030.STRENGTHS,
    **strengths_2031.STRENGTHS,
}
"""Every kind outside it."""
