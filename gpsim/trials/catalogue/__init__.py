"""The catalogue's laws and how strong they are drawn, written a second time and never shared with `gpsim.effects`.

A mistake in one cannot hide behind the same mistake in the other; a test steps both side by side.
"""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from gpsim.channels import FloatArray
from gpsim.trials.catalogue.actuators import ACTUATORS as OLDER_ACTUATORS
from gpsim.trials.catalogue.actuators import Actuator
from gpsim.trials.catalogue.laws import GRIP as OLDER_GRIP
from gpsim.trials.catalogue.laws import SMOOTH as OLDER_SMOOTH
from gpsim.trials.catalogue.laws import TWIST as OLDER_TWIST
from gpsim.trials.catalogue.sensors import SENSORS, read
from gpsim.trials.catalogue.strengths import STRENGTHS as OLDER_STRENGTHS
from gpsim.trials.catalogue.strengths import Draw
from gpsim.trials.catalogue.words import WORDS, Driven, at_site, places_of
from gpsim.trials.worlds import Values

SMOOTH: Mapping[str, Callable[..., Any]] = {**OLDER_SMOOTH, **at_site("smooth")}
GRIP: Mapping[str, Callable[..., Any]] = {**OLDER_GRIP, **at_site("grip")}
TWIST: Mapping[
    str,
    Callable[[Values, FloatArray, FloatArray, FloatArray], tuple[FloatArray, FloatArray, FloatArray]],
] = {**OLDER_TWIST, **at_site("twist")}
ACTUATORS: Mapping[str, Callable[[Values], Actuator]] = {
    **OLDER_ACTUATORS,
    **{family: partial(Driven, law) for family, law in at_site("actuator").items()},
}
DECK = tuple(sorted(OLDER_STRENGTHS))
"""The families that worlds of every stratum but `words` hold."""
STRENGTHS: Mapping[str, Draw] = {**OLDER_STRENGTHS, **{f: w.strength for f, w in WORDS.items()}}

__all__ = [
    "ACTUATORS",
    "DECK",
    "GRIP",
    "SENSORS",
    "SMOOTH",
    "STRENGTHS",
    "TWIST",
    "WORDS",
    "Actuator",
    "places_of",
    "read",
]
