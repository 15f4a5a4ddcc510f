"""A DC motor as its data sheet says: no friction, and a driver that gives what it is asked for."""


class Motor:
    """Angle and speed under a voltage; the inductance is left out."""

    state = {"angle": "rad", "speed": "rad/s"}
    action = {"voltage": "V"}
    coordinates = {"angle": "speed"}
    force_units = {"angle": "N m"}
    parameters = {  # unit, default, low, high
        "inertia": ("kg m^2", 2e-4, 1e-5, 1e-2),
        "constant": ("N m/A", 0.05, 0.005, 0.5),
        "resistance": ("ohm", 1.2, 0.1, 20.0),
    }

    def rates(self, state, action, p, forces):
        """The rate of the speed [rad/s^2]; `forces` is what effects add."""
        current = (action["voltage"] - p["constant"] * state["speed"]) / p["resistance"]
        return {"speed": (p["constant"] * current + forces["angle"]) / p["inertia"]}
