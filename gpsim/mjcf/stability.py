"""A model that runs away at its own step: where, after how many steps, and by which parameter."""

from __future__ import annotations

import copy
from dataclasses import dataclass
from typing import Any

import numpy as np

from gpsim.channels import FloatArray
from gpsim.errors import UsageError
from gpsim.mjcf.naming import POSE
from gpsim.mjcf.optional import mujoco, quiet
from gpsim.mjcf.rolling import BAD, FAR
from gpsim.mjcf.simulator import MjcfSimulator
from gpsim.recordings import Episode, Recording

STARTS = 24  # moments of a recording from which the model is let go
REACH = 100  # transitions, or as many as there are before the episode ends
TOO_MANY = 0.25  # of the moments: one alone may be a sample that is wrong


@dataclass(frozen=True)
class _Run:
    """Where the model is let go: a state (S,), the commands (K, A) that follow, and where that is in the log."""

    state: FloatArray
    actions: FloatArray
    episode: str
    t: float


def check_stable(recording: Recording, simulator: MjcfSimulator) -> None:
    """Raises UsageError where the model, as it is believed, is too stiff for its step within the recording.

    A light link that whirls away, because its joint lacks a rotor or friction, is what a diagnosis is for.
    """
    runs = _runs(recording, simulator)
    n = simulator.steps_of(recording.dt)
    most = max((len(run.actions) for run in runs), default=0)
    commands = np.zeros((len(runs), most * n, len(simulator.action)))
    for i, run in enumerate(runs):
        commands[i, : len(run.actions) * n] = np.repeat(run.actions, n, axis=0)
    start = np.array([run.state for run in runs]).reshape(len(runs), -1)
    step = np.full(len(runs), recording.dt / n)
    reached = simulator.as_modelled().rolled(
        (), simulator.defaults(), (), start, commands, step, np.zeros(len(runs))
    )
    gone = np.abs(reached).max(axis=2, initial=0.0) >= FAR
    ran_away = gone.any(axis=1) & np.array([len(run.actions) > 0 for run in runs], dtype=np.bool_)
    if runs and ran_away.mean() >= TOO_MANY:
        first = int(np.flatnonzero(ran_away)[0])
        _check_stiffness(simulator, runs[first], int(np.argmax(gone[first])), n, recording.dt / n)


def _runs(recording: Recording, simulator: MjcfSimulator) -> list[_Run]:
    """Moments evenly spread over the episodes, those first that begin one."""
    places = [(e, k) for e in recording.episodes for k in range(0, max(len(e), 1), REACH) if len(e)]
    chosen = np.unique(np.linspace(0, len(places) - 1, min(STARTS, len(places))).astype(int))
    return [_run(recording, simulator, *places[i]) for i in chosen]


def _run(recording: Recording, simulator: MjcfSimulator, episode: Episode, k: int) -> _Run:
    state = np.array(simulator.rest_state)
    shown = [i for i, name in enumerate(simulator.state.names) if name in recording.state.names]
    state[shown] = episode.states[k, [recording.state.index(simulator.state.names[i]) for i in shown]]
    given = episode.actions[k : k + REACH]
    if given.shape[1] != len(simulator.action):  # nobody's commands are taken for 0
        given = np.zeros((len(given), len(simulator.action)))
    return _Run(state, np.nan_to_num(given), episode.name, float(episode.t[k]))


def _check_stiffness(simulator: MjcfSimulator, run: _Run, step: int, n: int, h: float) -> None:
    dof = _worst(simulator, run, n, h)
    parameter, value = _suspect(simulator, dof, h)
    if parameter:
        raise UsageError(
            f"{simulator.name}: runs away: no number at step {step + 1} from t = {run.t:g} s of episode {run.episode}, "
            f"at the joint {_joint(simulator, dof)}; {parameter} = {value:g} is too stiff for a step of {h:g} s: make "
            "it smaller, or the step shorter (timestep in <option>)"
        )


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
                if told.number:
                    place = int(told.lastinfo)
                    return place if name != "mjWARN_BADQPOS" else _dof_of(model, place)
    return int(np.argmax(np.abs(data.qvel)))


def _joint(simulator: MjcfSimulator, dof: int) -> str:
    joint = int(simulator.body.base.dof_jntid[dof])
    return str(simulator.body.base.joint(joint).name) or f"joint{joint}"


def _dof_of(model: Any, place: int) -> int:
    """The degree of freedom of a place in qpos."""
    joint = int(np.searchsorted(model.jnt_qposadr, place, side="right")) - 1
    within = min(place - int(model.jnt_qposadr[joint]), len(POSE) - 2)
    return int(model.jnt_dofadr[joint]) + within


def _suspect(simulator: MjcfSimulator, dof: int, h: float) -> tuple[str, float]:
    """What makes its joint stiffest within a step, and how large it is; an empty name where nothing does."""
    body = simulator.body
    model, joint = body.base, int(body.base.dof_jntid[dof])
    weight = max(float(model.dof_M0[dof]), 1e-12)
    name = _joint(simulator, dof)
    found = [
        (
            float(model.jnt_stiffness[joint]) * h**2 / weight,
            f"the stiffness of {name}",
            model.jnt_stiffness[joint],
        ),
        (float(model.dof_damping[dof]) * h / weight, f"the damping of {name}", model.dof_damping[dof]),
    ]
    for i, action in enumerate(body.names.action.names):
        if int(model.actuator_trnid[i, 0]) != joint:
            continue
        square = float(model.actuator_gear[i, 0]) ** 2
        kp, kv = -float(model.actuator_biasprm[i, 1]), -float(model.actuator_biasprm[i, 2])
        found += [
            (kp * square * h**2 / weight, f"{action}.kp", kp),
            (kv * square * h / weight, f"{action}.kv", kv),
        ]
    ratio, said, value = max(found, key=lambda item: item[0])
    return (said, float(value)) if ratio > 1.0 else ("", 0.0)
