"""Which starts can be solved at all: a beam search over action sequences, with nothing learnt."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gpsim.channels import BoolArray, FloatArray, IntArray
from gpsim.simulators.plant import Plant
from gpsim.tasks import Start, Task

Cost = Callable[[FloatArray], FloatArray]
"""cost(states (B, S)) -> (B,): how close to failure; the beam keeps the lowest."""
Progress = Callable[[int, int, str], None]


@dataclass(frozen=True)
class BeamSearch:
    """Beam search in a deterministic plant with few discrete actions.

    width: how many states a start keeps; cells: edge (S,) of the grid in which only the best state is kept,
    so that the beam stays diverse.
    """

    cost: Cost
    cells: FloatArray
    width: int = 64

    def solvable(self, plant: Plant, task: Task, start: Start, progress: Progress) -> BoolArray:
        """(N,) True where some action sequence survives task.max_steps; False proves nothing."""
        rng = np.random.default_rng(0)  # deterministic plants draw nothing from it
        actions = np.arange(task.action_space.n)  # type: ignore[attr-defined]
        states, owner = start.states.copy(), np.arange(len(start.states))
        for step in range(task.max_steps):
            if step % 50 == 0:
                progress(step, task.max_steps, f"{len(np.unique(owner))} of {len(start.states)} starts alive")
            tried = np.repeat(actions, len(states))
            states, owner = np.tile(states, (len(actions), 1)), np.tile(owner, len(actions))
            states = plant.step(states, task.command(tried), plant.begin(len(states), rng), rng)
            alive = ~task.terminated(states, start.context[owner])
            states, owner = self._prune(states[alive], owner[alive])
        survived = np.zeros(len(start.states), dtype=np.bool_)
        survived[owner] = True
        progress(task.max_steps, task.max_steps, f"{int(survived.sum())} of {len(survived)} starts certified")
        return survived

    def _prune(self, states: FloatArray, owner: IntArray) -> tuple[FloatArray, IntArray]:
        """The `width` cheapest states of every start, one a grid cell."""
        cells = np.floor(states / self.cells).astype(np.int64)
        order = np.lexsort((self.cost(states), *cells.T, owner))
        states, owner, cells = states[order], owner[order], cells[order]
        first = np.ones(len(owner), dtype=np.bool_)
        first[1:] = (owner[1:] != owner[:-1]) | (cells[1:] != cells[:-1]).any(axis=1)
        states, owner = states[first], owner[first]
        order = np.lexsort((self.cost(states), owner))
        states, owner = states[order], owner[order]
        rank = np.arange(len(owner)) - np.searchsorted(owner, owner, side="left")
        keep = rank < self.width
        return states[keep], owner[keep]


def balance_search(gravity: float, half_length: float, width: int) -> BeamSearch:
    """The search for balancing a uniform pole [m/s^2, m] on a cart with state (x, x_dot, theta, theta_dot).

    The cost is how far the pole's unstable mode theta + theta_dot / omega is from upright, omega^2 = 3 g / (4 l), and
    a little of the cart's speed and place.
    """
    omega = np.sqrt(gravity / (4.0 / 3.0 * half_length))

    def cost(states: FloatArray) -> FloatArray:
        mode = states[:, 2] + states[:, 3] / omega
        return np.asarray(np.abs(mode) + 0.02 * np.abs(states[:, 1]) + 0.01 * np.abs(states[:, 0]))

    return BeamSearch(cost, cells=np.array([0.1, 0.02, 0.005, 0.02]), width=width)
