"""One law in two sets of words: a force, or a coefficient of the normal force."""

import numpy as np
import pytest

from gpsim.collecting import collect_episodes
from gpsim.diagnosis.catalogue import candidates
from gpsim.diagnosis.hypothesis import Hypothesis
from gpsim.diagnosis.preparing import prepare
from gpsim.diagnosis.replacing import swapped
from gpsim.diagnosis.shooting import fit
from gpsim.effects import Gate
from gpsim.recordings import Recording
from gpsim.simulators import make_simulator
from gpsim.targets import FrictionCartPole
from gpsim.tasks import Balance

CARTPOLE = make_simulator("cartpole")
P = CARTPOLE.defaults()


@pytest.mark.parametrize(
    ("family", "values", "gate"),
    [
        ("coulomb_friction", [9.7], Gate()),
        ("coulomb_friction", [9.7], Gate(since=-1.0)),
        ("stribeck_friction", [9.7, 9.7, 0.1], Gate()),
    ],
    ids=["plain", "since", "special"],
)
def test_a_force_is_tried_as_a_coefficient(family, values, gate):
    """The search may prefer the force on its few windows: the right words have to be found from there."""
    task, rng = Balance(), np.random.default_rng(0)
    target = FrictionCartPole(P, 0.9, 0.02)
    lean = lambda o: (o[:, 2] + 0.5 * o[:, 3] > 0).astype(int)  # noqa: E731
    episodes = collect_episodes(target, task, lean, 12, rng)
    recording = Recording("cartpole", CARTPOLE.state, CARTPOLE.action, episodes, 0.02, P, "euler")
    problem = prepare(recording, CARTPOLE, P).everything
    offers = candidates(recording, CARTPOLE, P)
    force = next(c for c in offers if c.identity == (family, "x") and c.variant == "")
    hypothesis = Hypothesis(scheme="euler").plus(force.term(values), force.declared).gated(0, gate)
    leader = fit(problem, hypothesis, problem.windows.measured[:, 0], iterations=12)
    best = min(swapped(problem, leader, 0, offers), key=lambda f: f.objective)
    assert best.objective < leader.objective - 100
    assert best.hypothesis.terms[0].values["coefficient"] == pytest.approx(0.9, abs=1e-4)
