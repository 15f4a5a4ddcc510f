"""Simulators: what we believe. One file a system, found through one explicit registry."""

from gpsim.simulators.calls import asked, read_only, refuse_complex, said
from gpsim.simulators.own import lives_here, own_simulator
from gpsim.simulators.plant import Memory, Plant, RandomisedPlant, SimulatorPlant, part_of, restart
from gpsim.simulators.reduced import Whole, reduced, whole
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
from gpsim.simulators.systems import (
    SIMULATORS,
    Ackermann,
    CartPole,
    Pendulum,
    ServoJoint,
    Slider,
    Unicycle,
    make_simulator,
    source_file,
)
from gpsim.simulators.user import module_of
from gpsim.simulators.wrapping import unwrapped, wrapping
