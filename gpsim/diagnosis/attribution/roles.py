"""Roles: which effects are claims, and which are slight corrections beside them."""

from __future__ import annotations

import numpy as np

from gpsim.channels import FloatArray
from gpsim.diagnosis.attribution.shares import Mismatch
from gpsim.diagnosis.report import Role, Share
from gpsim.diagnosis.settings import AttributionSettings


def role_of(
    importance: Share, needed: Share, left: float, decided: int, blocks: int, settings: AttributionSettings
) -> Role:
    """A headline is important and needed, or needed in the few blocks in which it decides.

    left: share of the mismatch that the account leaves. What matters less than that may stand in for some of it: real
    physics that nobody names is mended by the next best law. decided: in how many of so many blocks it decides.
    """
    surely = needed.share if needed.low is None else needed.low
    if surely <= 0.0:
        return "slight"
    least = min(settings.needed, settings.needed_of_left * left)
    if importance.share >= settings.headline and needed.share >= least:
        return "headline"
    return "headline" if settings.seldom <= decided <= settings.few * blocks else "slight"


def deciding(mismatch: Mismatch, squares: FloatArray, without: FloatArray) -> int:
    """In how many blocks an effect decides: without it (B, S) far more is left than with it, and than noise makes."""
    usual = np.maximum(squares, mismatch.floor)
    clearly = without > mismatch.settings.decides * usual
    return int((clearly & mismatch.counts & (without > 0)).any(axis=1).sum())
