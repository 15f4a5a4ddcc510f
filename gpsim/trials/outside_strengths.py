"""How strong physics outside the catalogue is: the draws of all generations."""

from __future__ import annotations

from collections.abc import Mapping

from gpsim.trials import (
    strengths_2026,
    strengths_2028,
    strengths_2029,
    strengths_2030,
    strengths_2031,
    strengths_everybody,
)
from gpsim.trials.strengths import Draw

OUTSIDE: Mapping[str, Draw] = {
    **strengths_everybody.STRENGTHS,
    **strengths_2026.STRENGTHS,
    **strengths_2028.STRENGTHS,
    **strengths_2029.STRENGTHS,
    **strengths_2030.STRENGTHS,
    **strengths_2031.STRENGTHS,
}
"""Every kind outside it."""
