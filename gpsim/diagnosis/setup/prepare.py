"""From a recording to the question: windows to learn from and to judge on, what was observed, and how well.

Of simulators that own their integration (MuJoCo's) also how finely they are stepped, and how long a window may be.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np

from gpsim.channels import BoolArray, difference
from gpsim.diagnosis.data import FEWEST_TRANSITIONS_OF_A_WINDOW, Windows, cut, held_out_mask, rebased, thinned
from gpsim.diagnosis.fitting import (
    FEW_JOINTS,
    TOLERATED_NOISE,
    TOLERATED_STEP_ERROR,
    USUAL_SUBSTEP,
    Hypothesis,
    Problem,
    dry_steps,
    growth,
    inexact,
    numerical_error,
    stepped,
)
from gpsim.diagnosis.run import Run
from gpsim.diagnosis.settings import Settings
from gpsim.diagnosis.setup.estimated import smoothed
from gpsim.diagnosis.setup.known import with_known
from gpsim.diagnosis.setup.log_facts import QUANTISED, LogLook, check_angles, contacts, look_at, mended
from gpsim.diagnosis.setup.sight import ObservedModel, check_moves, look
from gpsim.diagnosis.setup.sizes import Sizes
from gpsim.effects import Term, closed, effect_of
from gpsim.errors import NoDiagnosis, UsageError
from gpsim.findings import LogFact
from gpsim.recordings import Recording, evenly
from gpsim.residuals import check_clock, either_wraps
from gpsim.simulators import INTEGRATORS, Simulator, wrapping

SUBSTEPS = (1, 2, 3, 4, 6, 8, 12, 16, 24)  # of a transition, that the fine scheme may take
MOST_CUT = 6000  # windows that are cut: millions of transitions must not fill the memory
SEARCHED_LONGER = 50  # windows that it looks at where they are longer than usual
FEWEST_TRANSITIONS = 12  # transitions below, there are not even that many short windows
LONGER_WINDOWS = 2
"""Times the usual length, that windows have where noise hides what happens within one (unstable systems forbid
more)."""
NOISY_SHARE = 0.02  # noise that does, in parts of what moves within a window
ENOUGH_LONGER = 40  # windows of such a length that there must be to learn from
LEAST_FILLED = 0.9  # of such windows, that samples must fill, not what pads short episodes
LEAST_NOISE = 1e-8  # of a channel's typical size: no sensor that states no noise is better
HIDDEN_SCALE = 0.1  # of the guess of a channel that nobody measured: its typical size at the least
MOST_USUAL_SUBSTEPS = 6  # substeps that this may ask for
SLOW_STEP = 0.5  # transitions longer than this belong to systems for which seconds are no guide [s]
TOLERATED_CHANGE = 3e-3  # of a channel's spread: what halving the substep may change
SAMPLED_WINDOWS = 40  # windows on which the base simulator's numerical error and mismatch are measured
SAMPLED_OF_A_ROBOT = 16  # the same, of a model of many joints

STILL = 1e-9  # size of a channel that never changes, in whatever unit: it has none of its own

DRY_WINDOWS = 12  # windows on which that is asked, of every joint
UNSTABLE = 10.0
"""Times as far apart that two simulations may be at a window's end that began slightly apart: on poles that fall longer
windows lead fits into local minima; robots that are held stay below 7."""
BETWEEN_IMPACTS = 0.1  # s, of a window of what stands or walks: which foot touches when soon differs
SHORTEST_UNSTABLE = 5  # transitions that such a window keeps

BLOCKS = 40  # of an episode, in which means of commands are put in their place

RUBS, LIKELY = "coulomb_friction", ("armature", "viscous_friction")


@dataclass(frozen=True)
class PreparedProblem:
    """The problem on all training windows, on those that the search uses, and on the held-out ones.

    recording: as it is looked at: every `thinned`-th sample, `hidden` channels completed by the base simulator,
    its clock 0 at `origin` s, samples that say nothing mended and of no weight. facts: what is peculiar to the log.
    sight: what the recording shows of the simulator; whole: that with all of its states, also those not shown.
    """

    recording: Recording
    everything: Problem
    searched: Problem
    held_out: Problem
    thinned: int
    hidden: tuple[str, ...]
    origin: float
    sight: ObservedModel
    whole: Simulator
    facts: tuple[LogFact, ...]

    @property
    def run(self) -> Run:
        """What the diagnosis carries along."""
        return self.everything.run

    def episode_name(self, index: int | None) -> str | None:
        """What the recording calls one of its episodes; None of none."""
        return None if index is None else self.recording.episodes[index].name


def prepare(
    recording: Recording, simulator: Simulator, parameters: Mapping[str, float], run: Run | None = None
) -> PreparedProblem:
    """Thin, complete, cut, split and measure; raises UsageError when it does not match or is too short.

    The problem's simulator is one in which every angle wraps that does so in the simulator or in the recording.
    """
    run = run or Run()
    settings, parameters = run.settings, with_known(run.known, simulator, parameters)
    sight = look(recording, simulator)
    hidden = sight.hidden
    _check_length(recording)
    check_clock(recording)
    check_moves(recording, simulator, sight)
    if recording.integrator not in INTEGRATORS:
        raise UsageError(
            f"recording: integrator '{recording.integrator}' is not one of {', '.join(INTEGRATORS)}"
        )
    whole = wrapping(simulator, either_wraps(simulator.state, recording.state))
    simulator = wrapping(sight.simulator, either_wraps(sight.simulator.state, recording.state))
    log = look_at(recording, settings.log_facts)
    full, origin = rebased(mended(recording, log.left_out))
    system = closed(simulator)
    read, every = thinned(full, settings.windows.pace)
    own = system is not None and every > 1
    if own and not _means_serve(simulator, sight.completed(full), parameters, every):
        read, every = full, 1
    seen = sight.completed(read)
    check_angles(seen, simulator, parameters, settings.log_facts, hidden)
    if system is not None:
        simulator = system.around(np.concatenate([e.states for e in seen.episodes]))
    observed = _observed(seen, simulator, hidden)
    lasting = bool(set(hidden) & set(simulator.levels))
    training, held = _split(seen, observed, settings, lasting)
    made = partial(_problem, simulator, parameters, hidden, log, run)
    problem = made(seen, training)
    if system is None and hidden:
        # Else speeds are known from positions better than from a base that lacks much.
        seen = smoothed(problem, seen, Hypothesis(), hidden)
        training, held = _split(seen, observed, settings, lasting)
        problem = made(seen, training)
    searched, fitted, fewest = settings.windows.searched, settings.windows.fitted, settings.windows.fewest
    if training.length != _length(seen, settings):
        searched = SEARCHED_LONGER
    if system is not None:
        searched, fitted = settings.closed_step.searched, settings.closed_step.fitted
        machine = cache(partial(_likely_machine, _sample(problem), seen))
        problem = stepped(_sample(problem), machine)
        length = _steady_length(problem.on(spread_out(training, searched, fewest)), machine)
        if simulator.stands(training.measured[training.valid]):
            length = min(length, max(round(BETWEEN_IMPACTS / problem.dt), SHORTEST_UNSTABLE))
        if length < training.length:  # unstable motion would drive apart what began alike
            training, held = _parted(seen, length, settings)
        sized = made(seen, training)
        problem = replace(problem, windows=training, floor=sized.floor, scale=sized.scale)
        problem = replace(problem, dry_steps=steps_with_friction(_sample(problem), seen))
        problem = replace(problem, floor=np.hypot(problem.floor, inexact(_sample(problem), machine)))
    problem = replace(problem, base_steps=every)
    problem = _fine_enough(problem) if system is None else problem
    return PreparedProblem(
        seen,
        problem.on(spread_out(training, fitted, fewest)),
        problem.on(spread_out(training, searched, fewest)),
        problem.on(spread_out(held, fitted, fewest)),
        every,
        hidden,
        origin,
        sight,
        whole,
        (*log.facts, *contacts(simulator, seen)),
    )


def _check_length(recording: Recording) -> None:
    """Of what is far too short nothing else is worth saying."""
    count, fewest = recording.transition_count, FEWEST_TRANSITIONS
    if count >= fewest:
        return
    short = f"too short to judge: {count} transitions, {fewest} at the least"
    single = sum(len(episode) == 0 for episode in recording.episodes)
    if single > 1 and 2 * single > len(recording.episodes):
        raise UsageError(
            f"{short}; {single} episodes have one row: the column `episode` must name episodes, not count rows"
        )
    raise NoDiagnosis(f"{short}; record more")


def _split(
    recording: Recording, observed: BoolArray, settings: Settings, lasting: bool
) -> tuple[Windows, Windows]:
    """Windows to learn from and held-out ones.

    lasting: whether a level is hidden. It begins anew in every window, and follows from no other channel's change, so
    that short windows can explain anything by it: they are as long as can be.
    """
    length, prepared = _length(recording, settings), settings.windows
    training, held = _parted(recording, length, settings)
    if recording.held_out is not None and recording.held_out.share != 0.0 and not len(held):
        raise UsageError(
            "nothing is held out: the recording's held_out begins after its end; correct it in recording.yaml, or "
            "remove it to hold out the last fifth"
        )
    if len(training) < prepared.fewest:
        raise NoDiagnosis(
            f"too short to judge: {recording.transition_count} transitions make {len(training)} windows of "
            f"{training.length} to learn from, {prepared.fewest} are needed; record more, or hold out less"
        )
    twice = LONGER_WINDOWS * length
    while lasting:
        longer, later = _parted(recording, LONGER_WINDOWS * training.length, settings)
        if (
            len(longer) < prepared.fewest
            or bool(len(later)) != bool(len(held))
            or longer.valid.mean() < LEAST_FILLED
        ):
            return training, held
        training, held = longer, later
    if twice <= settings.windows.longest and _noisy(recording, training, observed):
        longer, later = _parted(recording, twice, settings)
        enough = len(longer) >= ENOUGH_LONGER and bool(len(later)) == bool(len(held))
        if enough and float(longer.valid.mean()) > LEAST_FILLED:  # samples, not what pads short episodes
            return longer, later
    return training, held


def _parted(recording: Recording, length: int, settings: Settings) -> tuple[Windows, Windows]:
    """Windows of a length, to learn from and held-out ones."""
    windows = cut(recording, settings.windows, length, most=MOST_CUT)
    held = held_out_mask(recording, windows)
    return windows.take(~held), windows.take(held)


def _problem(
    simulator: Simulator,
    parameters: Mapping[str, float],
    hidden: tuple[str, ...],
    log: LogLook,
    run: Run,
    recording: Recording,
    training: Windows,
) -> Problem:
    """The problem on the training windows; its floor is the known noise, its substeps are the usual ones."""
    names = simulator.state.names
    observed = _observed(recording, simulator, hidden)
    spread = training.measured[training.valid].std(axis=0)
    unsized = [n in hidden and (n in simulator.start or not s) for n, s in zip(names, spread, strict=True)]
    guess = np.where(unsized, [abs(simulator.start.get(n, 0.0)) or 1.0 for n in names], 0.0)
    scale = np.maximum(np.where(spread > 0.0, spread, STILL), HIDDEN_SCALE * guess)
    known = np.array([recording.noise.get(name, 0.0) for name in names])
    rounded = np.array([QUANTISED * log.quantised.get(name, 0.0) for name in names])
    floor = np.sqrt(np.maximum(known, rounded) ** 2 + (LEAST_NOISE * scale) ** 2)
    usual = int(np.clip(np.ceil(recording.dt / USUAL_SUBSTEP), 1, MOST_USUAL_SUBSTEPS))
    return Problem(
        simulator, parameters, recording.dt, training, observed, floor, known > 0, scale, usual, run=run
    )


def _fine_enough(problem: Problem) -> Problem:
    """As many substeps as the dynamics need, and what halving them still changes as a part of the noise."""
    sample = _sample(problem)
    # Friction may hold something at rest.
    stands = any(problem.simulator.coordinates) and problem.dt <= SLOW_STEP
    fewest = problem.substeps if stands else SUBSTEPS[0]
    tolerated = np.maximum(TOLERATED_CHANGE * problem.scale, problem.floor / TOLERATED_NOISE)
    tolerated = tolerated[problem.observed]
    for substeps in (n for n in SUBSTEPS if n >= fewest):
        error = numerical_error(replace(sample, substeps=substeps))
        chosen = replace(problem, substeps=substeps, floor=np.hypot(problem.floor, error))
        if (error[problem.observed] <= tolerated).all():
            break
    return chosen


def _sample(problem: Problem) -> Problem:
    """The problem on a few windows, which show the base simulator's errors."""
    dear = closed(problem.simulator) is not None and len(problem.simulator.coordinates) > FEW_JOINTS
    most = SAMPLED_OF_A_ROBOT if dear else SAMPLED_WINDOWS
    return problem.on(spread_out(problem.windows, most, problem.run.settings.windows.fewest))


