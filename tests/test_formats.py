"""What files say they are: other programs and other versions know them by these names, wherever the code lies."""

import numpy as np

from gpsim.corrected import EffectsPlant, describe
from gpsim.diagnosis import SCHEMA
from gpsim.policies import Policy
from gpsim.simulators import make_simulator


def test_formats_keep_their_names():
    simulator = make_simulator("slider")
    plant = EffectsPlant(simulator, simulator.defaults({}), (), "euler", 1, 0.1)
    assert describe(plant, gp=False)["schema"] == "gpsim.corrected/1"
    assert SCHEMA == "gpsim.diagnosis/2"
    weights = {"layer.0.weight": np.zeros((2, 2), np.float32), "layer.0.bias": np.zeros(2, np.float32)}
    assert Policy(weights, np.ones(2, np.float32)).to_arrays()[1]["format"] == "gpsim.policy/1"
