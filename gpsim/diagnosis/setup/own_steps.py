"""Simulators that own their integration (MuJoCo's): how finely dry friction is stepped, how long a window may be."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from gpsim.channels import difference
from gpsim.diagnosis.fitting import TOLERATED_STEP_ERROR, Hypothesis, Problem, dry_steps, growth
from gpsim.diagnosis.setup.sizes import Sizes
from gpsim.effects import Term, closed, effect_of
from gpsim.recordings import Recording, evenly
from gpsim.simulators import Simulator

DRY_WINDOWS = 12  # windows on which that is asked, of every joint
DRY_JOINTS = 3  # of a model, at most, whose dry friction is stepped finely: the steps of an arm are too dear
UNSTABLE = 10.0
"""Times as far apart that two simulations may be at a window's end that began slightly apart: on poles that fall longer
windows lead fits into local minima; robots that are held stay below 7."""
SHORTEST_UNSTABLE = 5  # transitions that such a window keeps

BLOCKS = 40  # of an episode, in which means of commands are put in their place

RUBS, LIKELY = "coulomb_friction", ("armature", "viscous_friction")


def steps_with_friction(problem: Problem, recording: Recording) -> dict[str, int]:
    """Coordinate -> times as many substeps where dry friction acts on it: of its usual size, in a few windows.

    None of a model of many joints, whose steps are too dear.
    """
    simulator = problem.simulator
    if len(simulator.coordinates) > DRY_JOINTS:
        return {}
    rows = evenly(len(problem.windows), DRY_WINDOWS)
    some, found = problem.on(problem.windows.take(rows)), {}
    for rubbing in _usual_terms(problem, recording, (RUBS,)):
        times = dry_steps(some, rubbing)
        if times > 1:
            found[rubbing.terms[0].on] = times
    return found


def likely_machine(problem: Problem, recording: Recording) -> Hypothesis:
    """A rotor and viscous friction of usual sizes at every joint: what whirls without needs steps that are too dear."""
    every = _usual_terms(problem, recording, LIKELY)
    return Hypothesis(tuple(t for h in every for t in h.terms), tuple(d for h in every for d in h.declared))


def _usual_terms(problem: Problem, recording: Recording, families: Sequence[str]) -> list[Hypothesis]:
    """Effects of their usual sizes at each of their places, one hypothesis each."""
    simulator, out = problem.simulator, []
    sizes = Sizes(recording, simulator, problem.parameters)
    for effect in map(effect_of, families):
        for on in effect.places(simulator):
            declared = effect.parameters(sizes.place(effect, on))
            term = Term(effect.family, on, {p.name: p.starts[0] for p in declared})
            out.append(Hypothesis((term,), (declared,)))
    return out


def means_serve(
    simulator: Simulator, recording: Recording, parameters: Mapping[str, float], every: int
) -> bool:
    """Whether the base does alike with the means of commands over so many samples; a stiff servo does not.

    Its error is small beside what is commanded, and so is what a mean hides of the commands.
    """
    system = closed(simulator)
    assert system is not None
    tolerated = TOLERATED_STEP_ERROR * np.concatenate([e.states for e in recording.episodes]).std(axis=0)
    n, changes = system.steps_of(recording.dt), []
    for episode in recording.episodes:
        last = len(episode) - every
        rows = evenly(max(last, 0), BLOCKS)
        if not len(rows):
            continue
        acted = episode.actions[rows[:, None] + np.arange(every)]
        means = np.broadcast_to(acted.mean(axis=1, keepdims=True), acted.shape)
        step, t = np.diff(episode.t)[rows] / n, episode.t[rows]
        said, meant = (
            system.rolled((), parameters, (), episode.states[rows], np.repeat(u, n, axis=1), step, t)[:, -1]
            for u in (acted, means)
        )
        changes.append(difference(said, meant, simulator.state))
    change = np.concatenate(changes) if changes else np.zeros((1, len(tolerated)))
    return bool((np.sqrt(np.mean(change**2, axis=0)) <= tolerated).all())


def steady_length(problem: Problem, machine: Callable[[], Hypothesis]) -> int:
    """Transitions of a window within which what began alike stays so: fits get lost where it is driven apart.

    In the base, unless a likely `machine` is steady throughout: then light links whirl in the base alone.
    """
    longest, length = problem.windows.length, _steady(problem, Hypothesis())
    return longest if length < longest == _steady(problem, machine()) else length


def _steady(problem: Problem, hypothesis: Hypothesis) -> int:
    limit, longest = UNSTABLE, problem.windows.length
    (beyond,) = np.nonzero(growth(problem, hypothesis) > limit)
    return min(max(int(beyond[0]) - 1, SHORTEST_UNSTABLE), longest) if len(beyond) else longest
