"""Form: whether a law holds, or was only the nearest one: free curves of the same inputs in its place."""

from gpsim.diagnosis.form.closed_forms import closed_form
from gpsim.diagnosis.form.forms import NOTICED, forms
from gpsim.diagnosis.form.free_curve import (
    FreeCurve,
    free_curve,
    free_curve_again,
    free_curves,
    missing_curve,
)
from gpsim.diagnosis.form.groups import Group, every_group, further_input, groups_missing, groups_of
from gpsim.diagnosis.form.nearest import Near, nearest, sampled
from gpsim.diagnosis.form.penalised import Departure
from gpsim.diagnosis.form.shapes import Measurement, described, measurable, measurement, smooth_start, told

__all__ = [
    "NOTICED",
    "Departure",
    "FreeCurve",
    "Group",
    "Measurement",
    "Near",
    "closed_form",
    "described",
    "every_group",
    "forms",
    "free_curve",
    "free_curve_again",
    "free_curves",
    "further_input",
    "groups_missing",
    "groups_of",
    "measurable",
    "measurement",
    "missing_curve",
    "nearest",
    "sampled",
    "smooth_start",
    "told",
]