def spread_out(windows: Windows, most: int, fewest: int) -> Windows:
    """At most `most` windows, evenly spread; without those that begin an episode, where there are enough others.

    Enough: `fewest`, and twice as many as begin an episode.
    """
    later = np.flatnonzero(~windows.fresh)
    enough = len(later) >= max(fewest, 2 * int(windows.fresh.sum()))
    rows = later if enough else np.arange(len(windows))
    return windows.take(rows[evenly(len(rows), most)])


def _length(recording: Recording, settings: Settings) -> int:
    """Transitions a window: the usual number, more where a clock stayed fast because thinning would hide commands."""
    longest = max(len(episode) for episode in recording.episodes)
    windows, pace = settings.windows, settings.windows.pace
    usual = round(windows.length * pace / recording.dt)
    usual = int(np.clip(usual, windows.length, windows.longest))
    return min(usual, max(longest, FEWEST_TRANSITIONS_OF_A_WINDOW))


def _noisy(recording: Recording, windows: Windows, observed: BoolArray) -> bool:
    """Whether known noise hides what happens within a window, in all that was observed.

    What a lasting effect adds up to within a window grows with its length, at least linearly; noise does not.
    """
    noise = np.array([recording.noise.get(name, 0.0) for name in recording.state.names])
    whole = windows.measured[windows.valid.all(axis=1)]
    if not len(whole):
        return False
    motion = np.sqrt(np.mean(whole.var(axis=1), axis=0))
    return bool((noise > NOISY_SHARE * motion)[observed].all())


