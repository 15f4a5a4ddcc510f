"""Targets: stand-ins for the real system. A policy may drive them and a recording may come from them, nothing else.

They hold the physics that the simulators leave out, so nothing that explains a recording may import them.
"""

from gpsim.targets.cartpole import FrictionCartPole
from gpsim.targets.limo import Limo
from gpsim.targets.mujoco import ChangedModel
