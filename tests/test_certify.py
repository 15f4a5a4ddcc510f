"""The search over action sequences: certifies what can be done, and only that."""

import numpy as np
from gpsim.cli.configuration import resolve

from gpsim.environments import Episodes
from gpsim.policies import balance_search
from gpsim.simulators import SimulatorPlant, make_simulator
from gpsim.stages import certify
from gpsim.stages.stage import Request
from gpsim.targets import FrictionCartPole
from gpsim.tasks import Balance, Start

CARTPOLE = make_simulator("cartpole")
P = CARTPOLE.defaults()
SEARCH = balance_search(9.8, 0.5, width=16)


def solvable(plant, task, states):
    return SEARCH.solvable(plant, task, Start(states, np.empty((len(states), 0))), lambda *_: None)


def test_without_friction_everything_near_upright_is_solvable():
    task = Balance(max_steps=100)
    states = np.random.default_rng(0).uniform(-0.05, 0.05, (10, 4))
    assert solvable(SimulatorPlant(CARTPOLE, P, "euler", 0.02), task, states).all()


def test_what_falls_whatever_one_does_is_not_certified():
    """With both actions the pole leaves the limit at once: no sequence can help, and none may be claimed."""
    states = np.array([[0.0, 0.0, 0.19, 2.0], [0.0, 0.0, 0.0, 0.0]])
    got = solvable(FrictionCartPole(P, 0.9, 0.02), Balance(max_steps=60), states)
    assert got.tolist() == [False, True]


def test_exhaustive_search_agrees_on_short_horizons():
    """An independent oracle: all 2^9 sequences, stepped through the environment."""
    target, task = FrictionCartPole(P, 0.9, 0.02), Balance(max_steps=9, angle_limit=0.08)
    states = np.random.default_rng(3).uniform(-0.07, 0.07, (40, 4)) * np.array([1, 1, 1, 8])
    truth = np.zeros(len(states), dtype=bool)
    sequences = np.array(np.meshgrid(*[[0, 1]] * 9)).reshape(9, -1).T
    for i, state in enumerate(states):
        episodes = Episodes(target, task, len(sequences), np.random.default_rng(0))
        episodes.begin(Start(np.tile(state, (len(sequences), 1)), np.empty((len(sequences), 0))))
        alive = np.ones(len(sequences), dtype=bool)
        for k in range(9):
            alive &= ~episodes.step(sequences[:, k])[1]
        truth[i] = alive.any()
    got = solvable(target, task, states)
    assert 0 < truth.sum() < len(truth)
    assert not (got & ~truth).any()
    assert (got == truth).mean() > 0.95


def test_the_search_reads_the_target_alone(tmp_path):
    """Its artifact does not depend on the simulator, so neither may what is in it."""
    words = ["target=friction", "evaluate.episodes=30", "certify.width=2", "task.max_steps=60"]
    literal = "target.parameters={gravity: 9.8, cart_mass: 1.0, pole_mass: 0.1, pole_half_length: 0.5}"
    other = ["simulator.parameters.gravity=25.0", "simulator.parameters.pole_half_length=4.0", literal]
    written = []
    for more in ([literal], other):
        asked = Request(resolve([*words, *more], None))
        folder = tmp_path / str(len(written))
        folder.mkdir()
        certify.write(asked, certify.recipe(asked), folder)
        written.append((certify.recipe(asked).key, (folder / "certified.csv").read_bytes()))
    assert written[0] == written[1]


def test_the_smoke_budget_searches_less():
    assert resolve(["budget=smoke"], None)["certify"]["width"] < resolve([], None)["certify"]["width"]
