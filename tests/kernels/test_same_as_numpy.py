"""Compiled simulations against NumPy's, which are the reference: every family, system, scheme and kind of clock."""

from dataclasses import replace

import numpy as np
import pytest
from drawn_chains import COPIES, DT, SCHEMES, Drawn, both, drawn, gates, places, region, the_same, windows_of

from gpsim.channels import Channels
from gpsim.diagnosis.fitting import Hypothesis
from gpsim.diagnosis.fitting.simulate import simulate
from gpsim.diagnosis.run import Run
from gpsim.effects import (
    FAMILIES,
    ActuatorEffect,
    BristleEffect,
    Chain,
    ElasticDrive,
    Gate,
    ModelEffect,
    Place,
    SensorEffect,
    Shape,
    Term,
    declared,
)
from gpsim.kernels import marching, program_of, tables
from gpsim.simulators import SIMULATORS, Slider, make_simulator, reduced, wrapping


@pytest.mark.parametrize("even", [True, False])
@pytest.mark.parametrize("name", SIMULATORS)
def test_every_family_alone(name: str, even: bool) -> None:
    rng = np.random.default_rng(1)
    simulator = make_simulator(name)
    windows = windows_of(simulator, rng, even=even)
    for i, (family, on, variant) in enumerate(places(name)):
        gate = Gate(region(simulator, rng)) if FAMILIES[family].needs_region else Gate()
        what = drawn(simulator, [(family, on, variant, gate)], SCHEMES[i % 4] if i % 2 else "fine", rng)
        the_same(simulator, windows, what, 1 + i % 3)


@pytest.mark.parametrize("even", [True, False])
@pytest.mark.parametrize("name", SIMULATORS)
def test_actuators_one_after_another_behind_every_gate(name: str, even: bool) -> None:
    rng = np.random.default_rng(4)
    simulator = make_simulator(name)
    windows = windows_of(simulator, rng, even=even)
    families = [f for f, e in FAMILIES.items() if e.site == "actuator" and e.places(simulator)]
    for i, family in enumerate(families):
        for gate in [Gate(), *(gates(simulator, rng) if FAMILIES[family].gated else [])]:
            on = str(rng.choice(simulator.action.names))
            wanted = [(family, on, "", gate)]
            if i % 2 and family != "actuator_delay":
                wanted.append(("actuator_delay", on, "", Gate()))
            what = drawn(simulator, wanted, SCHEMES[i % 4] if i % 3 else "fine", rng)
            the_same(simulator, windows, what, 1 + i % 3)


@pytest.mark.parametrize("seen", ["at once", "late", "gated"])
@pytest.mark.parametrize("even", [True, False])
@pytest.mark.parametrize("late", ["actuator_delay", "clock_drift"])
def test_all_actuators_on_one_way(late: str, even: bool, seen: str) -> None:
    """Behind a delay each gets several pieces of a substep; whole control steps lead up to windows, unless sensors
    look at what was before them, or a gate at when it is."""
    rng, simulator = np.random.default_rng(7), make_simulator("unicycle")
    windows = windows_of(simulator, rng, even=even)
    rest = [f for f, e in FAMILIES.items() if isinstance(e, ActuatorEffect)]
    rest = [f for f in rest if f not in ("actuator_delay", "clock_drift", "battery_sag")]
    held = [f for f in rest if f != "actuator_rate_limit"]  # up to the last one, whole control steps do
    for families in ([late, *rest], [late, *held], [*rest, "battery_sag"], [late]):
        wanted = [(family, on, "", Gate()) for family in families for on in simulator.action.names]
        if seen == "late":
            wanted.append(("sensor_delay", "x", "", Gate()))
        if seen == "gated":
            wanted[-1] = (*wanted[-1][:3], Gate(since=2.65))
        if FAMILIES[families[-1]].gated or seen != "gated":
            the_same(simulator, windows, drawn(simulator, wanted, "fine", rng), 2)


