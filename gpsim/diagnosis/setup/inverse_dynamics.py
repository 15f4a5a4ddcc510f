"""Where the search of a robot starts: what it may lack, sized by inverse dynamics, almost without a simulation.

Recorded motion says what forces a model would take for it. What it lacks is linear in each joint's friction, rotor and
offset, in masses, first moments of a payload and gains of motors, and nearly so in how late commands come: one weighted
least squares of all joints (Gautier and Poignet 2001, Control Engineering Practice 9(12); Janot, Vandanjon and Gautier
2014, IEEE Transactions on Control Systems Technology 22(1)). Which bodies and motors are off is asked greedily, by
the evidence of that linear model, in which usual sizes are the prior. It is less exact than a fit by simulation, and
nothing leads it astray: light links without a rotor, which whirl in a simulation, do here what they did. Only starts
come of it, so that it may look at the whole recording.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gpsim.channels import FloatArray
from gpsim.diagnosis.fitting import Candidate, Hypothesis, Problem, fit, is_row, objective, state_jacobian
from gpsim.diagnosis.setup.forces import Forces
from gpsim.diagnosis.setup.low_passed import low_passed
from gpsim.diagnosis.setup.regression import Regression
from gpsim.effects import closed
from gpsim.recordings import Recording

CUTOFFS = {0.5: (0.15, 0.06), 0.2: (0.06, 0.025), 0.06: (0.012,)}
"""Of the Nyquist frequency, below which motion is kept, and forces are compared: what simulates best is taken. Fast
motion asks for a wide band, coarse encoders for a narrow one, late commands and friction for slow forces."""
CLOSEST, STARTS = 4, 3  # of what bands say, that are compared with start states fitted, in so many steps


def by_inverse_dynamics(
    problem: Problem,
    recording: Recording,
    rows: Hypothesis,
    others: Sequence[Candidate] = (),
    delays: Sequence[Candidate] = (),
    rises: Sequence[Candidate] = (),
) -> Hypothesis | None:
    """Rows (see `is_row`) sized by the forces that the base lacks, with late commands and what else is surely off.

    others: bodies and motors that may be off (see `is_structure`). rises: of dry friction (see `rises_of`). None where
    motion does not tell (a body that floats, episodes that are too short), or where all that is further off in
    simulation than the rows as they are.
    """
    simulator = problem.simulator
    sized = all(is_row(t.effect) and len(t.values) == 1 for t in rows.terms)
    if closed(simulator) is None or not sized or len(simulator.state) != 2 * len(simulator.coordinates):
        return None
    starts, found = problem.windows.measured[None, :, 0], [rows]
    for wide, narrow in CUTOFFS.items():
        motion = low_passed(simulator, recording, wide)
        if motion is not None:
            forces = Forces(problem, recording.dt, motion, rows)
            for below in narrow:
                found += Regression(forces, below, tuple(delays)).found(others, rises)
    left = [problem.residuals(h, h.theta[None], starts)[0] for h in found]
    near = [int(i) for i in np.argsort([objective(problem, one) for one in left])[:CLOSEST]]
    best = _likeliest(problem, found, left, near)
    return found[best] if best else None


def _likeliest(
    problem: Problem, found: Sequence[Hypothesis], left: Sequence[FloatArray], near: Sequence[int]
) -> int:
    """Which of those near the best is likeliest, its start states fitted: noisy speeds decide between them else."""
    starts, first = problem.windows.measured[:, 0], near[0]
    known = state_jacobian(problem, found[first], starts, left[first])
    fits = [fit(problem, found[i].frozen(), starts, iterations=STARTS, known=known) for i in near]
    return near[int(np.argmin([f.objective for f in fits]))]
