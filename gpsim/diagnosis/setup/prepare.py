"""From a recording to the question: windows to learn from and to judge on, what was observed, and how well."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gpsim.channels import BoolArray
from gpsim.diagnosis.data import LENGTH, LONGEST, PACE, Windows, cut, held_out_mask, rebased, thinned
from gpsim.diagnosis.fitting import (
    Fit,
    Hypothesis,
    Problem,
    enough_substeps,
    fit,
    numerical_error,
    rescored,
    settled,
)
from gpsim.diagnosis.run import Run
from gpsim.diagnosis.setup.latent_states import guessed, hidden_channels, smoothed
from gpsim.errors import UsageError
from gpsim.recordings import Recording, evenly
from gpsim.residuals import check_clock, check_match, check_varies, either_wraps
from gpsim.simulators import INTEGRATORS, Simulator, wrapping

SEARCHED, FITTED = 72, 480  # windows that the search looks at, and that the final fits use, at most
CUT = 6000  # windows that are cut at most: millions of transitions must not fill the memory
FEWEST_WINDOWS = 4
FEWEST_TRANSITIONS = 12  # below, not even that many short windows
NOISY, LONGER = 0.02, 2  # noise, in parts of what moves within a window, that makes windows so much longer,
ENOUGH_WINDOWS, FILLED = 40, 0.9  # if as many are left to learn from, and so much of them holds samples,
SEARCHED_LONGER = 50  # and as many of those for the search
SAMPLED = 40  # windows on which the base simulator's own errors are measured
SUBSTEPS = (2, 3, 4, 6, 8, 12, 16, 24)  # of a transition, that the fine scheme may take
USUAL_SUBSTEP = 0.0125  # s: what friction at rest needs on robots
USUAL_MOST = 6  # substeps that this may ask for
SLOW = 0.5  # s: transitions longer than this belong to systems for which seconds are no guide
NUMERICAL = 3e-3  # of a channel's spread: what halving the substep may change (or a third of the known noise)


@dataclass(frozen=True)
class Question:
    """The problem on all training windows, on those that the search uses, and on the held-out ones.

    recording: as it is looked at: every `thinned`-th sample, `hidden` channels completed by the base simulator,
    its clock 0 at `origin` s.
    """

    recording: Recording
    everything: Problem
    searched: Problem
    held_out: Problem
    thinned: int = 1
    hidden: tuple[str, ...] = ()
    origin: float = 0.0

    def episode_name(self, index: int | None) -> str | None:
        """What the recording calls one of its episodes; None of none."""
        return None if index is None else self.recording.episodes[index].name


def prepare(
    recording: Recording, simulator: Simulator, parameters: Mapping[str, float], run: Run | None = None
) -> Question:
    """Thin, complete, cut, split and measure; raises UsageError when it does not match or is too short.

    The problem's simulator is one in which every angle wraps that does so in the simulator or in the recording.
    """
    run = run or Run()
    hidden = hidden_channels(recording, simulator)
    check_match(recording, simulator, hidden=hidden)
    _check_length(recording)
    check_clock(recording)
    check_varies(recording)
    if recording.integrator not in INTEGRATORS:
        raise UsageError(
            f"recording: integrator '{recording.integrator}' is not one of {', '.join(INTEGRATORS)}"
        )
    simulator = wrapping(simulator, either_wraps(simulator.state, recording.state))
    seen, origin = rebased(recording)
    seen, every = thinned(seen)
    seen = guessed(seen, simulator)
    observed = _observed(seen, simulator, hidden)
    training, held = _split(seen, observed)
    problem = _problem(seen, simulator, parameters, training, hidden, run)
    if hidden:
        seen = smoothed(problem, seen, Hypothesis(), hidden)
        training, held = _split(seen, observed)
        problem = _problem(seen, simulator, parameters, training, hidden, run)
    searched = SEARCHED if training.length == _length(seen) else SEARCHED_LONGER
    problem = _with_mismatch(_fine_enough(replace(problem, base_steps=every)))
    return Question(
        seen,
        problem.on(spread_out(training, FITTED)),
        problem.on(spread_out(training, searched)),
        problem.on(spread_out(held, FITTED)),
        every,
        hidden,
        origin,
    )


def _check_length(recording: Recording) -> None:
    """Of what is far too short nothing else is worth saying."""
    count = recording.transition_count
    if count >= FEWEST_TRANSITIONS:
        return
    single = sum(len(episode) == 0 for episode in recording.episodes)
    hint = "record more"
    if single > 1 and 2 * single > len(recording.episodes):
        hint = f"{single} episodes have one row: the column `episode` names episodes, it does not count rows"
    raise UsageError(f"too short to judge: {count} transitions, {FEWEST_TRANSITIONS} at the least; {hint}")


def _split(recording: Recording, observed: BoolArray) -> tuple[Windows, Windows]:
    """Windows to learn from and held-out ones."""
    length = _length(recording)
    training, held = _parted(recording, length)
    if recording.held_out is not None and not len(held):
        raise UsageError(
            "nothing is held out: the recording's held_out begins after its end; correct it in recording.yaml, "
            "or take it out to hold out the last fifth"
        )
    if len(training) < FEWEST_WINDOWS:
        raise UsageError(
            f"too short to judge: {recording.transition_count} transitions make {len(training)} windows of "
            f"{training.length} to learn from, {FEWEST_WINDOWS} are needed; record more, or hold out less"
        )
    if LONGER * length <= LONGEST and _noisy(recording, training, observed):
        longer, later = _parted(recording, LONGER * length)
        if len(longer) >= ENOUGH_WINDOWS and bool(len(later)) == bool(len(held)) and _filled(longer):
            return longer, later
    return training, held


def _parted(recording: Recording, length: int) -> tuple[Windows, Windows]:
    """Windows of a length, to learn from and held-out ones."""
    windows = cut(recording, length, most=CUT)
    held = held_out_mask(recording, windows)
    return windows.take(~held), windows.take(held)


def _filled(windows: Windows) -> bool:
    """Whether they hold samples, not what pads the ends of episodes that are shorter."""
    return float(windows.valid.mean()) > FILLED


def _problem(
    recording: Recording,
    simulator: Simulator,
    parameters: Mapping[str, float],
    training: Windows,
    hidden: tuple[str, ...],
    run: Run,
) -> Problem:
    """The problem on the training windows; its floor is the known noise, its substeps are the usual ones."""
    names = simulator.state.names
    observed = _observed(recording, simulator, hidden)
    guess = np.array([abs(simulator.start.get(n, 0.0)) or 1.0 if n in hidden else 0.0 for n in names])
    scale = np.maximum(training.measured[training.valid].std(axis=0), np.maximum(0.1 * guess, 1e-9))
    known = np.array([recording.noise.get(name, 0.0) for name in names])
    floor = np.sqrt(known**2 + (1e-8 * scale) ** 2)
    usual = int(np.clip(np.ceil(recording.dt / USUAL_SUBSTEP), SUBSTEPS[0], USUAL_MOST))
    nothing = np.zeros(len(names))
    return Problem(
        simulator,
        parameters,
        recording.dt,
        training,
        observed,
        floor,
        known > 0,
        scale,
        nothing,
        usual,
        run=run,
    )


def _fine_enough(problem: Problem) -> Problem:
    """As many substeps as the dynamics need, and what halving them still changes as a part of the noise."""
    sample = problem.on(spread_out(problem.windows, SAMPLED))
    stands = any(problem.simulator.coordinates) and problem.dt <= SLOW  # friction may hold something at rest
    fewest = problem.substeps if stands else SUBSTEPS[0]
    tolerated = np.maximum(NUMERICAL * problem.scale, problem.floor / 3)[problem.observed]
    for substeps in (n for n in SUBSTEPS if n >= fewest):
        error = numerical_error(replace(sample, substeps=substeps))
        chosen = replace(problem, substeps=substeps, floor=np.hypot(problem.floor, error))
        if (error[problem.observed] <= tolerated).all():
            break
    return chosen


def _with_mismatch(problem: Problem) -> Problem:
    """The problem with how far the base simulator is off."""
    sample = problem.on(spread_out(problem.windows, SAMPLED))
    null = fit(sample, Hypothesis(), sample.windows.measured[:, 0], iterations=8)
    return replace(problem, mismatch=null.variance)


def settled_question(question: Question, best: Fit) -> Question:
    """The question with as fine a grid as the best hypothesis needs, a fit of the searched windows, and its error."""
    best = rescored(question.searched, best)  # the search had found its own floor
    substeps, best = enough_substeps(question.searched, best)
    problem = replace(question.searched, substeps=substeps)
    floor = np.maximum(question.everything.floor, settled(problem, best).floor)
    problems = (question.everything, question.searched, question.held_out)
    everything, searched, held_out = (replace(p, floor=floor, substeps=substeps) for p in problems)
    return replace(question, everything=everything, searched=searched, held_out=held_out)


def spread_out(windows: Windows, most: int) -> Windows:
    """At most `most` windows, evenly spread; those that do not begin an episode first, where there are enough."""
    later = np.flatnonzero(~windows.fresh)
    rows = (
        later if len(later) >= max(FEWEST_WINDOWS, 2 * int(windows.fresh.sum())) else np.arange(len(windows))
    )
    return windows.take(rows[evenly(len(rows), most)])


def _length(recording: Recording) -> int:
    """Transitions a window: the usual number, more where a clock stayed fast because thinning would hide commands."""
    longest = max(len(episode) for episode in recording.episodes)
    usual = int(np.clip(round(LENGTH * PACE / recording.dt), LENGTH, LONGEST))
    return min(usual, max(longest, 3))


def _noisy(recording: Recording, windows: Windows, observed: BoolArray) -> bool:
    """Whether known noise hides what happens within a window, in all that was observed.

    What a lasting effect adds up to within a window grows with its length, at least linearly; noise does not. Unstable
    systems forbid more than twice the usual length.
    """
    noise = np.array([recording.noise.get(name, 0.0) for name in recording.state.names])
    whole = windows.measured[windows.valid.all(axis=1)]
    if not len(whole):
        return False
    motion = np.sqrt(np.mean(whole.var(axis=1), axis=0))
    return bool((noise > NOISY * motion)[observed].all())


def _observed(recording: Recording, simulator: Simulator, hidden: Sequence[str]) -> BoolArray:
    """(S,) what was measured.

    Differentiated velocities carry the smoothing's errors and no news: positions are observed only.
    """
    velocities = {coordinate.velocity for coordinate in simulator.coordinates}
    unseen = {*hidden, *(velocities if recording.velocities == "differentiated" else ())}
    return np.array([name not in unseen for name in simulator.state.names])
