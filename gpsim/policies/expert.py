"""An expert that looks ahead: what each action costs at best, by a beam search that ends in a critic's judgement."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gpsim.channels import FloatArray
from gpsim.policies.beam import Beam, BeamSearch
from gpsim.simulators import Memory, Plant
from gpsim.tasks import Task

Worth = Callable[[NDArray[np.float32]], FloatArray]
"""worth(observations (B, O)) -> (B,): the share of the highest return that a policy can still expect."""
NEARNESS = 0.3  # of the search's cost beside the critic's judgement
FAILS = 2.0  # cost from which on every sequence that was followed fails


@dataclass(frozen=True)
class Visited:
    """Where a policy came by: states (N, S), what the plant remembered, contexts (N, K), observations (N, O)."""

    states: FloatArray
    memory: Memory
    context: FloatArray
    observations: NDArray[np.float32]

    def __len__(self) -> int:
        return len(self.states)


@dataclass(frozen=True)
class Expert:
    """Looks `horizon` steps ahead in a simulator, to states from which a policy is worth most by its critic.

    It finds what exploration at random does not: sequences of which every step alone looks wrong.
    """

    model: Plant
    task: Task
    search: BeamSearch
    horizon: int
    worth: Worth

    def costs(self, at: Visited, rng: np.random.Generator) -> FloatArray:
        """(N, A): of each action, what the best sequence that begins with it leads to.

        What is missing to the highest return, and a little of how close to failure, less than FAILS; between FAILS and
        one more where every sequence that was followed fails, the more the sooner.
        """
        actions: int = self.task.action_space.n  # type: ignore[attr-defined]
        count = len(at)
        rows = np.tile(np.arange(count), actions)
        context, out = at.context[rows], np.full(actions * count, np.nan)
        beam = Beam(at.states, at.memory, np.arange(count)).take(rows)
        beam = Beam(beam.states, beam.memory, np.arange(len(rows)))
        first = np.repeat(np.arange(actions), count)
        for step in range(self.horizon):
            lives = np.isnan(out)
            if step == 0:
                beam = self.search.played(self.model, self.task, beam, first, context, rng)
            else:
                beam = self.search.grown(self.model, self.task, beam, context, rng)
            lives[beam.owner] = False
            out[lives] = FAILS + (self.horizon - step) / self.horizon  # alive before this step, and no longer
        seen = self.task.observe(self.model.measure(beam.states, beam.memory, rng), context[beam.owner])
        cost = NEARNESS * self.search.cost(beam.states) + 1.0 - self.worth(seen)
        out[beam.owner] = np.nextafter(FAILS, 0.0)
        np.minimum.at(out, beam.owner, cost)
        return np.ascontiguousarray(out.reshape(actions, count).T)
