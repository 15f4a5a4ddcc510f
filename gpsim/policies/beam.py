"""Beam search over action sequences: what can be done at all, with nothing learnt."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gpsim.channels import BoolArray, FloatArray, IntArray
from gpsim.simulators import Memory, Plant
from gpsim.tasks import Actions, Start, Task

Cost = Callable[[FloatArray], FloatArray]
"""cost(states (B, S)) -> (B,): how close to failure; the beam keeps the lowest."""
Progress = Callable[[int, int, str], None]
SCATTER = 6364136223846793005
"""An odd number without pattern (Knuth, MMIX): powers of it keep the cells' coordinates apart."""


@dataclass(frozen=True)
class Beam:
    """States (B, S) that are followed, what the plant remembers of each, and whose each is: owner (B,)."""

    states: FloatArray
    memory: Memory
    owner: IntArray

    def take(self, rows: IntArray | BoolArray) -> Beam:
        """Copies of some of them."""
        memory = {key: values[rows] for key, values in self.memory.items()}
        return Beam(self.states[rows], memory, self.owner[rows])


@dataclass(frozen=True)
class BeamSearch:
    """Beam search in a plant with few discrete actions; what a plant draws at random is drawn for each state anew.

    width: how many states an owner keeps; cells: edge (S,) of the grid in which only the best state is kept,
    so that the beam stays diverse (in a plant that remembers, equal states may go different ways: all are kept).
    """

    cost: Cost
    cells: FloatArray
    width: int = 64

    def solvable(self, plant: Plant, task: Task, start: Start, progress: Progress) -> BoolArray:
        """(N,) True where some action sequence survives task.max_steps; False proves nothing."""
        rng, count = np.random.default_rng(0), len(start.states)  # deterministic plants draw nothing from it
        beam = Beam(start.states.copy(), plant.begin(count, rng), np.arange(count))
        for step in range(task.max_steps):
            if step % 50 == 0:
                alive = len(np.unique(beam.owner))
                progress(step, task.max_steps, f"{alive} of {count} starts alive")
            beam = self.grown(plant, task, beam, start.context, rng)
        survived = np.zeros(count, dtype=np.bool_)
        survived[beam.owner] = True
        progress(task.max_steps, task.max_steps, f"{int(survived.sum())} of {count} starts certified")
        return survived

    def grown(
        self, plant: Plant, task: Task, beam: Beam, context: FloatArray, rng: np.random.Generator
    ) -> Beam:
        """The beam a step on, every action tried from every state; context (owners, K)."""
        actions = np.arange(task.action_space.n)  # type: ignore[attr-defined]
        every = beam.take(np.tile(np.arange(len(beam.states)), len(actions)))
        return self.played(plant, task, every, np.repeat(actions, len(beam.states)), context, rng)

    def played(
        self,
        plant: Plant,
        task: Task,
        beam: Beam,
        actions: Actions,
        context: FloatArray,
        rng: np.random.Generator,
    ) -> Beam:
        """What survives of the beam after these actions (B,), and of it the best of every owner."""
        states = plant.step(beam.states, task.command(actions), beam.memory, rng)
        beam = Beam(states, beam.memory, beam.owner)
        return self._pruned(beam.take(~task.terminated(states, context[beam.owner])))

    def _pruned(self, beam: Beam) -> Beam:
        """The `width` cheapest states of every owner, one a grid cell where the state alone decides what follows."""
        order, place = _by_owner(beam.owner)
        cost = np.full(place.shape, np.inf)
        cost[place] = self.cost(beam.states)[order]
        cheapest = np.argsort(cost, axis=1, kind="stable")
        kept = np.take_along_axis(place, cheapest, axis=1)
        if not beam.memory:
            cells = np.zeros(place.shape, dtype=np.int64)
            cells[place] = self._cells(beam.states)[order]
            kept &= _first_of_each(np.take_along_axis(cells, cheapest, axis=1))
        kept &= np.cumsum(kept, axis=1) <= self.width
        rows = np.zeros(place.shape, dtype=np.int64)
        rows[place] = order
        return beam.take(np.take_along_axis(rows, cheapest, axis=1)[kept])

    def _cells(self, states: FloatArray) -> IntArray:
        """(B,): a number for the grid cell of each state, as good as certain to differ from those of other cells."""
        number = np.zeros(len(states), dtype=np.int64)
        for channel in np.floor(states / self.cells).T:
            number = number * SCATTER + channel.astype(np.int64)  # modulo 2^64
        return number


def _by_owner(owner: IntArray) -> tuple[IntArray, BoolArray]:
    """The order (B,) that brings each owner's states together, and a table (owners, most of one) with their places.

    Sorting the short rows of such a table takes a fifth of the time of sorting everything.
    """
    order = np.argsort(owner, kind="stable")
    _, counts = np.unique(owner[order], return_counts=True)
    return order, np.arange(counts.max(initial=0)) < counts[:, None]


def _first_of_each(numbers: IntArray) -> BoolArray:
    """Where a number comes for the first time in its row."""
    order = np.argsort(numbers, axis=1, kind="stable")
    along = np.take_along_axis(numbers, order, axis=1)
    first = np.ones(numbers.shape, dtype=np.bool_)
    first[:, 1:] = along[:, 1:] != along[:, :-1]
    out = np.empty_like(first)
    np.put_along_axis(out, order, first, axis=1)
    return out


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
