"""Simulators: what we believe. One file a system, found through one explicit registry."""

from gpsim.simulators.registry import SIMULATORS, make_simulator, source_file
from gpsim.simulators.simulator import Coordinate, Integrator, Parameter, Parameters, Simulator

__all__ = [
    "SIMULATORS",
    "Coordinate",
    "Integrator",
    "Parameter",
    "Parameters",
    "Simulator",
    "make_simulator",
    "source_file",
]
