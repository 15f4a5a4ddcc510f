"""Two water tanks, one above the other: a pump fills the upper one, which drains into the lower one, which drains away.

Schoukens, Mattsson, Wigren and Noel (2016), "Cascaded tanks benchmark". Levels and pump in volts, as measured.
"""

import numpy as np


class CascadedTanks:
    state = {"upper": "V", "lower": "V"}
    action = {"pump": "V"}
    start = {"upper": 5.0}  # nobody measures the upper tank: a guess to begin with
    parameters = {  # unit, default, low, high; round guesses
        "outflow_upper": ("V^0.5/s", 0.05, 0.0, 10.0),
        "outflow_lower": ("V^0.5/s", 0.05, 0.0, 10.0),
        "inflow": ("1/s", 0.05, 0.0, 10.0),
    }

    def rates(self, state, action, p):
        """Torricelli's law: the outflow grows with the root of the level."""
        upper, lower = (np.sqrt(np.maximum(state[name], 0.0)) for name in ("upper", "lower"))
        return {
            "upper": p["inflow"] * action["pump"] - p["outflow_upper"] * upper,
            "lower": p["outflow_upper"] * upper - p["outflow_lower"] * lower,
        }