def _observed(recording: Recording, simulator: Simulator, hidden: Sequence[str]) -> BoolArray:
    """(S,) what was measured.

    Differentiated velocities carry the smoothing's errors and no news: positions are observed only. What others settle
    is no news, either.
    """
    unseen = {
        *hidden,
        *simulator.settled,
        *(simulator.velocities if recording.velocities == "differentiated" else ()),
    }
    return np.array([name not in unseen for name in simulator.state.names])


def steps_with_friction(problem: Problem, recording: Recording) -> dict[str, int]:
    """Coordinate -> times as many substeps where dry friction acts on it: of its usual size, in a few windows.

    None of a model of many joints, whose steps are too dear.
    """
    simulator = problem.simulator
    if len(simulator.coordinates) > FEW_JOINTS:
        return {}
    rows = evenly(len(problem.windows), DRY_WINDOWS)
    some = problem.on(problem.windows.take(rows))
    found = {h.terms[0].on: dry_steps(some, h) for h in _usual_terms(problem, recording, (RUBS,))}
    return {on: times for on, times in found.items() if times > 1}


def _likely_machine(problem: Problem, recording: Recording) -> Hypothesis:
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


def _means_serve(
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


def _steady_length(problem: Problem, machine: Callable[[], Hypothesis]) -> int:
    """Transitions of a window within which what began alike stays so: fits get lost where it is driven apart.

    In the base, unless a likely `machine` is steady throughout: then light links whirl in the base alone.
    """
    longest = problem.windows.length

    def steady(hypothesis: Hypothesis) -> int:
        (beyond,) = np.nonzero(growth(problem, hypothesis) > UNSTABLE)
        return min(max(int(beyond[0]) - 1, SHORTEST_UNSTABLE), longest) if len(beyond) else longest

    length = steady(Hypothesis())
    return longest if length < longest == steady(machine()) else length
