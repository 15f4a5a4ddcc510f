"""Any simulator by its name, and a recording in the columns of a MuJoCo model, which must not run away in it.

A recording is brought to every joint and actuator in the model's order, commands clamped. A model that runs away at its
own step is told with the place, the number of steps and the parameter.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from gpsim.channels import Channel, Channels, FloatArray
from gpsim.errors import UsageError
from gpsim.files import file_digest
from gpsim.mjcf.geometry import trackable
from gpsim.mjcf.loading import is_mujoco, source_of
from gpsim.mjcf.naming import POSE, called
from gpsim.mjcf.optional import mujoco, quiet
from gpsim.mjcf.rolling import BAD, FAR
from gpsim.mjcf.simulator import MjcfSimulator, load_mjcf
from gpsim.recordings import Episode, Recording, pose_channels
from gpsim.simulators import Simulator, make_simulator, source_file
from gpsim.trust import GYM

SYSTEM = "mjcf"
"""What recordings call a system that a MuJoCo model simulates."""
OFF_LENGTH = 0.1
"""That a quaternion's length may be off 1: rounding and filters, not another order of columns."""
STARTS = 24  # moments of a recording from which the model is let go
REACH = 100  # transitions, or as many as there are before the episode ends
TOO_MANY = 0.25  # of the moments: one alone may be a sample that is wrong


def open_simulator(name: str) -> Simulator:
    """The simulator of a name; raises UsageError."""
    if name == SYSTEM:
        raise UsageError(
            "system: mjcf: it needs a MuJoCo model; name it with --simulator robot.xml, or model: in recording.yaml"
        )
    return load_mjcf(name) if is_mujoco(name) else make_simulator(name)


def simulator_name(given: str | None, recording: Recording, folder: Path) -> str:
    """The simulator that is asked for: the one given, or what the recording in this folder says."""
    if given is not None:
        return given
    model = recording.model
    if recording.system != SYSTEM or model is None:
        return recording.system
    file = model.rpartition(":")[0] if model.rpartition(":")[0].endswith(".py") else model
    beside = folder / file
    there = not model.startswith(GYM) and not Path(file).is_absolute() and beside.is_file()
    return str(folder / model) if there else model


def in_its_columns(recording: Recording, simulator: Simulator) -> Recording:
    """The recording in the columns of a MuJoCo model; as it is for any other simulator.

    Raises UsageError for what the log lacks, and where the model runs away in it.
    """
    if not isinstance(simulator, MjcfSimulator):
        return recording
    made = _matched(recording, simulator)
    _check_stable(made, simulator)
    return made


def files_digest(name: str) -> str | Mapping[str, str] | None:
    """Hashes of a simulator's files: one of a user's own, one a file of a MuJoCo model; None of a registered one."""
    if is_mujoco(name):
        return dict(source_of(name).files)
    source = source_file(name)
    return file_digest(source) if source else None


def _matched(recording: Recording, simulator: MjcfSimulator) -> Recording:
    known = recording.state.names
    wanted = [c for c in simulator.state if c.name in known or c.name not in simulator.velocities]
    stands_in = simulator.stand_ins
    given = {}  # of every actuator the column that holds what it was given: its own, or one that stands in for it
    for name in simulator.action.names:
        offered = (name, *stands_in.get(name, ()))
        given[name] = next((column for column in offered if column in recording.action.names), None)
    _check_columns(recording, simulator, [c.name for c in wanted if c.name not in known], given)
    columns = [recording.state.index(c.name) for c in wanted]
    pairs = zip(wanted, (recording.state.items[i] for i in columns), strict=True)
    # The model's channels, wrapping where the recording says that they do.
    state = Channels(tuple(Channel(own.name, own.unit, own.wraps or said.wraps) for own, said in pairs))
    commanded = bool(len(recording.action))
    action = [recording.action.index(name) for name in given.values() if commanded and name]
    poses, seen = _poses(recording, simulator)
    # What lies beyond its actuator's range never reached it.
    model, nowhere = simulator.body.base, [-np.inf, np.inf]
    low, high = np.where(model.actuator_ctrllimited[:, None] != 0, model.actuator_ctrlrange, nowhere).T
    episodes = []
    for episode, own in zip(recording.episodes, seen, strict=True):
        actions = episode.actions[:, action]
        weights = None if episode.weights is None else episode.weights[:, columns]
        made = replace(
            episode,
            states=np.array(episode.states[:, columns]),
            actions=np.clip(actions, low, high) if action else actions,
            weights=weights,
            poses=own,
        )
        episodes.append(_oriented(made, state, simulator))
    noise = {n: v for n, v in recording.noise.items() if n in (*state.names, *simulator.action.names)}
    matched = replace(
        recording,
        state=state,
        action=simulator.action if commanded else recording.action,
        episodes=tuple(episodes),
        poses=poses,
        noise=noise,
    )
    _check_start(matched, simulator)
    return matched


