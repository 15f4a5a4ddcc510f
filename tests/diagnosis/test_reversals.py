"""How long ago commands and velocities turned round, against a look at every sample."""

from types import SimpleNamespace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from gpsim.diagnosis.data.windows import since_reversal
from gpsim.simulators import make_simulator

BACK, DT = 12, 0.02
LEVELS = arrays(np.float64, BACK + 1, elements=st.sampled_from([-2.0, -1.0, 0.0, 1.0, 2.0]))


def windows(commands, velocities):
    """One window at the end of both courses (BACK + 1,)."""
    t = DT * np.arange(BACK + 2)
    states = np.stack([np.zeros(BACK + 1), velocities], axis=1)
    return SimpleNamespace(
        before_t=t[None, : BACK + 1],
        t=t[None, BACK:],
        before_actions=commands[None, :BACK, None],
        actions=commands[None, BACK:, None],
        before_states=states[None, :BACK],
        measured=np.repeat(states[None, BACK:], 2, axis=1),
    )


def last_turn(signs):
    """The index at which a sign differs from the one before it that was not 0; 0 where none does."""
    known, turned = 0.0, 0
    for k, sign in enumerate(signs):
        if sign and known and sign != known:
            turned = k
        known = sign or known
    return turned


@given(LEVELS, LEVELS)
@settings(max_examples=200, deadline=None)
def test_it_is_the_time_since_the_last_turn(commands, velocities):
    found = since_reversal(windows(commands, velocities), make_simulator("slider"))
    changes = np.concatenate([[0.0], np.sign(np.diff(commands))])
    np.testing.assert_allclose(found["force"], [DT * (BACK - last_turn(changes))], atol=1e-6)
    np.testing.assert_allclose(found["q_dot"], [DT * (BACK - last_turn(np.sign(velocities)))], atol=1e-6)
