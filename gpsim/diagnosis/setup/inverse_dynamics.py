"""Where the search of a robot starts: what all joints may lack, sized by inverse dynamics, without a simulation.

Recorded motion says what forces a model would take for it. What it lacks at a joint is linear in that joint's friction,
rotor and offset: one least squares a joint (Gautier and Poignet 2001, Control Engineering Practice
9(12); Janot, Vandanjon and Gautier 2014, IEEE Transactions on Control Systems Technology 22(1)). It is less exact than
a fit by simulation, and nothing leads it astray: light links without a rotor, which whirl in a simulation, do here what
they did. Only starts come of it, so that it may look at the whole recording.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import lsq_linear
from scipy.signal import butter, sosfiltfilt

from gpsim.channels import FloatArray
from gpsim.diagnosis.fitting import Hypothesis, Problem, objective
from gpsim.diagnosis.setup.contacts import apart
from gpsim.effects import ClosedStep, Effect, ForceEffect, closed
from gpsim.recordings import Episode, Recording, evenly
from gpsim.simulators import Simulator

CUTOFFS = (0.2, 0.08, 0.03)
"""Of the Nyquist frequency, below which positions and commands are kept: what simulates best is taken (of made logs of
three arms, sizes changed little between 2.5 and 12 Hz)."""
ORDER = 4  # of the filter (Butterworth), applied forwards and backwards
SHORTEST = 60  # samples of an episode, so that what the filter does at its ends is little
ROWS = 2000  # samples that sizes are fitted to, at most
TURNS = 0.04  # of a joint's usual speed, within which dry friction is taken to turn round
USUAL = 0.95  # quantile of speeds that is the usual one


def is_row(effect: Effect) -> bool:
    """Whether it is one of what every joint of a robot usually has: friction, a motor's inertia, an offset."""
    return bool(effect.usual) and (effect.site == "force" or effect.family == "armature")


def by_inverse_dynamics(
    problem: Problem, recording: Recording, hypothesis: Hypothesis, late: float = 0.0
) -> Hypothesis | None:
    """The same rows (see `is_row`), sized by the forces that the base lacks where commands come `late` by so many s.

    None where motion does not tell (a body that floats, episodes that are too short), or where that is further off in
    simulation than the rows as they are.
    """
    system, simulator = closed(problem.simulator), problem.simulator
    rows = all(is_row(t.effect) and len(t.values) == 1 for t in hypothesis.terms)
    if system is None or not rows or len(simulator.state) != 2 * len(simulator.coordinates):
        return None
    starts, found = problem.windows.measured[None, :, 0], [hypothesis]
    for cutoff in CUTOFFS:
        motion = [_motion(simulator, e, cutoff, late) for e in recording.episodes if len(e) >= SHORTEST]
        if motion:
            found.append(hypothesis.having(_sizes(problem, system, hypothesis, motion)))
    off = [objective(problem, problem.residuals(h, h.theta[None], starts)[0]) for h in found]
    best = int(np.argmin(off))
    return found[best] if best else None


def _motion(
    simulator: Simulator, episode: Episode, cutoff: float, late: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """States (N, S), commands (N, A) and accelerations (N, C) below a share of the Nyquist frequency.

    A sample's acceleration is of the commands before and after it, each held for a step.
    """
    sos = butter(ORDER, cutoff, output="sos")
    names, inner = simulator.state, slice(1, -1)
    places = [names.index(c.name) for c in simulator.coordinates]
    speeds = [names.index(c.velocity) for c in simulator.coordinates]
    read = [
        np.unwrap(q) if names.wraps[i] else q for i, q in zip(places, episode.states.T[places], strict=True)
    ]
    states = np.empty_like(episode.states)
    states[:, places] = sosfiltfilt(sos, np.stack(read, axis=1), axis=0)
    states[:, speeds] = np.gradient(states[:, places], episode.t, axis=0)
    middle = (episode.t[1:] + episode.t[:-1]) / 2.0  # of what was held, as if it were a line
    held = np.empty((len(episode) - 1, len(simulator.action)))
    for column, given in zip(held.T, episode.actions.T, strict=True):
        column[:] = sosfiltfilt(sos, np.interp(episode.t[1:-1] - late, middle, given))
    acceleration = np.gradient(states[:, speeds], episode.t, axis=0)
    return states[inner], held, acceleration[inner]


def _sizes(
    problem: Problem,
    system: ClosedStep,
    hypothesis: Hypothesis,
    motion: list[tuple[FloatArray, FloatArray, FloatArray]],
) -> FloatArray:
    """(P,): within their bounds, the sizes that explain best what forces the base lacks."""
    states, actions, acceleration = (np.concatenate(parts) for parts in zip(*motion, strict=True))
    some = evenly(len(states), ROWS)
    some = some[apart(problem.simulator, len(hypothesis.terms), states[some])]
    states, acceleration = states[some], acceleration[some]
    lacks = system.lacking_force(states, actions[some], acceleration, problem.parameters)
    told = np.isfinite(lacks).all(axis=1)
    states, acceleration, lacks = states[told], acceleration[told], lacks[told]
    theta, names = hypothesis.theta, [p.name for p in hypothesis.parameters]
    if not len(states):
        return theta
    low, high = ([getattr(p, end) for p in hypothesis.parameters] for end in ("low", "high"))
    for joint, coordinate in enumerate(problem.simulator.coordinates):
        own = [i for i, term in enumerate(hypothesis.terms) if term.on == coordinate.name]
        if own:
            q, v = (
                states[:, problem.simulator.state.index(n)] for n in (coordinate.name, coordinate.velocity)
            )
            columns = [
                _of_unit_size(hypothesis.terms[i].effect, names[i], q, v, acceleration[:, joint]) for i in own
            ]
            bounds = [low[i] for i in own], [high[i] for i in own]
            theta[own] = lsq_linear(np.stack(columns, axis=1), lacks[:, joint], bounds).x
    return theta


def _of_unit_size(
    effect: Effect, parameter: str, position: FloatArray, speed: FloatArray, acceleration: FloatArray
) -> FloatArray:
    """(N,): the force of a row of size 1 along a motion."""
    if not isinstance(effect, ForceEffect):
        return -acceleration  # a rotor
    size = {parameter: np.ones(len(speed))}
    force = effect.force(position, speed, size)
    if force is not None:
        return force
    grip = effect.grip(position, speed, size, None)
    assert grip is not None  # friction's size, not a part of its load
    turns = TURNS * max(float(np.quantile(np.abs(speed), USUAL)), np.finfo(float).tiny)
    return -grip * np.tanh(speed / turns)
