"""Form: whether a law holds, or was only the nearest one: free curves of the same inputs in its place."""

from gpsim.diagnosis.form.forms import forms
from gpsim.diagnosis.form.free_curve import FreeCurve, free_curve, free_curves, missing_curve
from gpsim.diagnosis.form.groups import Group, further_input, groups_of
from gpsim.diagnosis.form.penalised import Departure

__all__ = [
    "Departure",
    "FreeCurve",
    "Group",
    "forms",
    "free_curve",
    "free_curves",
    "further_input",
    "groups_of",
    "missing_curve",
]
