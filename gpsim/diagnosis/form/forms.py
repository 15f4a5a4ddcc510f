"""Whether laws hold, given how much more their free curves explain on held-out rollouts, and how far off they are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from gpsim.diagnosis.form.groups import Group
from gpsim.diagnosis.form.penalised import Departure
from gpsim.diagnosis.report import Form, Share
from gpsim.diagnosis.settings import FormSettings

NOTICED = 0.003
"""Of the mismatch, that the low end of what such a curve explains more must exceed (as much as makes an effect
needed; cogging beside a positioning axis's constant force gains 0.0002)."""


def forms(
    groups: Sequence[Group],
    gains: Sequence[Share | None],
    departures: Sequence[Departure | None],
    importance: Mapping[int, float],
    settings: FormSettings,
    missing: Share | None = None,
) -> dict[int, Form]:
    """Of every term of the groups, by its index, whether its law holds.

    gains: how much more of the mismatch each group's curve explains, None where there is no curve; departures: how far
    that is from the laws; importance: of every term; missing: how much more the curve of what is missing explains
    beside all laws. Laws without a curve are blamed for that only where no curve of another's explains as much.
    """
    out: dict[int, Form] = {}
    others = max((gain.share for gain in gains if gain is not None), default=0.0)
    for group, gain, apart in zip(groups, gains, departures, strict=True):
        least = settings.approximate * max(sum(importance.get(i, 0.0) for i in group.terms), 0.0)
        form: Form = "untested"
        if gain is not None:
            form = "approximate" if _exceeds(gain, least) or _far(gain, apart, settings) else "holds"
        elif (
            not group.testable and missing is not None and missing.share > others and _exceeds(missing, least)
        ):
            form = "approximate"
        out |= dict.fromkeys(group.terms, form)
    return out


def _exceeds(gain: Share, least: float) -> bool:
    """Whether a gain's interval lies above; of too few data to have one nothing is said."""
    return gain.low is not None and gain.low > least


def _far(gain: Share, apart: Departure | None, settings: FormSettings) -> bool:
    """Whether a law is surely another than the curve, which noticeably explains more."""
    return apart is not None and apart.low > settings.departs and _exceeds(gain, NOTICED)
