"""Systems of a user's own, as the text of their file."""

SLIDER = """
class Slider:
    state = {"q": "m", "q_dot": "m/s"}
    action = {"force": "N"}
    parameters = {"mass": ("kg", 2.0, 0.1, 10.0)}
    coordinates = {"q": "q_dot"}
    force_units = {"q": "N"}
    start = {"q_dot": 0.0}

    def rates(self, state, action, p, forces):
        return {"q_dot": (action["force"] + forces["q"]) / p["mass"]}
"""
