"""make_env: a corrected simulator with a task, as a Gymnasium environment."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

import numpy as np
from numpy.typing import ArrayLike

from gpsim.api.corrected import Corrected, CorrectedSimulator
from gpsim.api.registration import register_environments
from gpsim.channels import FloatArray
from gpsim.diagnosis.setup import look
from gpsim.environments import BatchedEnv, SingleEnv
from gpsim.errors import UsageError
from gpsim.mjcf import open_simulator
from gpsim.mjcf.gym_task import GymTask, is_gym_task
from gpsim.recordings import Recording
from gpsim.settings import build, choice, positive
from gpsim.simulators import Plant, SimulatorPlant
from gpsim.tasks import TASKS, OwnTask, Task, never
from gpsim.trust import consent

if TYPE_CHECKING:
    from gpsim.api.diagnosis import Diagnosis

Told = Mapping[str, Any]
STEPS = 500
"""Control steps of an episode, as the tasks that come with gpsim have it."""
SAME_DT = 1e-6
"""Relative difference of two control steps that are one."""


@overload
def make_env(
    simulator: Diagnosis | CorrectedSimulator | str | Path,
    task: str | Task | None = None,
    *,
    count: None = None,
    **options: Any,
) -> SingleEnv: ...


@overload
def make_env(
    simulator: Diagnosis | CorrectedSimulator | str | Path,
    task: str | Task | None = None,
    *,
    count: int,
    **options: Any,
) -> BatchedEnv: ...


def make_env(
    simulator: Diagnosis | CorrectedSimulator | str | Path,
    task: str | Task | None = None,
    *,
    reward: Callable[[Told, Told, Told], Any] | None = None,
    terminated: Callable[[Told], Any] | None = None,
    starts: Recording | ArrayLike | None = None,
    actions: Mapping[str, tuple[float, float]] | None = None,
    max_steps: int | None = None,
    vectorised: bool = False,
    count: int | None = None,
    gp: bool = False,
    trust: bool = False,
    **settings: Any,
) -> SingleEnv | BatchedEnv:
    """A Gymnasium environment of a corrected simulator, one episode at a time; any library trains in it.

    Args:
        simulator: a diagnosis, its folder, or a corrected simulator.
        task: `balance` (the cart-pole) or `goal` (a vehicle), with its `settings`, `gym:ID` (of a Gymnasium
            environment built on MuJoCo: starts, observation, reward and end are theirs), or an object with the methods
            of `gpsim.tasks.Task`. Without a task give a reward.
        reward: reward(state, action, next_state) -> number. Each is a mapping of channel to number; the action is in
            the units of its channels, states are the true ones.
        terminated: terminated(state) -> whether the episode is over for good; never by default.
        starts: states (N, S) of which episodes begin at any, or a recording that has been there; by default the
            recording that the simulator was learnt from.
        actions: {channel: (low, high)}: what the policy's -1 and 1 mean; by default the least and the largest command
            of that recording.
        max_steps: control steps after which an episode is truncated; 500 by default.
        vectorised: whether reward and terminated take mappings of channel to (B,) numbers and return (B,) numbers.
        count: for a Gymnasium vector environment of so many episodes, stepped as one batch; None for a single one.
        gp: of a diagnosis, whether to add its Gaussian process on what is left.
        trust: of a diagnosis's folder, whether a Python file or module that only it names may run.
        settings: of a task by name, as `force=8.0`: the keys of conf/task.

    Returns:
        The environment. With a reward of one's own it shows the measured state (S,), and takes actions (A,) in [-1, 1].
        `reset(options={"states": (S,)})` begins where it is told to.

    Raises:
        UsageError: the task wants other channels, the functions raise or return no number, or nothing says where
            episodes begin.

    Example:
        >>> import gpsim
        >>> diagnosis = gpsim.Diagnosis.load("found", recording="slider.csv")
        >>> env = gpsim.make_env(diagnosis, reward=lambda state, action, next_state: -abs(next_state["q"]))
        >>> observation, info = env.reset(seed=0)
        >>> observation, reward, terminated, truncated, info = env.step(env.action_space.sample())
        >>> observation.shape, reward <= 0.0, terminated
        ((2,), True, False)
    """
    register_environments()
    plant, recording = _plant(simulator, gp, trust)
    own = {"reward": reward, "terminated": terminated, "starts": starts, "actions": actions}
    steps = {} if max_steps is None else {"max_steps": positive(max_steps, "max_steps")}
    if task is not None:
        given = [name for name, value in own.items() if value is not None] + ["vectorised"] * vectorised
        if given:
            raise UsageError(f"make_env: {', '.join(given)}: for your own task, not with task={task!r}")
        return _env(plant, _fitting(_task(task, settings | steps), plant), count)
    if settings:
        raise UsageError(
            f"make_env: no argument '{next(iter(settings))}'; settings of a task go with task=NAME"
        )
    if reward is None:
        raise UsageError(
            f"make_env: name a task ({', '.join(TASKS)}), or give reward=function(state, action, next_state)"
        )
    for name, function in (("reward", reward), ("terminated", terminated)):
        if function is not None and not callable(function):
            raise UsageError(f"make_env: {name}: expected a function, got {type(function).__name__}")
    low, high = _bounds(actions or {}, recording, plant)
    begin, end = _starts(starts, recording, plant), terminated or never
    made = OwnTask(plant.state, plant.action, reward, begin, low, high, end, vectorised=vectorised, **steps)
    return _env(plant, made, count)


def _env(plant: Plant, task: Task, count: int | None) -> SingleEnv | BatchedEnv:
    if count is None:
        return SingleEnv(plant, task)
    return BatchedEnv(plant, task, positive(count, "count"), seed=0)


def _plant(given: Any, gp: bool, trust: bool) -> tuple[Corrected, Recording | None]:
    from gpsim.api.diagnosis import Diagnosis

    if isinstance(given, str | Path):
        given = Diagnosis.load(given, trust=trust)
    if isinstance(given, Diagnosis):
        given = given.corrected(gp)
    if not isinstance(given, CorrectedSimulator):
        raise UsageError(
            f"make_env: expected a diagnosis, its folder or a corrected simulator, got {type(given).__name__}"
        )
    return given.plant, given.recording


def _task(task: str | Task, settings: Mapping[str, Any]) -> Task:
    if isinstance(task, str) and is_gym_task(task):
        consent(task)
        return build(GymTask, settings, "task", reference=task)
    if isinstance(task, str):
        return build(TASKS[choice(task, tuple(TASKS), "task")], settings, "task")
    if settings:
        raise UsageError(
            f"make_env: {', '.join(settings)}: settings need a task name; set them in the task object"
        )
    return task


def _fitting(task: Task, plant: Plant) -> Task:
    """Columns go from one to the other by their place."""
    for kind, has, needs in (("state", plant.state, task.state), ("action", plant.action, task.action)):
        if not has.same_as(needs):
            raise UsageError(
                f"make_env: the task is of another system: its {kind} is {needs.listed()}, the simulator's is "
                f"{has.listed()}; give reward=function(state, action, next_state) instead"
            )
    if isinstance(task, GymTask) and not math.isclose(task.dt, plant.dt, rel_tol=SAME_DT):
        raise UsageError(
            f"make_env: {task.reference} takes control steps of {task.dt:g} s, the recording's are {plant.dt:g} s; "
            "record at its pace, or give reward=function(state, action, next_state) instead"
        )
    return task


def _bounds(
    given: Mapping[str, tuple[float, float]], recording: Recording | None, plant: Corrected
) -> tuple[FloatArray, FloatArray]:
    """(A,) least and (A,) largest command."""
    for name in given:
        choice(name, plant.action.names, "actions")
    sent = recording.transitions().actions if recording is not None else np.empty((0, 0))
    commanded = zip(recording.action.names, sent.T, strict=True) if recording is not None else ()
    known = {name: (float(column.min()), float(column.max())) for name, column in commanded}
    pairs = []
    for name in plant.action.names:
        if name not in given and name not in known:
            raise UsageError(f'make_env: say what the policy may do: actions={{"{name}": (low, high)}}')
        low, high = given.get(name, known.get(name, (0.0, 0.0)))
        if not (np.isfinite([low, high]).all() and low < high):
            raise UsageError(
                f"make_env: {name} lies between {low:g} and {high:g}: give "
                f'actions={{"{name}": (low, high)}}, low < high'
            )
        pairs.append((float(low), float(high)))
    return np.array([low for low, _ in pairs]), np.array([high for _, high in pairs])


def _starts(given: Recording | ArrayLike | None, recording: Recording | None, plant: Corrected) -> FloatArray:
    """(N, S) states."""
    given = recording if given is None else given
    if isinstance(given, Recording):
        return _states(given, plant)
    if given is None:
        raise UsageError("make_env: give the start states: starts=, states (N, S) or a recording")
    try:
        rows = np.atleast_2d(np.asarray(given, dtype=np.float64))
    except (TypeError, ValueError) as error:
        raise UsageError(f"make_env: starts: expected states (N, S), got {type(given).__name__}") from error
    if rows.ndim != 2 or rows.shape[1] != len(plant.state) or not len(rows) or not np.isfinite(rows).all():
        raise UsageError(
            f"make_env: starts: expected finite states (N, {len(plant.state)}), {plant.state.listed()}, got shape "
            f"{np.shape(given)}"
        )
    return rows


def _states(recording: Recording, plant: Corrected) -> FloatArray:
    """(N, S): where a recording has been; what nobody measured is guessed as a diagnosis begins to."""
    sight = look(recording, plant.simulator)
    shown = sight.completed(recording)
    states = shown.transitions().states
    out = np.zeros((len(states), len(plant.state)))
    for i, name in enumerate(plant.state.names):
        seen = name in shown.state.names
        out[:, i] = states[:, shown.state.index(name)] if seen else sight.held.get(name, 0.0)
    if not len(out):
        raise UsageError("make_env: the recording has no transition from which an episode could begin")
    return out


def cartpole_env(diagnosis: str | Path | None = None, gp: bool = False, **settings: Any) -> SingleEnv:
    """gpsim/CartPole-v0: balance the pole of the frictionless base simulator, or of the one that a diagnosis corrects.

    diagnosis: its folder; settings: of the task, the keys of conf/task/balance.yaml.
    """
    return _built_in("cartpole", "balance", 0.02, diagnosis, gp, settings)


def limo_env(diagnosis: str | Path | None = None, gp: bool = False, **settings: Any) -> SingleEnv:
    """gpsim/Limo-v0: drive the unicycle to a goal, or what a diagnosis makes of it; settings: conf/task/goal.yaml."""
    return _built_in("unicycle", "goal", 0.1, diagnosis, gp, settings)


def corrected_env(diagnosis: str | Path, **options: Any) -> SingleEnv:
    """gpsim/Corrected-v0: what `make_env` makes of a diagnosis's folder; options: its arguments."""
    return make_env(diagnosis, count=None, **options)


def _built_in(
    name: str, task: str, dt: float, diagnosis: str | Path | None, gp: bool, settings: Mapping[str, Any]
) -> SingleEnv:
    if diagnosis is not None:
        return make_env(diagnosis, task, count=None, gp=gp, **settings)
    simulator = open_simulator(name)
    plant = SimulatorPlant(simulator, simulator.defaults(), simulator.integrator, dt)
    return SingleEnv(plant, _fitting(_task(task, settings), plant))
