"""What a beam keeps of the states that it has grown."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gpsim.policies import Beam, BeamSearch

CELLS = np.array([0.1, 0.5])


def cost(states):
    return np.abs(states[:, 0]) + 0.01 * np.abs(states[:, 1])


def kept(states, memory, owner, width):
    """The definition: an owner's states from the cheapest on, no grid cell twice, `width` at most."""
    out = []
    for one in np.unique(owner):
        seen, rows = set(), np.flatnonzero(owner == one)
        for row in rows[np.argsort(cost(states)[rows], kind="stable")]:
            cell = (row,) if memory else tuple(np.floor(states[row] / CELLS))
            if cell not in seen and len(seen) < width:
                seen.add(cell)
                out.append(row)
    return out


@settings(deadline=None)
@given(seed=st.integers(0, 2**32 - 1), count=st.integers(0, 60), width=st.integers(1, 8), late=st.booleans())
def test_the_cheapest_of_every_owner_one_a_cell(seed, count, width, late):
    rng = np.random.default_rng(seed)
    states = rng.uniform(-1, 1, (count, 2))
    memory = {"told": rng.uniform(-1, 1, (count, 1))} if late else {}
    owner = rng.integers(0, 7, count) * 3  # in any order, some owners have none
    got = BeamSearch(cost, CELLS, width)._pruned(Beam(states, memory, owner))
    rows = kept(states, memory, owner, width)
    np.testing.assert_array_equal(got.states, states[rows])
    np.testing.assert_array_equal(got.owner, owner[rows])
    assert all(np.array_equal(got.memory[key], values[rows]) for key, values in memory.items())


@pytest.mark.parametrize("far", [1e6, -1e12])
def test_cells_far_from_one_another_are_not_taken_for_one(far):
    states = np.array([[0.0, 0.0], [0.0, far], [far, 0.0], [far, far]])
    got = BeamSearch(cost, CELLS, 4)._pruned(Beam(states, {}, np.zeros(4, dtype=np.int64)))
    assert len(got.states) == 4
