"""Simulators from Python: by name, file, class and function."""

import numpy as np
import pytest

import gpsim
from gpsim.errors import UsageError

SLIDER = {
    "state": {"q": "m", "q_dot": "m/s"},
    "action": {"force": "N"},
    "parameters": {"mass": ("kg", 1.0, 0.1, 10.0)},
    "coordinates": {"q": "q_dot"},
}


def cart(state, action, parameters):
    return {"q_dot": action["force"] / parameters["mass"]}


def pushed_cart(state, action, parameters, forces):
    return {"q_dot": (action["force"] + forces["q"]) / parameters["mass"]}


class Cart:
    state = SLIDER["state"]
    action = SLIDER["action"]
    parameters = SLIDER["parameters"]
    coordinates = SLIDER["coordinates"]

    def rates(self, state, action, p, forces):
        return pushed_cart(state, action, p, forces)


def refused(*given, **named):
    with pytest.raises(UsageError) as caught:
        gpsim.load_simulator(*given, **named)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def rates(simulator, force):
    parameters = simulator.defaults({"mass": 2.0})
    return simulator.rates(np.zeros((1, 2)), np.array([[3.0]]), parameters, np.array([[force]]))[0, 0]


def test_every_way_to_the_same_simulator(tmp_path):
    (tmp_path / "mine.py").write_text(
        "class Mine:\n"
        "    state, action = {'q': 'm', 'q_dot': 'm/s'}, {'force': 'N'}\n"
        "    parameters, coordinates = {'mass': ('kg', 1.0, 0.1, 10.0)}, {'q': 'q_dot'}\n"
        "    def rates(self, state, action, p, forces):\n"
        "        return {'q_dot': (action['force'] + forces['q']) / p['mass']}\n"
    )
    known = gpsim.load_simulator("slider")
    ways = ["mine.py:Mine", Cart, Cart(), known]
    for simulator in map(gpsim.load_simulator, ways):
        assert simulator.state.units == known.state.units
        assert rates(simulator, 1.0) == rates(known, 1.0) == 2.0
    assert gpsim.load_simulator(known) is known
    assert gpsim.load_simulator(Cart).name == "Cart()"


def test_a_functions_forces_are_accelerations_unless_it_says_otherwise():
    plain, knowing = gpsim.load_simulator(cart, **SLIDER), gpsim.load_simulator(pushed_cart, **SLIDER)
    assert rates(plain, 1.0) == 2.5
    assert rates(knowing, 1.0) == 2.0
    assert plain.coordinates[0].force_unit == "m/s^2"
    assert (
        gpsim.load_simulator(pushed_cart, **SLIDER, force_units={"q": "N"}).coordinates[0].force_unit == "N"
    )


def test_what_else_a_function_may_be_told():
    def heading(state, action, parameters):
        return {"yaw": action["w"], "x": np.cos(state["yaw"])}

    simulator = gpsim.load_simulator(
        heading,
        state={"x": "m", "yaw": "rad"},
        action={"w": "rad/s"},
        wraps=["yaw"],
        start={"x": 0.5},
        integrator="rk4",
    )
    assert simulator.state.wraps.tolist() == [False, True]
    assert simulator.start == {"x": 0.5}
    assert simulator.integrator == "rk4"


PLAIN = {"state": {"level": "m"}, "action": {"pump": "V"}}


@pytest.mark.parametrize(
    ("given", "named", "said"),
    [
        ("slidder", {}, "unknown simulator 'slidder' (did you mean 'slider'?); registered are: cartpole"),
        ("nothing.py:Tank", {}, "no file nothing.py"),
        ("slider", {"state": {"q": "m"}}, "state go with a function, not with slider"),
        (Cart, {"state": {"q": "m"}}, "only for a function; Cart() already has these"),
        (3, {}, "expected a name, FILE.py:ClassName, a class with `rates`, or a function"),
        (cart, {}, "cart() needs state and action"),
        (lambda s, a: {}, PLAIN, "must take (state, action, parameters), it takes 2"),
        (lambda s, a, p, f: {}, PLAIN, "forces need coordinates={position: velocity}"),
        (lambda s, a, p: {"level": np.zeros((3, 2))}, PLAIN, "rates['level'] must be 3 numbers, one per row"),
        (lambda s, a, p: {"depth": s["level"]}, PLAIN, "rates must return a dictionary with level, got depth"),
        (lambda s, a, p: s["level"], PLAIN, "rates must return a dictionary with level, got ndarray"),
        (lambda s, a, p: {"level": 1 / 0}, PLAIN, "rates raised ZeroDivisionError: division by zero"),
        (lambda s, a, p: {"level": np.log(-s["level"])}, PLAIN, "level_rate is not finite at state and action 0.1"),
        (cart, SLIDER | {"parameters": {"mass": 1.0}}, "'parameters' must be name: (unit, default, low, high)"),
        (cart, SLIDER | {"parameters": {"mass": ("kg", 9.0, 1.0, 2.0)}}, "low <= default <= high"),
        (cart, SLIDER | {"state": "q"}, "state: expected a mapping, as {\"q\": \"m\"}, got 'q'"),
        (cart, SLIDER | {"state": {"q": 1}}, "'state' must be a dictionary of channel: unit"),
        (pushed_cart, SLIDER | {"coordinates": {"y": "q_dot"}}, "'y' is not among its state channels"),
    ],
)  # fmt: skip
def test_what_is_refused_in_one_line(given, named, said):
    assert said in refused(given, **named)


def test_a_simulator_that_lives_here_diagnoses_on_one_core_and_is_given_beside_its_recording(log):
    simulator = gpsim.load_simulator(cart, **SLIDER)
    recording = gpsim.recording_from_frame(log, {"q": "m", "q_dot": "m/s", "force": "N"}, simulator)
    with pytest.raises(UsageError, match=r"cart\(\) exists in this process only; use cores=1"):
        gpsim.diagnose(recording, simulator, cores=2)
    with pytest.raises(UsageError, match=r"the recording is for cart\(\), which is not in a file"):
        gpsim.diagnose(recording)


def test_a_function_that_fails_where_the_recording_has_been(log):
    def shy(state, action, parameters):
        if np.abs(state["q"]).max() > 0.5:
            raise RuntimeError("so far\nnever")
        return cart(state, action, parameters)

    simulator = gpsim.load_simulator(shy, **SLIDER)
    recording = gpsim.recording_from_frame(log, {"q": "m", "q_dot": "m/s", "force": "N"}, simulator)
    with pytest.raises(UsageError) as caught:
        gpsim.diagnose(recording, simulator)
    assert str(caught.value) == "shy(): rates raised RuntimeError: so far never"
