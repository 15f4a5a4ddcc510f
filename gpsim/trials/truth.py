"""What truly happens in a concealed world: command, actuators, what moves, sensors, noise; and the same replayed.

A replay goes from chosen states with some of the effects absent, and is held against the base simulator's own step.
Nothing here, nor what it imports, is of `gpsim.effects`, `gpsim.simulators` or `gpsim.diagnosis`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np

from gpsim.channels import FloatArray, IntArray, wrap_angle
from gpsim.recordings import Recording
from gpsim.trials import catalogue, out_of_catalogue
from gpsim.trials.bodies import HIDDEN, HIDDEN_TWISTS, Body, Moving, MujocoBody, Now, Vehicle
from gpsim.trials.driving import Driving, drive, starts
from gpsim.trials.worlds import SYSTEMS, Run, TrueEffect, Values, World, dynamics

SENSORS = catalogue.SENSORS
REMEMBERING, DISTORTING = out_of_catalogue.at_site("memory"), out_of_catalogue.at_site("distortion")
ACTUATORS: Mapping[str, Callable[[Values], catalogue.Actuator]] = catalogue.acting(out_of_catalogue.LAWS)
LAST_HIDDEN = (*catalogue.BRISTLES, *catalogue.COUPLINGS)
HIDDEN_STATES = dict.fromkeys((*HIDDEN, *LAST_HIDDEN), 2) | dict.fromkeys(HIDDEN_TWISTS, 1)
"""Kinds that remember in the body, and how many columns that takes."""
H = 1e-3  # s
FRICTION_H = 2.5e-4  # s: MuJoCo meets a stop at the ends of steps only
FAR = 1e6  # where a state that runs away is held


def sense(
    effects: Sequence[TrueEffect], names: tuple[str, ...], past: FloatArray, index: int, h: float
) -> FloatArray:
    """(E, S) readings at fine step `index`; past: (>= index + 1, E, S) true states every h s.

    What a delayed sensor saw before the start is the start: episodes begin at rest.
    """
    now = past[index].copy()
    ordered = sorted((e for e in effects if e.family in SENSORS), key=lambda e: SENSORS.index(e.family))
    for effect in (e for e in ordered if e.family == "sensor_delay"):
        column = names.index(effect.on)
        back = max(index - round(effect.values["delay"] / h), 0)
        now[:, column] = past[back, :, column]
    for laws in (REMEMBERING, catalogue.PAST_SENSORS):
        for effect in (e for e in effects if e.family in laws):
            column = names.index(effect.on)
            now[:, column] = laws[effect.family](effect.values, past[: index + 1, :, column], h)
    for effect in ordered:
        catalogue.read(effect, names, now)
    for effect in (e for e in effects if e.family in DISTORTING):
        part = slice(0, 2) if effect.on == "pose" else names.index(effect.on)
        now[:, part] = DISTORTING[effect.family](effect.values, now[:, part])
    return np.asarray(now)


def limited(effects: Sequence[TrueEffect], names: tuple[str, ...], readings: FloatArray) -> FloatArray:
    """(..., S) what is written down of readings, noise included: a sensor's range and dead zone act on both."""
    out = readings
    for effect in (e for e in effects if e.family in catalogue.LAST_SENSORS):
        column, out = names.index(effect.on), out.copy()
        out[..., column] = catalogue.LAST_SENSORS[effect.family](effect.values, out[..., column])
    return out


class Frame(NamedTuple):
    """What a world's simulator is made of: its channels, its commands, and what moves with some effects.

    far: where a state that runs away is held.
    """

    names: tuple[str, ...]
    actions: tuple[str, ...]
    body: Callable[[Sequence[TrueEffect], float], Moving]
    far: float = FAR


def frame_of(world: World) -> Frame:
    """Of a world whose equations are known; by Runge-Kutta steps."""
    system = SYSTEMS[world.system]
    return Frame(system.names, tuple(system.action), lambda effects, h: _body(world, effects, "rk4", h))


