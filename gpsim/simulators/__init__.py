"""Simulators: what we believe. One file a system, found through one explicit registry."""

from gpsim.simulators.own import lives_here, own_simulator
from gpsim.simulators.plant import Memory, Plant, RandomisedPlant, SimulatorPlant, part_of, restart
from gpsim.simulators.reduced import reduced
from gpsim.simulators.registry import SIMULATORS, make_simulator, source_file
from gpsim.simulators.simulator import (
    INTEGRATORS,
    Coordinate,
    Integrator,
    ModelPlace,
    Parameter,
    Parameters,
    RateFunction,
    Simulator,
)
from gpsim.simulators.unicycle import Unicycle
from gpsim.simulators.wrapping import wrapping

__all__ = [
    "INTEGRATORS",
    "SIMULATORS",
    "Coordinate",
    "Integrator",
    "Memory",
    "ModelPlace",
    "Parameter",
    "Parameters",
    "Plant",
    "RandomisedPlant",
    "RateFunction",
    "Simulator",
    "SimulatorPlant",
    "Unicycle",
    "lives_here",
    "make_simulator",
    "own_simulator",
    "part_of",
    "reduced",
    "restart",
    "source_file",
    "wrapping",
]
