"""The catalogue's laws and how strong they are drawn, written a second time and never shared with `gpsim.effects`.

A mistake in one cannot hide behind the same mistake in the other; a test steps both side by side.
"""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from gpsim.channels import FloatArray
from gpsim.trials.catalogue import laws, strengths, words
from gpsim.trials.catalogue.laws import SENSORS, Actuator, read
from gpsim.trials.catalogue.strengths import Draw
from gpsim.trials.catalogue.words import DRIVEN, WORDS, places_of
from gpsim.trials.worlds import Values

SMOOTH: Mapping[str, Callable[..., Any]] = {**laws.SMOOTH, **words.at_site("smooth")}
GRIP: Mapping[str, Callable[..., Any]] = {**laws.GRIP, **words.at_site("grip")}
TWIST: Mapping[
    str,
    Callable[[Values, FloatArray, FloatArray, FloatArray], tuple[FloatArray, FloatArray, FloatArray]],
] = {**laws.TWIST, **words.at_site("twist")}
ACTUATORS: Mapping[str, Callable[[Values], Actuator]] = {
    **laws.ACTUATORS,
    **{family: partial(words.Driven, law) for family, law in words.at_site("actuator").items()},
    **words.at_site("commands"),
}
LAST_SENSORS: Mapping[str, Callable[..., Any]] = words.at_site("sensor")
"""What sensors do at last, to noise, too: laws of (values, reading)."""
BRISTLES: Mapping[str, Callable[..., Any]] = words.at_site("bristles")
"""Friction with bristles: laws of (values, speed, bend, inertia)."""
COUPLINGS: Mapping[str, Callable[..., Any]] = words.at_site("coupling")
"""Drives with a motor behind a spring: laws of (values, the load's speed, twist and motor's speed, command)."""
PAST_SENSORS: Mapping[str, Callable[..., Any]] = words.at_site("past")
"""What sensors that remember read of all that was: laws of (values, past, step)."""
DECK = tuple(sorted(strengths.STRENGTHS))
"""The families that worlds of every stratum but `words` hold."""
STRENGTHS: Mapping[str, Draw] = {**strengths.STRENGTHS, **{f: w.strength for f, w in WORDS.items()}}

__all__ = [
    "ACTUATORS",
    "BRISTLES",
    "COUPLINGS",
    "DECK",
    "DRIVEN",
    "GRIP",
    "LAST_SENSORS",
    "PAST_SENSORS",
    "SENSORS",
    "SMOOTH",
    "STRENGTHS",
    "TWIST",
    "WORDS",
    "Actuator",
    "places_of",
    "read",
]