def test_commands_of_a_row_do_not_depend_on_other_rows() -> None:
    """A delay cuts substeps into as many pieces as the row needs that needs most: others have none of later commands,
    which would move what has play in it."""
    rng, simulator = np.random.default_rng(0), make_simulator("slider")
    values = {"actuator_delay": {"delay": 0.03}, "actuator_backlash": {"half_width": 0.2}}
    terms = tuple(Term(family, "force", one) for family, one in values.items())
    chain = Chain(simulator, simulator.defaults(), terms, "fine", DT)
    step = np.stack([np.tile([0.025, 0.02], 30), 0.02 * rng.uniform(0.05, 2.0, 60)])
    given, t = rng.normal(size=(2, 60, 1)), np.cumsum(step, axis=1) - step
    said = []
    for rows in (slice(1), slice(2)):
        count = len(step[rows])
        each = [{name: np.full(count, value) for name, value in one.items()} for one in values.values()]
        memory = chain.actuation.rest(count, DT)
        states = np.empty((count, 61, 0))
        said.append(chain.commands(given[rows], states, each, memory, step[rows], t[rows])[0])
    np.testing.assert_array_equal(*said)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("name", SIMULATORS)
def test_random_chains(name: str, seed: int) -> None:
    rng = np.random.default_rng([seed, 8])  # steering at right angles makes rounding large: no such draw
    simulator = make_simulator(name)
    every = places(name)
    for scheme in SCHEMES:
        windows = windows_of(simulator, rng, even=bool(rng.random() < 0.5))
        wanted = []
        for i in rng.choice(len(every), min(4, len(every)), replace=False):
            family, on, variant = every[i]
            if (family, on) in [term[:2] for term in wanted]:
                continue  # two variants of one law are no hypothesis
            able = gates(simulator, rng) if FAMILIES[family].gated else []
            gate = able[rng.integers(len(able))] if able and rng.random() < 0.5 else Gate()
            gate = Gate(region(simulator, rng)) if FAMILIES[family].needs_region else gate
            wanted.append((family, on, variant, gate))
        the_same(simulator, windows, drawn(simulator, wanted, scheme, rng), int(rng.integers(1, 4)))


def measured(name: str, rng: np.random.Generator) -> list[Term]:
    """Measured curves at every site that a system has."""
    simulator = make_simulator(name)
    axis, jump = (-1.0, -0.2, 0.4, 1.5), (-1.0, 0.0, 0.0, 1.2)

    def term(family: str, on: str, variant: str, *axes: tuple[float, ...], wraps: bool = False) -> Term:
        size = int(np.prod([len(a) for a in axes]))
        heights = rng.uniform(0.0, 0.5, size)
        if (
            variant == "friction"
        ):  # of what is held the sign of a speed that is 0 but for rounding decides nothing
            heights[1] = heights[2]
        shape = Shape(axes, tuple(float(y) for y in heights), wraps)
        return Term(family, on, shape.values(3.0) | {"scale": 0.7}, variant=variant)

    out = [term("actuator_curve", simulator.action.names[0], "", axis)]
    out.append(term("sensor_curve", simulator.state.names[0], "", axis))
    for c in simulator.coordinates[:2]:
        out += [term("force_curve", c.name, "speed", axis), term("force_curve", c.name, "friction", jump)]
        out.append(term("force_curve", c.name, "position", axis, wraps=True))
    if not simulator.coordinates:
        out += [term("rate_curve", "vehicle", variant, axis, jump) for variant in ("w", "v_lateral")]
    return out


@pytest.mark.parametrize("name", SIMULATORS)
def test_measured_curves(name: str) -> None:
    """Each as large as a copy of the batch says."""
    rng = np.random.default_rng(12)
    simulator = make_simulator(name)
    windows = windows_of(simulator, rng)
    for i, term in enumerate(measured(name, rng)):
        scheme = SCHEMES[i % 4] if i % 2 else "fine"
        hypothesis = Hypothesis((term,), (declared(term.effect, Place(term.on, "1")),), scheme)
        thetas = rng.uniform(0.5, 1.5, (COPIES, 1))
        the_same(simulator, windows, Drawn(hypothesis.terms, hypothesis, thetas), 2)