def _body(world: World, effects: Sequence[TrueEffect], engine: str, h: float) -> Moving:
    if SYSTEMS[world.system].vehicle:
        return Vehicle(effects)
    if engine == "mujoco":
        return MujocoBody(world.system, world.parameters, effects, h)
    return Body(world.system, world.parameters, effects)


class ActuatorChain:
    """The actuators of every action, in their order, with their memory."""

    def __init__(self, frame: Frame, effects: Sequence[TrueEffect]) -> None:
        order = tuple(ACTUATORS)
        ordered = sorted((e for e in effects if e.family in order), key=lambda e: order.index(e.family))
        self._names = frame.names
        self._parts = [(e, frame.actions.index(e.on), ACTUATORS[e.family](e.values)) for e in ordered]

    def act(self, command: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        """(B, A) what acts during the next h s."""
        if not self._parts:
            return command
        out = command.copy()
        for effect, column, actuator in self._parts:
            acted = actuator.act(out[:, column].copy(), s, t, h)
            if effect.gated:
                acted = np.where(effect.acts(s, t, self._names) > 0, acted, out[:, column])
            out[:, column] = acted
        return out


def run(
    world: World, effects: Sequence[TrueEffect], h: float | None = None, driving: Driving | None = None
) -> Run:
    """Drive the world; `h` is the fine step, by default the engine's own; driving: the world's own excitation."""
    dry = any(e.family in catalogue.GRIP for e in effects)
    h = h or (FRICTION_H if world.engine == "mujoco" and dry else H)
    body = _body(world, effects, world.engine, h)
    return driven(world, effects, frame_of(world), body, driving or drive(world), starts(world), h)


def driven(
    world: World, effects: Sequence[TrueEffect], frame: Frame, body: Moving, driving: Driving, state: FloatArray,
    h: float,
) -> Run:  # fmt: skip
    """The run of a world from states (E, S), by fine steps of h s."""
    names, n, chain = frame.names, round(world.dt / h), ActuatorChain(frame, effects)
    hidden, sensors, noise = body.begin(state), (*effects, *world.late), noise_of(world, names)
    fine = np.empty((world.steps * n + 1, *state.shape))
    fine[0] = state
    commands = np.empty((world.steps, world.episodes, len(frame.actions)))
    clean = np.empty((world.steps + 1, *state.shape))
    kept, free = np.empty((world.steps + 1, *hidden.shape)), np.ones((world.steps + 1, world.episodes))
    with np.errstate(all="ignore"):
        for k in range(world.steps):
            clean[k], kept[k] = sense(sensors, names, fine, k * n, h), hidden
            commands[k] = driving(k, limited(effects, names, clean[k] + noise[k]))
            for j in range(n):
                late = k * world.dt + j * h
                t, wall = world.clock_offsets + late, world.offsets + late
                acting = chain.act(commands[k], state, t, h)
                state, hidden = body.step(state, hidden, Now(acting, t, wall), h)
                fine[k * n + j + 1] = state
            free[k + 1] = free[k] * body.free()
            state = np.nan_to_num(np.clip(state, -frame.far, frame.far))
    clean[-1], kept[-1] = sense(sensors, names, fine, world.steps * n, h), hidden
    perfect, measured = (limited(effects, names, readings) for readings in (clean, clean + noise))
    return Run(fine, h, commands, perfect, measured, kept, world.clock_offsets, world.offsets, free)


def noise_of(world: World, names: tuple[str, ...]) -> FloatArray:
    """(K + 1, E, S) what the sensors add."""
    sd = np.array([world.noise[name] for name in names])
    return np.asarray(world.generator(3).normal(size=(world.steps + 1, world.episodes, len(sd))) * sd)


class Replay:
    """The same run with only `effects` present. Picks are (2, N): sample and episode at which pieces begin."""

    def __init__(
        self, world: World, truth: Run, effects: Sequence[TrueEffect], frame: Frame | None = None
    ) -> None:
        self._world, self._truth, self._effects = world, truth, effects
        self._frame = frame or frame_of(world)

    def residual(self, picks: IntArray) -> FloatArray:
        """(N, S) per second, by how much one step differs from the base simulator's, started at what is read."""
        before, after = pick(self._read, picks, 0), pick(self._read, picks, 1)
        state_error = self.states(picks, 1) - pick(self._truth.sampled, picks, 1)
        return base_residual(self._world, before, after + state_error, pick(self._truth.commands, picks, 0))

    def moved(self, picks: IntArray, length: int) -> FloatArray:
        """(N, S) how far the readings move within `length` transitions."""
        true = pick(self._truth.sampled, picks, length)
        change = pick(self._read, picks, length) - pick(self._read, picks, 0)
        return np.asarray(change + self.states(picks, length) - true)

    def states(self, picks: IntArray, length: int, starts: FloatArray | None = None) -> FloatArray:
        """(N, S) true states `length` transitions after the picks, from `starts` (N, S), by default the true ones."""
        return np.asarray(self.path(picks, length, starts)[-1])

    def path(self, picks: IntArray, length: int, starts: FloatArray | None = None) -> FloatArray:
        """(length, N, S) true states 1 to `length` transitions after the picks, as `states` has the last."""
        world, truth, n = self._world, self._truth, self._truth.per_sample
        body = self._frame.body(self._effects, truth.h)
        state = pick(truth.sampled, picks, 0) if starts is None else starts
        hidden = body.begin(state)
        if hidden.shape[1]:  # what was hidden then, as the effect that hides it is present
            hidden = pick(truth.hidden, picks, 0)[:, self._hidden]
        first, late = picks[0] * n, world.dt * picks[0]
        out = np.empty((length, *state.shape))
        with np.errstate(all="ignore"):
            for j in range(length * n):
                t = truth.clock[picks[1]] + late + j * truth.h
                wall = truth.wall[picks[1]] + late + j * truth.h
                now = Now(self._acting[first + j, picks[1]], t, wall)
                state, hidden = body.step(state, hidden, now, truth.h)
                if (j + 1) % n == 0:
                    out[j // n] = state
        return out

    def readings(self, picks: IntArray, length: int) -> FloatArray:
        """(length, N, S) what the sensors say along `path`, begun where they say what is read at the picks.

        They see what is off the true states as it is: exact for what they add, near for what they scale or delay.
        """
        true, read = self._truth.sampled, self._read
        starts = pick(true, picks, 0) + pick(self._truth.clean, picks, 0) - pick(read, picks, 0)
        true, seen = picked(true, picks, length), picked(read, picks, length)
        return np.asarray(self.path(picks, length, starts) - true + seen)

    @property
    def _hidden(self) -> list[int]:
        """The columns of the truth's hidden states that belong to the effects that are present."""
        ordered = sorted(
            self._world.effects, key=lambda e: LAST_HIDDEN.index(e.family) if e.family in LAST_HIDDEN else -1
        )
        owned = [e in self._effects for e in ordered for _ in range(HIDDEN_STATES.get(e.family, 0))]
        return [i for i, there in enumerate(owned) if there]

    @cached_property
    def _read(self) -> FloatArray:
        """(K + 1, E, S) what the sensors say of the true states."""
        truth, names = self._truth, self._frame.names
        steps = range(0, len(truth.fine), truth.per_sample)
        sensors = (*self._effects, *self._world.late)
        read = np.stack([sense(sensors, names, truth.fine, i, truth.h) for i in steps])
        return limited(self._effects, names, read)

    @cached_property
    def _acting(self) -> FloatArray:
        """(K n, E, A) what the actuators make of the commands, along the true states."""
        truth, n = self._truth, self._truth.per_sample
        chain = ActuatorChain(self._frame, self._effects)
        out = np.empty((len(truth.commands) * n, *truth.commands.shape[1:]))
        for i in range(len(out)):
            t = truth.clock + i * truth.h
            out[i] = chain.act(truth.commands[i // n], truth.fine[i], t, truth.h)
        return out


def pick(values: FloatArray, picks: IntArray, late: int) -> FloatArray:
    """(N, ...) of values (K + 1, E, ...), `late` samples after the picks."""
    return np.asarray(values[picks[0] + late, picks[1]])


def picked(values: FloatArray, picks: IntArray, length: int) -> FloatArray:
    """(length, N, ...) of values (K + 1, E, ...), 1 to `length` samples after the picks."""
    return np.stack([pick(values, picks, j) for j in range(1, length + 1)])


def base_residual(world: World, before: FloatArray, after: FloatArray, action: FloatArray) -> FloatArray:
    """(N, S) per second: readings after a step, less the base simulator's step from the readings before it.

    A vehicle's are in its body's frame: v, v_lateral, w.
    """
    dt = world.dt
    if SYSTEMS[world.system].vehicle:
        moved = (after - before) / dt
        moved[:, 2] = (moved[:, 2] * dt + np.pi) % (2 * np.pi) / dt - np.pi / dt
        moved = _in_the_body(moved, before)
        moved[:, [0, 2]] -= action
        return moved

    def slope(s: FloatArray) -> FloatArray:
        inverse, force = dynamics(world.system, world.parameters, s, action)
        out = np.empty_like(s)
        out[:, 0::2], out[:, 1::2] = s[:, 1::2], (inverse * force[:, None, :]).sum(axis=2)
        return out

    k1 = slope(before)
    step = before + dt * k1
    if world.integrator == "semi_implicit":
        step[:, 0::2] = before[:, 0::2] + dt * step[:, 1::2]
    elif world.integrator == "rk4":
        k2 = slope(before + dt / 2 * k1)
        k3 = slope(before + dt / 2 * k2)
        step = before + dt / 6 * (k1 + 2 * (k2 + k3) + slope(before + dt * k3))
    return np.asarray((after - step) / dt)


def _in_the_body(moved: FloatArray, before: FloatArray) -> FloatArray:
    """(N, 3) a vehicle's differences in its body's frame at the pose before."""
    sin, cos = np.sin(before[:, 2]), np.cos(before[:, 2])
    ahead, aside = moved[:, 0] * cos + moved[:, 1] * sin, moved[:, 1] * cos - moved[:, 0] * sin
    return np.stack([ahead, aside, moved[:, 2]], axis=1)


class OneStep(NamedTuple):
    """Residual rates of every transition of every episode that was kept, (N, R), and their episodes (N,)."""

    base: FloatArray
    own: FloatArray
    episode: IntArray


def one_step(world: World, truth: Run, recording: Recording, clean: Recording, kept: FloatArray) -> OneStep:
    """Of the base simulator and of the true model, both started at what was recorded.

    The true model knows what its actuators remember, what its sensors do and what differentiating positions does
    (`clean` is the recording as it were without noise), not what the noise was.
    """
    rows, vehicle = np.flatnonzero(kept), SYSTEMS[world.system].vehicle
    lengths = [len(episode) for episode in recording.episodes]
    pairs = [np.stack([np.arange(k), np.full(k, e)]) for k, e in zip(lengths, rows, strict=True)]
    picks = np.hstack(pairs).astype(np.int64)

    def ends(of: Recording) -> list[FloatArray]:
        return [np.concatenate([e.states[part] for e in of.episodes]) for part in (slice(-1), slice(1, None))]

    def difference(a: FloatArray, b: FloatArray) -> FloatArray:
        state_error = np.array(a - b)
        if vehicle:
            state_error[:, 2] = wrap_angle(state_error[:, 2])
        return state_error

    def rates(residual: FloatArray) -> FloatArray:
        return residual if vehicle else residual[:, 1::2]

    (before, after), (clean_before, clean_after) = ends(recording), ends(clean)
    action = np.concatenate([e.actions for e in recording.episodes])
    starts = pick(truth.sampled, picks, 0) + difference(before, clean_before)
    moved = Replay(world, truth, world.effects).states(picks, 1, starts) - pick(truth.sampled, picks, 1)
    left = difference(after, clean_after + moved)
    if vehicle:
        left = _in_the_body(left, before)
    return OneStep(
        rates(base_residual(world, before, after, action)),
        rates(left / world.dt),
        np.repeat(np.arange(len(rows), dtype=np.int64), lengths),
    )
