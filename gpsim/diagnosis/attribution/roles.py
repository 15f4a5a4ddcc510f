"""Roles: which effects are claims, and which are slight corrections beside them."""

from __future__ import annotations

import numpy as np

from gpsim.channels import FloatArray
from gpsim.diagnosis.attribution.shares import Mismatch
from gpsim.diagnosis.report import Role, Share
from gpsim.diagnosis.settings import AttributionSettings


def role_of(
    importance: Share, needed: Share, left: float, decided: int, settings: AttributionSettings
) -> Role:
    """A headline is important and needed, or needed and decides in some blocks, however little that is of the whole.

    left: share of the mismatch that the account leaves. What matters less than that may stand in for some of it: real
    physics that nobody names is mended by the next best law. Of a large part of the mismatch it is enough to be needed
    by as much as is left: on a whole machine the other effects make good for much of one that goes. decided: in how
    many blocks it decides.
    """
    surely = needed.share if needed.low is None else needed.low
    large = importance.share >= settings.large and needed.share >= left
    if surely <= 0.0 or not (large or matters(needed, left, settings)):
        return "slight"
    beyond_what_is_left = needed.share >= settings.needed_of_left * left
    decides = decided >= settings.seldom and beyond_what_is_left
    return "headline" if decides or importance.share >= settings.headline else "slight"


def matters(needed: Share, left: float, settings: AttributionSettings) -> bool:
    """Whether an effect is needed by a good part of the mismatch, or by more than what is left of it."""
    return needed.share >= min(settings.needed, settings.needed_of_left * left)


def deciding(mismatch: Mismatch, squares: FloatArray, without: FloatArray) -> int:
    """In how many blocks an effect decides: without it (B, S) far more is left than with it, and than noise makes."""
    usual = np.maximum(squares, mismatch.floor)
    clearly = without > mismatch.settings.decides * usual
    return int((clearly & mismatch.counts & (without > 0)).any(axis=1).sum())
