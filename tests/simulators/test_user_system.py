"""A user's own system: a few lines work, every fault is one line that names the file."""

import pickle

import numpy as np
import pytest

from gpsim.errors import UsageError
from gpsim.simulators import make_simulator

pytestmark = pytest.mark.usefixtures("own_files")

GOOD = """
import numpy as np

class Tank:
    state = {"level": "m"}
    action = {"pump": "V"}
    parameters = {"outflow": ("m^0.5/s", 0.1, 0.0, 10.0)}

    def rates(self, state, action, p):
        return {"level": action["pump"] - p["outflow"] * np.sqrt(state["level"])}

class Cart:
    state = {"q": "m", "q_dot": "m/s"}
    action = {"push": "N"}
    parameters = {"mass": ("kg", 2.0, 0.1, 10.0)}
    coordinates = {"q": "q_dot"}
    force_units = {"q": "N"}

    def rates(self, state, action, p, forces):
        return {"q_dot": (action["push"] + forces["q"]) / p["mass"]}
"""


def write(tmp_path, text):
    path = tmp_path / "mine.py"
    path.write_text(text)
    return path


def test_a_first_order_system(tmp_path):
    tank = make_simulator(f"{write(tmp_path, GOOD)}:Tank")
    state, action = np.array([[4.0], [9.0]]), np.array([[1.0], [0.0]])
    np.testing.assert_allclose(tank.rates(state, action, tank.defaults()), [[0.8], [-0.3]])
    after = tank.step(state, action, tank.defaults(), np.full(2, 0.5), "euler")
    np.testing.assert_allclose(after, [[4.4], [8.85]])
    assert tank.rate.units == {"level_rate": "m/s"}


def test_a_file_that_leaves_the_program_is_one_line(tmp_path):
    leaving = GOOD.replace('return {"level"', 'raise SystemExit(3)\n        return {"level"')
    with pytest.raises(UsageError, match=r"mine\.py:Tank: rates raised SystemExit: 3"):
        make_simulator(f"{write(tmp_path, leaving)}:Tank")
    with pytest.raises(UsageError, match=r"mine\.py.* SystemExit: bye"):
        make_simulator(f"{write(tmp_path, 'raise SystemExit(chr(98) + chr(121) + chr(101))')}:Tank")


def test_a_mechanical_system_takes_forces(tmp_path):
    cart = make_simulator(f"{write(tmp_path, GOOD)}:Cart")
    rates = cart.rates(np.zeros((1, 2)), np.ones((1, 1)), cart.defaults(), np.array([[3.0]]))
    np.testing.assert_allclose(rates, [[2.0]])
    np.testing.assert_allclose(cart.derivative(np.array([[0.0, 5.0]]), rates), [[5.0, 2.0]])
    assert cart.coordinates[0].rate == "q_acc"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("class Tank", "class Other", "no class 'Tank'"),
        ("import numpy as np", "import no_such_module", "ModuleNotFoundError"),
        ("import numpy as np", "def (", "SyntaxError"),
        (
            'return {"level": action',
            'raise RuntimeError("boom"); return {"level": action',
            "RuntimeError: boom",
        ),
        ('{"level": action', '{"height": action', "must return a dictionary with level"),
        ('np.sqrt(state["level"])', "np.ones((7, 2))", "operands could not be broadcast"),
        ('action["pump"] - p["outflow"] * np.sqrt(state["level"])', "np.ones(7)", "must be 3 numbers"),
        ('np.sqrt(state["level"])', "np.nan", "not finite"),
        ('{"level": "m"}', "{}", "'state' must be a dictionary"),
        ('("m^0.5/s", 0.1, 0.0, 10.0)', "0.1", "unit, default, low, high"),
        (
            "0.1, 0.0, 10.0",
            "1.5, 0.0, 1.0",
            r"parameters\['outflow'\] needs .* got default 1.5, low 0, high 1",
        ),
        ("0.1, 0.0, 10.0", "5.0, 10.0, 0.0", "got default 5, low 10, high 0"),
        ("0.1, 0.0, 10.0", "0.1, float('nan'), 10.0", "got default 0.1, low nan, high 10"),
        ("0.1, 0.0, 10.0", "float('inf'), 0.0, float('inf')", "got default inf, low 0, high inf"),
        ('{"pump": "V"}', '{"level": "V"}', "'level' is both a state and an action"),
        ("def rates(self, state, action, p)", "def rates(self, state)", "rates must take"),
        ("def rates(self, state, action, p)", "def rate(self, state, action, p)", "needs a method rates"),
    ],
)
def test_faults_are_one_line(tmp_path, old, new, message):
    text = GOOD.replace(old, new, 1)
    assert text != GOOD
    path = write(tmp_path, text)
    with pytest.raises(UsageError, match=message) as caught:
        make_simulator(f"{path}:Tank")
    assert "\n" not in str(caught.value)
    assert "mine.py" in str(caught.value)


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(UsageError, match="no file"):
        make_simulator(f"{tmp_path}/nothing.py:Tank")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('{"q": "q_dot"}', '["q"]', "its declaration raised ValueError"),
        ('force_units = {"q": "N"}', 'start = {"q_dot": None}', "its declaration raised TypeError"),
        ('force_units = {"q": "N"}', 'wraps = "q"', "'wraps' must be a list of channels"),
        ('force_units = {"q": "N"}', 'wraps = ("yaw",)', "'yaw' is not among its state channels"),
        (' + forces["q"]', "", "a force on q changes nothing"),
    ],
)
def test_faults_of_a_mechanical_system_are_one_line(tmp_path, old, new, message):
    path = write(tmp_path, GOOD.replace(old, new, 1))
    with pytest.raises(UsageError, match=message) as caught:
        make_simulator(f"{path}:Cart")
    assert "\n" not in str(caught.value)


