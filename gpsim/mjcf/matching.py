"""A recording in the columns of a MuJoCo model: every joint and actuator, in the model's order, commands clamped."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gpsim.channels import Channel, Channels, FloatArray
from gpsim.errors import UsageError
from gpsim.mjcf.geometry import trackable
from gpsim.mjcf.simulator import MjcfSimulator
from gpsim.recordings import Episode, Recording, pose_channels

OFF_LENGTH = (
    0.1  # that a quaternion's length may be off 1: rounding and filters, not another order of columns
)


def matched(recording: Recording, simulator: MjcfSimulator) -> Recording:
    """The recording as the model names things; raises UsageError for what the log lacks."""
    known = recording.state.names
    wanted = [c for c in simulator.state if c.name in known or c.name not in simulator.velocities]
    _all_there(recording, simulator, [c.name for c in wanted])
    columns = [recording.state.index(c.name) for c in wanted]
    state = Channels(
        tuple(_as_recorded(c, recording.state.items[i]) for c, i in zip(wanted, columns, strict=True))
    )
    commanded = bool(len(recording.action))
    given = [_given_as(name, recording, simulator) for name in simulator.action.names] if commanded else []
    action = [recording.action.index(name) for name in given]
    episodes = tuple(_episode(e, columns, action, simulator) for e in recording.episodes)
    poses, seen = _poses(recording, simulator)
    noise = {n: v for n, v in recording.noise.items() if n in (*state.names, *simulator.action.names)}
    made = replace(
        recording,
        state=state,
        action=simulator.action if commanded else recording.action,
        episodes=tuple(
            replace(_oriented(e, state, simulator), poses=own) for e, own in zip(episodes, seen, strict=True)
        ),
        poses=poses,
        noise=noise,
    )
    _check_start(made, simulator)
    return made


def _poses(recording: Recording, simulator: MjcfSimulator) -> tuple[Channels, list[FloatArray | None]]:
    """Columns that are poses of the model's sites and bodies, among the state or beside it, and each episode's."""
    own = {*simulator.state.names, *simulator.action.names}
    known = {*trackable(simulator.body.base, simulator.body.names)}
    others = [name for name in recording.state.names if name not in own]
    names = [n for n in (*recording.poses.names, *others) if n.rpartition(".")[0] in known]
    poses = pose_channels(list(dict.fromkeys(names)), own)
    if not len(poses):
        return poses, [None] * len(recording.episodes)
    return poses, [
        np.stack([_column(e, recording, n) for n in poses.names], axis=1) for e in recording.episodes
    ]


def _column(episode: Episode, recording: Recording, name: str) -> FloatArray:
    if episode.poses is not None and name in recording.poses.names:
        return episode.poses[:, recording.poses.index(name)]
    return episode.states[:, recording.state.index(name)]


def _given_as(action: str, recording: Recording, simulator: MjcfSimulator) -> str:
    """The column that holds what an actuator was given: its own, or one that stands in for it."""
    names = (action, *simulator.stand_ins.get(action, ()))
    return next((name for name in names if name in recording.action.names), action)


def _as_recorded(channel: Channel, recorded: Channel) -> Channel:
    """The model's channel, wrapping where the recording says that it does."""
    return Channel(channel.name, channel.unit, channel.wraps or recorded.wraps)


def _all_there(recording: Recording, simulator: MjcfSimulator, needed: list[str]) -> None:
    lacking = [name for name in needed if name not in recording.state.names]
    if lacking:
        raise UsageError(
            f"the recording has no column for {_listed('joint', lacking)} of {simulator.name}; it has: "
            f"{', '.join(recording.state.names)}; import the log with a mapping to these names"
        )
    lacking = [
        name
        for name in simulator.action.names
        if _given_as(name, recording, simulator) not in recording.action.names
    ]
    if lacking and len(recording.action):
        raise UsageError(
            f"the recording has no column for {_listed('actuator', lacking)} of {simulator.name}; it has: "
            f"{', '.join(recording.action.names)}; import the log with a mapping to these names, or take the "
            "actuators that nobody commands out of the model"
        )


def _listed(what: str, names: list[str]) -> str:
    return f"the {what}{'s' if len(names) > 1 else ''} {', '.join(names)}"


def _episode(episode: Episode, columns: list[int], action: list[int], simulator: MjcfSimulator) -> Episode:
    states, actions = np.array(episode.states[:, columns]), episode.actions[:, action]
    weights = None if episode.weights is None else episode.weights[:, columns]
    return replace(
        episode, states=states, actions=clamped(actions, simulator) if action else actions, weights=weights
    )


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
                f"episode {episode.name}: {', '.join(names)} are no quaternion: its length is "
                f"{length[np.argmax(np.abs(length - 1.0)), 0]:.3g}, not 1; check their order, real part first"
            )
        q = states[:, columns] / length
        turns = np.sign((q[1:] * q[:-1]).sum(axis=1))
        q[1:] *= np.cumprod(np.where(turns < 0.0, -1.0, 1.0))[:, None]
        states[:, columns] = q
    return replace(episode, states=states)


def clamped(actions: FloatArray, simulator: MjcfSimulator) -> FloatArray:
    """Commands (K, A) within their actuators' ranges: what lies beyond never reached them."""
    model = simulator.body.base
    limited = np.asarray(model.actuator_ctrllimited, dtype=np.bool_)
    low = np.where(limited, model.actuator_ctrlrange[:, 0], -np.inf)
    high = np.where(limited, model.actuator_ctrlrange[:, 1], np.inf)
    return np.clip(actions, low, high)


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
            f"episode {recording.episodes[worst].name} begins with {pairs[worst]} {-deepest[worst]:.3g} m inside each "
            f"other in {simulator.name}: check the joints' zeros, or exclude that pair from contact in the model"
        )
