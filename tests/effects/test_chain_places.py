"""One term on several actions: commands over one bus come equally late."""

import numpy as np
from mjcf_models import DOUBLE, written

from gpsim.effects import Chain, Term, from_json, to_json
from gpsim.mjcf import load_mjcf

LATE = 0.013  # s


def test_a_term_on_two_actions_is_two_terms_of_the_same_values(tmp_path):
    simulator = load_mjcf(written(tmp_path, DOUBLE))
    both = Term("actuator_delay", "m1", {"delay": LATE}, also=("m2",))
    commands = np.random.default_rng(0).normal(size=(3, 8, 2))
    states, step, t = np.zeros((3, 9, 4)), np.full((3, 8), 0.01), np.tile(0.01 * np.arange(8), (3, 1))
    came = []
    for terms in ((both,), both.apart):
        chain = Chain(simulator, simulator.defaults(), terms, "fine", 0.01)
        values = [{"delay": np.full(3, LATE)} for _ in terms]
        memory = chain.actuation.rest(3, 0.01)
        first = chain.commands(commands[:, :4], states[:, :5], values, memory, step[:, :4], t[:, :4])
        rest = chain.commands(commands[:, 4:], states[:, 4:], values, memory, step[:, 4:], t[:, 4:])
        came.append(np.concatenate([first, rest], axis=1))
    assert np.array_equal(*came)
    assert not np.array_equal(came[0], commands)


def test_a_term_on_two_actions_is_kept_as_it_is():
    both = Term("actuator_delay", "m1", {"delay": LATE}, also=("m2",))
    assert from_json(to_json(both)) == both
    assert "also" not in to_json(both.apart[0])
