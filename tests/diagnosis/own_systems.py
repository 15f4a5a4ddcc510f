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

ODD_NAMES = (
    r"_x (m), $\frac{",
    "x_dot $v$ 'e' \"q\" & é" + "ü" * 150 + "[end]",
    "F <script>alert(1)</script>",
)
"""Position, velocity and action of the slider below, as a spreadsheet or an attacker may call them."""
ODD_SLIDER = f"""
X, V, F = {ODD_NAMES!r}
M = "m_{{cart}}^2 [red]%s[/]"

class Odd:
    state = {{X: "m", V: "m/s"}}
    action = {{F: "N"}}
    parameters = {{M: ("kg", 2.0, 0.1, 10.0)}}
    coordinates = {{X: V}}
    force_units = {{X: "N"}}

    def rates(self, state, action, p, forces):
        return {{V: (action[F] + forces[X]) / p[M]}}
"""