@pytest.mark.parametrize("held", [True, False])
def test_a_coordinate_that_is_held_or_left_out(held: bool) -> None:
    rng = np.random.default_rng(5)
    simulator = reduced(make_simulator("cartpole"), {"x": 0.2, "x_dot": 0.0}, ["x"] if held else [])
    windows = windows_of(simulator, rng)
    for family in ("viscous_friction", "coulomb_friction", "stribeck_friction", "spring", "constant_force"):
        what = drawn(
            simulator,
            [(family, "theta", "", Gate()), ("parameter_offset", "pole_mass", "", Gate())],
            "fine",
            rng,
        )
        the_same(simulator, windows, what, 2)


def test_angles_that_only_the_recording_wraps() -> None:
    rng = np.random.default_rng(6)
    pendulum = make_simulator("pendulum")
    simulator = wrapping(pendulum, Channels.of(pendulum.state.units, wraps=("theta",)))
    windows = windows_of(simulator, rng)
    windows = replace(windows, measured=windows.measured + np.array([9.0, 0.0]))
    gate = Gate({"theta": (2.0, 3.5)})
    the_same(simulator, windows, drawn(simulator, [("viscous_friction", "theta", "", gate)], "fine", rng), 2)


def test_states_that_fly_off_stay_within_bounds() -> None:
    rng = np.random.default_rng(8)
    simulator = make_simulator("slider")
    windows = windows_of(simulator, rng)
    what = drawn(simulator, [("quadratic_drag", "q", "", Gate())], "euler", rng)
    got, expected = both(simulator, windows, replace(what, thetas=np.full((COPIES, 1), 1e6)), 1)
    assert np.abs(expected).max() == 1e6
    np.testing.assert_allclose(got, expected)


def test_threads_make_the_same_bytes(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(9)
    simulator = make_simulator("cartpole")
    windows = windows_of(simulator, rng)
    what = drawn(
        simulator, [("coulomb_friction", "x", "", Gate()), ("sensor_delay", "x", "", Gate())], "fine", rng
    )
    chain = what.hypothesis.chain(simulator, simulator.defaults(), DT)
    starts = np.repeat(windows.measured[None, :, 0], COPIES, axis=0)
    monkeypatch.setattr(marching, "WORTH_A_THREAD", 10)
    said = [
        simulate(Run(threads=count), chain, windows, starts, what.hypothesis.spread, what.thetas, 2)
        for count in (1, 3)
    ]
    assert said[0].tobytes() == said[1].tobytes()


OF_BODIES = {f for f, e in FAMILIES.items() if isinstance(e, ModelEffect)}  # simulators own their steps
COMPILED = (
    set(FAMILIES) - OF_BODIES - {"overflow", "spillover"}
)  # which acts on users' own simulators, in Python anyway


def test_which_families_are_compiled() -> None:
    """All of the catalogue; a family that is new falls back to NumPy until somebody writes it down here."""
    laws = {f for f, effect in FAMILIES.items() if type(effect).law in tables.LAWS}
    others = {f for f, e in FAMILIES.items() if isinstance(e, SensorEffect | BristleEffect | ElasticDrive)}
    assert laws | (others - OF_BODIES) == COMPILED
    assert set(SIMULATORS.values()) == set(tables.SYSTEMS)


def test_what_may_be_zero_differs_by_a_sum() -> None:
    simulator, rng = make_simulator("servo_joint"), np.random.default_rng(2)
    place = Place("gravity_torque", "N m", additive=True, bounds=(-1.0, 1.0), dt=DT)
    declared = FAMILIES["parameter_offset"].parameters(place)
    hypothesis = Hypothesis().plus(Term("parameter_offset", place.on, {"offset": 0.3}), declared)
    what = Drawn(hypothesis.terms, hypothesis, np.array([[0.3], [0.0], [0.7]]))
    the_same(simulator, windows_of(simulator, rng), what, 2)


def test_what_has_no_compiled_form_falls_back() -> None:
    simulator = make_simulator("slider")

    class Own(Slider):
        """A user's."""

    assert program_of(Chain(Own(), simulator.defaults(), (), "fine", DT)) is None
