"""Roles: which effects are claims, and which are slight corrections beside them."""

from __future__ import annotations

import numpy as np

from gpsim.channels import FloatArray
from gpsim.diagnosis.attribution.shares import Mismatch
from gpsim.diagnosis.report import Role, Share
from gpsim.diagnosis.settings import AttributionSettings


def role_of(
    importance: Share, needed: Share, explained: Share | None, decided: int, settings: AttributionSettings
) -> Role:
    """A headline is important and needed, or needed wherever it decides. decided: in how many blocks it does."""
    left = 1.0 - (explained.share if explained else 0.0)
    least = min(settings.needed, settings.needed_of_left * left)
    surely = needed.share if needed.low is None else needed.low
    if surely <= 0.0 or needed.share < least:
        return "slight"
    return "headline" if importance.share >= settings.headline or decided >= settings.seldom else "slight"


def deciding(mismatch: Mismatch, squares: FloatArray, without: FloatArray) -> int:
    """In how many blocks an effect decides: without it (B, S) far more is left than with it, and than noise makes."""
    usual = np.maximum(squares, mismatch.floor)
    clearly = without > mismatch.settings.decides * usual
    return int((clearly & mismatch.counts & (without > 0)).any(axis=1).sum())