def _check_columns(
    recording: Recording, simulator: MjcfSimulator, joints: list[str], given: Mapping[str, str | None]
) -> None:
    """Raises UsageError for joints, and for actuators given nothing, that a log lacks."""

    def lacking(what: str, names: list[str], has: Channels) -> str:
        several = "s" if len(names) > 1 else ""
        return (
            f"the recording has no column for the {what}{several} {', '.join(names)} of {simulator.name}; it has: "
            f"{', '.join(has.names)}; import the log with a mapping to these names"
        )

    if joints:
        raise UsageError(lacking("joint", joints, recording.state))
    idle = [name for name, column in given.items() if column is None]
    if idle and len(recording.action):
        said = lacking("actuator", idle, recording.action)
        raise UsageError(f"{said}, or remove the actuators without commands from the model")


def _poses(recording: Recording, simulator: MjcfSimulator) -> tuple[Channels, list[FloatArray | None]]:
    """Columns that are poses of the model's sites and bodies, among the state or beside it, and each episode's."""
    own = {*simulator.state.names, *simulator.action.names}
    known = {*trackable(simulator.body.base, simulator.body.names)}
    others = [name for name in recording.state.names if name not in own]
    names = [n for n in (*recording.poses.names, *others) if n.rpartition(".")[0] in known]
    poses = pose_channels(list(dict.fromkeys(names)), own)
    if not len(poses):
        return poses, [None] * len(recording.episodes)

    def column(episode: Episode, name: str) -> FloatArray:
        if episode.poses is not None and name in recording.poses.names:
            return episode.poses[:, recording.poses.index(name)]
        return episode.states[:, recording.state.index(name)]

    return poses, [np.stack([column(e, n) for n in poses.names], axis=1) for e in recording.episodes]


def _oriented(episode: Episode, state: Channels, simulator: MjcfSimulator) -> Episode:
    """Quaternions of length 1, which go from sample to sample the shorter way round: q and -q are the same."""
    if not simulator.layout.turned:
        return episode
    states = np.array(episode.states)
    for turned in simulator.layout.turned:
        names = [simulator.state.names[i] for i in turned]
        columns = [state.index(name) for name in names]
        length = np.linalg.norm(states[:, columns], axis=1, keepdims=True)
        if np.abs(length - 1.0).max() > OFF_LENGTH:
            raise UsageError(
                f"episode {episode.name}: {', '.join(names)} are not a quaternion: the length is "
                f"{length[np.argmax(np.abs(length - 1.0)), 0]:.3g}, not 1; check their order, real part first"
            )
        q = states[:, columns] / length
        turns = np.sign((q[1:] * q[:-1]).sum(axis=1))
        q[1:] *= np.cumprod(np.where(turns < 0.0, -1.0, 1.0))[:, None]
        states[:, columns] = q
    return replace(episode, states=states)


def _check_start(recording: Recording, simulator: MjcfSimulator) -> None:
    """An episode that begins inside something is thrown out of it by the model, which is no physics."""
    first = np.zeros((len(recording.episodes), len(simulator.state)))
    for i, name in enumerate(simulator.state.names):
        if name in recording.state.names:
            column = recording.state.index(name)
            first[:, i] = [e.states[0, column] for e in recording.episodes]
    deepest, pairs = simulator.penetration(first)
    worst = int(np.argmin(deepest)) if len(deepest) else 0
    if len(deepest) and deepest[worst] < -simulator.tolerated_penetration:
        raise UsageError(
            f"episode {recording.episodes[worst].name} starts with {pairs[worst]} overlapping by "
            f"{-deepest[worst]:.3g} m in {simulator.name}: check the joints' zeros, or exclude that pair from contact "
            "in the model"
        )


