"""Compiled simulations against NumPy's, which are the reference: every family, system, scheme and kind of clock."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from gpsim.channels import Channels
from gpsim.diagnosis.data import Windows
from gpsim.diagnosis.fitting import Hypothesis, Pushes
from gpsim.diagnosis.fitting.simulate import simulate
from gpsim.diagnosis.form.basis import Basis
from gpsim.diagnosis.form.laws import (
    FREE,
    CurveTerm,
    FreeCommand,
    FreeDrive,
    FreeForce,
    FreeGrip,
    FreeRate,
    FreeSlip,
    FreeTurn,
    HatGate,
)
from gpsim.diagnosis.run import Run, Workers
from gpsim.diagnosis.settings import Settings, SharingSettings
from gpsim.effects import FAMILIES, Chain, Effect, Gate, Place, Term
from gpsim.kernels import marching, program_of, tables
from gpsim.simulators import SIMULATORS, Simulator, Slider, make_simulator, reduced, wrapping

CLOSE = 1e-9  # relative to the largest state
SCHEMES = ("fine", "euler", "semi_implicit", "rk4")
COUNT, LENGTH, MEMORY, DT, COPIES = 5, 6, 30, 0.02, 3


def windows_of(simulator: Simulator, rng: np.random.Generator, *, even: bool = True) -> Windows:
    """Windows of nothing in particular; states turn round and cross zero."""
    steps = np.full((COUNT, MEMORY + LENGTH), DT)
    if not even:
        steps *= rng.uniform(0.3, 1.8, steps.shape)
    t = np.cumsum(np.concatenate([np.arange(COUNT)[:, None], steps], axis=1), axis=1)
    states, actions = len(simulator.state), len(simulator.action)
    measured = rng.normal(size=(COUNT, MEMORY + LENGTH + 1, states))
    given = np.repeat(rng.normal(size=(COUNT, 9, actions)) * 2.0, 4, axis=1)
    return Windows(
        measured=measured[:, MEMORY:],
        actions=given[:, MEMORY : MEMORY + LENGTH],
        t=t[:, MEMORY:],
        valid=np.ones((COUNT, LENGTH + 1), dtype=np.bool_),
        before_states=measured[:, :MEMORY],
        before_actions=given[:, :MEMORY],
        before_t=t[:, : MEMORY + 1],
        episode=np.arange(COUNT),
        fresh=np.arange(COUNT) < 2,
        lost=np.arange(COUNT) < 1,
    )


@dataclass(frozen=True)
class Drawn:
    """Terms and one theta a copy of the batch."""

    terms: tuple[Term, ...]
    hypothesis: Hypothesis
    thetas: np.ndarray


def drawn(
    simulator: Simulator, wanted: list[tuple[str, str, str, Gate]], scheme: str, rng: np.random.Generator
) -> Drawn:
    """Terms of these families, places, variants and gates with values in their bounds."""
    hypothesis, columns = Hypothesis(scheme=scheme), []
    for family, on, variant, gate in wanted:
        unit = "1"
        place = Place(on, unit, span=1.0, speed=1.0, reach=2.0, dt=DT, loaded=True, bounds=(0.2, 5.0))
        declared = FAMILIES[family].parameters(place, variant)
        values = [
            np.clip(p.starts[0] + p.scale * rng.uniform(0.0, 2.0, COPIES), p.low, p.high) for p in declared
        ]
        columns += values
        term = Term(
            family, on, {p.name: float(v[0]) for p, v in zip(declared, values, strict=True)}, gate, variant
        )
        hypothesis = hypothesis.plus(term, declared)
    thetas = np.stack(columns, axis=1) if columns else np.empty((COPIES, 0))
    return Drawn(hypothesis.terms, hypothesis, thetas)


def both(
    simulator: Simulator, windows: Windows, what: Drawn, n: int, pushes: Pushes | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """What compiled code and NumPy say."""
    chain = what.hypothesis.chain(simulator, simulator_parameters(simulator), DT)
    assert program_of(chain) is not None, chain
    starts = windows.measured[None, :, 0] + np.linspace(0.0, 0.1, COPIES)[:, None, None]
    starts[:, 2] = 0.0  # at rest
    said = []
    for compiled in (True, False):
        run = Run(settings=Settings(sharing=SharingSettings(compiled=compiled)))
        said.append(simulate(run, chain, windows, starts, what.hypothesis.spread, what.thetas, n, pushes))
    return said[0], said[1]


def simulator_parameters(simulator: Simulator) -> dict[str, float]:
    return simulator.defaults()


def the_same(
    simulator: Simulator, windows: Windows, what: Drawn, n: int, pushes: Pushes | None = None
) -> None:
    got, expected = both(simulator, windows, what, n, pushes)
    assert np.isfinite(expected).all()
    assert np.abs(got - expected).max() <= CLOSE * max(np.abs(expected).max(), 1.0), what.hypothesis.names


def places(name: str) -> list[tuple[str, str, str]]:
    """Every family at every place of a system, with each of its variants."""
    simulator = make_simulator(name)
    return [
        (family, on, variant)
        for family, effect in FAMILIES.items()
        for on in effect.places(simulator)
        for variant in effect.variants
    ]


def region(simulator: Simulator, rng: np.random.Generator) -> dict[str, tuple[float, float]]:
    low = float(rng.uniform(-1.0, 0.3))
    return {str(rng.choice(simulator.state.names)): (low, low + float(rng.uniform(0.2, 1.5)))}


def gates(simulator: Simulator, rng: np.random.Generator) -> list[Gate]:
    """One of each kind."""
    since = 2.0 + MEMORY * DT + 0.05
    return [
        Gate(region(simulator, rng)),
        Gate(since=since),
        Gate(since=since - 1.0, until=since + 0.03),
        Gate(since_episode=2),
    ]


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
    families = [f for f, effect in FAMILIES.items() if effect.site == "actuator"]
    for i, family in enumerate(families):
        for gate in [Gate(), *gates(simulator, rng)]:
            on = str(rng.choice(simulator.action.names))
            wanted = [(family, on, "", gate)]
            if i % 2 and family != "actuator_delay":
                wanted.append(("actuator_delay", on, "", Gate()))
            what = drawn(simulator, wanted, SCHEMES[i % 4] if i % 3 else "fine", rng)
            the_same(simulator, windows, what, 1 + i % 3)


@pytest.mark.parametrize("name", SIMULATORS)
def test_a_push_on_a_rate_in_one_transition(name: str) -> None:
    rng, simulator = np.random.default_rng(5), make_simulator(name)
    windows, rates = windows_of(simulator, rng), len(simulator.rate)
    for i, (family, on, variant) in enumerate(places(name)):
        gate = Gate(region(simulator, rng)) if FAMILIES[family].needs_region else Gate()
        what = drawn(simulator, [(family, on, variant, gate)], SCHEMES[i % 4], rng)
        when = rng.integers(LENGTH, size=COPIES * COUNT)
        the_same(simulator, windows, what, 1 + i % 2, Pushes(when, i % rates, rates, 3.0))


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("name", SIMULATORS)
def test_random_chains(name: str, seed: int) -> None:
    rng = np.random.default_rng([seed, 7])
    simulator = make_simulator(name)
    every = places(name)
    for scheme in SCHEMES:
        windows = windows_of(simulator, rng, even=bool(rng.random() < 0.5))
        wanted = []
        for i in rng.choice(len(every), min(4, len(every)), replace=False):
            family, on, variant = every[i]
            able = gates(simulator, rng) if FAMILIES[family].gated else []
            gate = able[rng.integers(len(able))] if able and rng.random() < 0.5 else Gate()
            gate = Gate(region(simulator, rng)) if FAMILIES[family].needs_region else gate
            wanted.append((family, on, variant, gate))
        the_same(simulator, windows, drawn(simulator, wanted, scheme, rng), int(rng.integers(1, 4)))


def curves(name: str, rng: np.random.Generator) -> list[Term]:
    """Free laws at every site that has compiled ones, some behind gates that open gradually."""
    simulator = make_simulator(name)
    knots, jump = (-1.0, -0.2, 0.4, 1.5), (-1.0, 0.0, 0.0, 1.2)
    one, two = Basis((knots,)), Basis((knots, (-0.7, 0.1, 0.9)))
    along = simulator.state.names[0]
    gate = [Gate(), HatGate(along=along, knots=knots, place=1), HatGate(since=2.62, along=along, knots=knots)]
    out: list[tuple[Effect, str, Basis]] = []
    for c in simulator.coordinates[:2]:
        out += [
            (FreeForce(one, of_speed=True), c.name, one),
            (FreeForce(one, False, wraps=True), c.name, one),
        ]
        dry = Basis((jump,))
        out += [(FreeGrip(dry, of_speed=True), c.name, dry), (FreeGrip(one, of_speed=False), c.name, one)]
    inputs = (0, len(simulator.state))
    out.append((FreeRate(two, 0, inputs, (True, False)), simulator.rate.names[0], two))
    out.append((FreeDrive(two, 0, inputs, (False, False)), simulator.action.names[0], two))
    if not simulator.coordinates:
        laws = (
            Term("understeer", "vehicle", {"gradient": 0.3}),
            Term("steering_bias", "vehicle", {"curvature": 0.2}),
        )
        out += [(FreeTurn(two, laws), "vehicle", two), (FreeTurn(two), "vehicle", two)]
        out.append((FreeSlip(two, (Term("lateral_slip", "vehicle", {"slip": 0.2}),)), "vehicle", two))
    return [
        CurveTerm(FREE, on, {n: float(rng.uniform(0.0, 0.5)) for n in basis.names}, gate[i % 3], "", law)
        for i, (law, on, basis) in enumerate(out)
    ]


@pytest.mark.parametrize("name", SIMULATORS)
def test_free_curves(name: str) -> None:
    rng = np.random.default_rng(3)
    simulator = make_simulator(name)
    windows = windows_of(simulator, rng)
    for i, term in enumerate(curves(name, rng)):
        hypothesis = Hypothesis((term,), ((),), SCHEMES[i % 4] if i % 2 else "fine")
        the_same(simulator, windows, Drawn(hypothesis.terms, hypothesis, np.empty((COPIES, 0))), 2)


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
        simulate(Run(Workers(count)), chain, windows, starts, what.hypothesis.spread, what.thetas, 2)
        for count in (1, 3)
    ]
    assert said[0].tobytes() == said[1].tobytes()


OF_BODIES = {"armature", "gravity_tilt", "payload"}  # for simulators that own their steps
COMPILED = set(FAMILIES) - OF_BODIES


def test_which_families_are_compiled() -> None:
    """All of the catalogue; a family that is new falls back to NumPy until somebody writes it down here."""
    known = {*tables.FORCES, *tables.DRY, *tables.PARAMETERS, *tables.TWISTS}
    sites = {
        f for f, effect in FAMILIES.items() if effect.site in ("actuator", "sensor") and f not in OF_BODIES
    }  # arrays, before and after
    assert known | sites == COMPILED
    assert set(SIMULATORS.values()) == set(tables.SYSTEMS)


def test_what_has_no_compiled_form_falls_back() -> None:
    simulator = make_simulator("slider")
    basis = Basis(((-1.0, 1.0),))
    drawn_in = Gate({"q": (0.0, 1.0)})
    looking = CurveTerm(FREE, "force", {"c0": 0.1, "c1": 0.2}, drawn_in, "", FreeCommand(basis))
    assert program_of(Chain(simulator, simulator.defaults(), (looking,), "fine", DT)) is None

    class Own(Slider):
        """A user's."""

    assert program_of(Chain(Own(), simulator.defaults(), (), "fine", DT)) is None