IN_PLACE = GOOD.replace(
    'return {"level": action', 'u = action["pump"]; u *= 0.5; return {"level": action'
).replace('return {"q_dot"', 'p["mass"] = 2 * p["mass"]; return {"q_dot"')


def test_what_rates_is_given_cannot_be_changed_in_place(tmp_path):
    """A view of the recording that is scaled at every evaluation would halve its actions again and again."""
    path = write(tmp_path, IN_PLACE)
    with pytest.raises(UsageError, match=r"read-only.*copy first \(u = u.copy\(\)\)") as caught:
        make_simulator(f"{path}:Tank")
    assert "mine.py" in str(caught.value)
    assert "\n" not in str(caught.value)
    cart = make_simulator(f"{path}:Cart")
    parameters = cart.defaults()
    cart.rates(np.zeros((1, 2)), np.ones((1, 1)), parameters)
    assert parameters == {"mass": 2.0}


DERIVED = """
from gpsim.simulators import Simulator
from gpsim.simulators import Slider

class Heavy(Slider):
    def rates(self, state, action, parameters, forces=None):
        return 0.5 * super().rates(state, action, parameters, forces)

class Nothing(Simulator):
    def rates(self, state, action, parameters, forces=None):
        return state

    def derivative(self, state, rates):
        return rates

    def measured_rates(self, state, next_state, dt):
        return state
"""


def test_a_simulator_that_derives_from_a_built_in_one_keeps_its_own_physics(tmp_path):
    reference = f"{write(tmp_path, DERIVED)}:Heavy"
    heavy = make_simulator(reference)
    assert heavy.name == reference  # "slider" would find the built-in one
    copy = pickle.loads(pickle.dumps(heavy))
    for simulator in (heavy, copy, make_simulator(heavy.name)):
        rates = simulator.rates(np.zeros((1, 2)), np.full((1, 1), 4.0), {"mass": 2.0})
        np.testing.assert_allclose(rates, [[1.0]])
    with pytest.raises(UsageError, match="its declaration raised AttributeError"):
        make_simulator(f"{tmp_path / 'mine.py'}:Nothing")


def test_a_derived_class_with_a_default_outside_its_bounds_is_one_line(tmp_path):
    text = (
        "from gpsim.simulators.simulator import Parameter\nfrom gpsim.simulators import Slider\n\n"
        "class Heavy(Slider):\n    parameters = {'mass': Parameter('kg', 20.0, 0.1, 10.0, '')}\n"
    )
    with pytest.raises(UsageError, match=r"mine\.py:Heavy: parameters\['mass'\] needs .* got default 20"):
        make_simulator(f"{write(tmp_path, text)}:Heavy")


RAISING = """
from gpsim.simulators import Slider

class Rates(Slider):
    def rates(self, state, action, parameters, forces=None):
        if FAULT:
            raise RuntimeError("boom")
        return super().rates(state, action, parameters, forces)

class Derivative(Slider):
    def derivative(self, state, rates):
        if len(state) > 3:
            raise RuntimeError("boom")
        return super().derivative(state, rates)

class Measured(Slider):
    def measured_rates(self, state, next_state, dt):
        if len(state) > 3:
            raise RuntimeError("boom")
        return super().measured_rates(state, next_state, dt)

class Short(Slider):
    def measured_rates(self, state, next_state, dt):
        return next_state - state

class InPlace(Slider):
    def rates(self, state, action, parameters, forces=None):
        action *= 0.5
        return super().rates(state, action, parameters, forces)
"""


@pytest.mark.parametrize(
    ("fault", "name", "message"),
    [
        ("forces is not None", "Rates", "rates raised RuntimeError: boom"),
        ("False", "Short", r"measured_rates must have shape \(3, 1\), got \(3, 2\)"),
        ("False", "InPlace", "read-only.*copy first"),
    ],
)
def test_a_derived_class_that_is_wrong_at_the_door_is_one_line(tmp_path, fault, name, message):
    path = write(tmp_path, RAISING.replace("FAULT", fault))
    with pytest.raises(UsageError, match=message) as caught:
        make_simulator(f"{path}:{name}")
    assert "mine.py" in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["Rates", "Derivative", "Measured"])
def test_a_derived_class_that_raises_later_is_one_line(tmp_path, name):
    slider = make_simulator(f"{write(tmp_path, RAISING.replace('FAULT', 'len(state) > 3'))}:{name}")
    state, action, dt = np.zeros((5, 2)), np.zeros((5, 1)), np.full(5, 0.1)
    with pytest.raises(UsageError, match=f"mine.py:{name}: {name.lower()}.* raised RuntimeError: boom"):
        slider.measured_rates(state, slider.step(state, action, slider.defaults(), dt, "rk4"), dt)


def test_a_file_that_changes_does_not_change_what_is_under_way(tmp_path):
    path = write(tmp_path, GOOD)
    known = pickle.dumps(make_simulator(f"{path}:Tank"))
    path.write_text(GOOD.replace("0.1, 0.0", "0.2, 0.0"))
    assert pickle.loads(known).defaults() == {"outflow": 0.1}
    assert make_simulator(f"{path}:Tank").defaults() == {"outflow": 0.2}