def _check_stable(recording: Recording, simulator: MjcfSimulator) -> None:
    """Raises UsageError where the model, as it is believed, is too stiff for its step within the recording.

    A light link that whirls away, because its joint lacks a rotor or friction, is what a diagnosis is for.
    """
    # Moments evenly spread over the episodes, those first that begin one.
    places = [(e, k) for e in recording.episodes for k in range(0, len(e), REACH)]
    chosen = np.unique(np.linspace(0, len(places) - 1, min(STARTS, len(places))).astype(int))
    runs = [_run(recording, simulator, *places[i]) for i in chosen]
    n = simulator.steps_of(recording.dt)
    most = max((len(run.actions) for run in runs), default=0)
    commands = np.zeros((len(runs), most * n, len(simulator.action)))
    for i, run in enumerate(runs):
        commands[i, : len(run.actions) * n] = np.repeat(run.actions, n, axis=0)
    start = np.array([run.state for run in runs]).reshape(len(runs), -1)
    how = start, commands, np.full(len(runs), recording.dt / n), np.zeros(len(runs))
    reached = simulator.as_modelled().rolled((), simulator.defaults(), (), *how)
    gone = np.abs(reached).max(axis=2, initial=0.0) >= FAR
    ran_away = gone.any(axis=1) & np.array([len(run.actions) > 0 for run in runs], dtype=np.bool_)
    if not runs or ran_away.mean() < TOO_MANY:
        return
    first, h, model = int(np.flatnonzero(ran_away)[0]), recording.dt / n, simulator.body.base
    run, dof = runs[first], _worst(simulator, runs[first], n, h)
    joint = called(model, "joint", int(model.dof_jntid[dof]))
    parameter, value = _suspect(simulator, dof, joint, h)
    if parameter:
        raise UsageError(
            f"{simulator.name}: runs away: no number at step {int(np.argmax(gone[first])) + 1} from t = {run.t:g} s "
            f"of episode {run.episode}, at the joint {joint}; {parameter} = {value:g} is too stiff for a step of "
            f"{h:g} s: make it smaller, or the step shorter (timestep in <option>)"
        )


class _Run(NamedTuple):
    """Where the model is let go: a state (S,), the commands (K, A) that follow, and where that is in the log."""

    state: FloatArray
    actions: FloatArray
    episode: str
    t: float


def _run(recording: Recording, simulator: MjcfSimulator, episode: Episode, k: int) -> _Run:
    state = np.array(simulator.rest_state)
    shown = [i for i, name in enumerate(simulator.state.names) if name in recording.state.names]
    state[shown] = episode.states[k, [recording.state.index(simulator.state.names[i]) for i in shown]]
    given = episode.actions[k : k + REACH]
    if given.shape[1] != len(simulator.action):  # nobody's commands are taken for 0
        given = np.zeros((len(given), len(simulator.action)))
    return _Run(state, np.nan_to_num(given), episode.name, float(episode.t[k]))


def _worst(simulator: MjcfSimulator, run: _Run, n: int, h: float) -> int:
    """The degree of freedom that MuJoCo warns of first, in n steps of h [s] a transition."""
    mj, model = mujoco(), copy.copy(simulator.body.base)
    model.opt.timestep = h
    data = mj.MjData(model)
    data.qpos[:], data.qvel[:] = (part[0] for part in simulator.layout.full(run.state[None]))
    with quiet():
        for action in np.repeat(run.actions, n, axis=0):
            data.ctrl[:] = action
            mj.mj_step(model, data)
            for name in BAD:
                told = data.warning[int(getattr(mj.mjtWarning, name))]
                place = int(told.lastinfo)
                if told.number and name != "mjWARN_BADQPOS":
                    return place
                if told.number:  # a place in qpos
                    joint = int(np.searchsorted(model.jnt_qposadr, place, side="right")) - 1
                    within = min(place - int(model.jnt_qposadr[joint]), len(POSE) - 2)
                    return int(model.jnt_dofadr[joint]) + within
    return int(np.argmax(np.abs(data.qvel)))


def _suspect(simulator: MjcfSimulator, dof: int, name: str, h: float) -> tuple[str, float]:
    """What makes a degree of freedom stiffest within a step, and how large it is; an empty name where nothing does.

    name: of its joint.
    """
    model, joint = simulator.body.base, int(simulator.body.base.dof_jntid[dof])
    stiff, damped = float(model.jnt_stiffness[joint]), float(model.dof_damping[dof])
    found = [
        (stiff * h**2, f"the stiffness of {name}", stiff),
        (damped * h, f"the damping of {name}", damped),
    ]
    for i, action in enumerate(simulator.action.names):
        if int(model.actuator_trnid[i, 0]) == joint:
            square = float(model.actuator_gear[i, 0]) ** 2
            kp, kv = -float(model.actuator_biasprm[i, 1]), -float(model.actuator_biasprm[i, 2])
            found += [(kp * square * h**2, f"{action}.kp", kp), (kv * square * h, f"{action}.kv", kv)]
    size, said, value = max(found, key=lambda item: item[0])
    return (said, value) if size / max(float(model.dof_M0[dof]), 1e-12) > 1.0 else ("", 0.0)
