"""The catalogue's laws and how strong they are drawn, written a second time and never shared with `gpsim.effects`.

A mistake in one cannot hide behind the same mistake in the other; a test steps both side by side.
"""

from gpsim.trials.catalogue.actuators import ACTUATORS, Actuator
from gpsim.trials.catalogue.laws import GRIP, SMOOTH, TWIST
from gpsim.trials.catalogue.sensors import SENSORS, read
from gpsim.trials.catalogue.strengths import STRENGTHS

__all__ = ["ACTUATORS", "GRIP", "SENSORS", "SMOOTH", "STRENGTHS", "TWIST", "Actuator", "read"]
