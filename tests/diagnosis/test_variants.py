"""One law in two sets of words: a force, or a coefficient of the normal force."""

import numpy as np
import pytest

from gpsim.diagnosis.diagnosis import diagnose
from gpsim.environments import collect_episodes
from gpsim.recordings import Recording
from gpsim.simulators import make_simulator
from gpsim.targets import FrictionCartPole
from gpsim.tasks import Balance

CARTPOLE = make_simulator("cartpole")
P = CARTPOLE.defaults()


def chattering(episodes, seed):
    """A cart whose friction chatters in the base simulator's own steps, leaning where the pole leans."""
    lean = lambda o: (o[:, 2] + 0.5 * o[:, 3] > 0).astype(int)  # noqa: E731
    target = FrictionCartPole(P, 0.9, 0.02)
    parts = collect_episodes(target, Balance(), lean, episodes, np.random.default_rng(seed))
    return Recording("cartpole", CARTPOLE.state, CARTPOLE.action, parts, 0.02, P, "euler")


def test_chattering_friction_is_found_in_two_short_episodes():
    """A fit in coarse steps gets stuck; a third of such recordings were once given other names."""
    report = diagnose(chattering(2, seed=3), CARTPOLE, P, np.random.default_rng(0)).diagnosis
    (effect,) = report.effects
    assert (report.verdict, effect.family, effect.on) == ("named", "coulomb_friction", "x")
    assert effect.parameters["coefficient"].value == pytest.approx(0.9, abs=1e-4)
