"""Chains and windows drawn at random, and what compiled code and NumPy say of them."""

from dataclasses import dataclass

import numpy as np

from gpsim.diagnosis.data import Windows
from gpsim.diagnosis.fitting import Hypothesis
from gpsim.diagnosis.fitting.simulate import simulate
from gpsim.diagnosis.run import Run
from gpsim.diagnosis.settings import Settings, WindowSettings
from gpsim.effects import FAMILIES, Gate, Place, Term
from gpsim.kernels import program_of
from gpsim.simulators import Simulator, make_simulator

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


def both(simulator: Simulator, windows: Windows, what: Drawn, n: int) -> tuple[np.ndarray, np.ndarray]:
    """What compiled code and NumPy say."""
    chain = what.hypothesis.chain(simulator, simulator_parameters(simulator), DT)
    assert program_of(chain) is not None, chain
    starts = windows.measured[None, :, 0] + np.linspace(0.0, 0.1, COPIES)[:, None, None]
    starts[:, 2] = 0.0  # at rest
    said = []
    for compiled in (True, False):
        run = Run(settings=Settings(windows=WindowSettings(compiled=compiled)))
        said.append(simulate(run, chain, windows, starts, what.hypothesis.spread, what.thetas, n))
    return said[0], said[1]


def simulator_parameters(simulator: Simulator) -> dict[str, float]:
    return simulator.defaults()


def the_same(simulator: Simulator, windows: Windows, what: Drawn, n: int) -> None:
    got, expected = both(simulator, windows, what, n)
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
