"""How large things typically are in a recording, and so where and how strongly an effect may act."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from gpsim.channels import FloatArray, difference
from gpsim.diagnosis.setup.along import Edges, pushed_back, ripples
from gpsim.diagnosis.setup.contacts import apart
from gpsim.diagnosis.setup.readings import stands, trails, unread
from gpsim.effects import Effect, Place
from gpsim.recordings import Recording, evenly
from gpsim.simulators import Simulator

ROWS_OF_SIZES = 4000  # transitions that sizes are taken from, at most
TYPICAL_QUANTILE = 0.95  # quantile of a channel's sizes that is its typical one
UNFORCED = 1e-6  # of the measured rates: a base simulator whose own are smaller tells no size of forces
FEWEST_WITHOUT_CONTACT = 100
"""Transitions without contact that must be left where accelerations leave out those that touch."""

TINY = 1e-150  # guards divisions, whatever the units: no size is 0, nor its square
REACH = 2.0  # standard deviations of a position, to either side, in which a law's places are looked for
MEDIAN = 0.5  # quantile
REFLECTED = 0.3
"""Of the inertia that would turn a joint's forces into its accelerations, that a rotor behind gears may well be: at a
wrist it is a thousand times what it moves (a made log of an arm of seven joints), and friction takes the rest."""


class Sizes:
    """How large things typically are in a recording."""

    def __init__(
        self,
        recording: Recording,
        simulator: Simulator,
        parameters: Mapping[str, float],
    ) -> None:
        rows = recording.transitions()
        self._trailing = _trailing(recording, simulator)
        rows = rows.take(evenly(len(rows), ROWS_OF_SIZES))
        rows = rows.take(apart(simulator, FEWEST_WITHOUT_CONTACT, rows.states, rows.next_states))
        self._reach = REACH
        self._simulator, self._dt, self._parameters = simulator, recording.dt, parameters
        self._spans = {
            name: _typical(np.abs(values), TYPICAL_QUANTILE)
            for name, values in zip(
                (*simulator.state.names, *simulator.action.names),
                np.hstack([rows.states, rows.actions]).T,
                strict=True,
            )
        }
        self._deviations = {
            n: max(float(v), TINY)
            for n, v in zip(simulator.state.names, rows.states.std(axis=0), strict=True)
        }
        self._means = dict(zip(simulator.state.names, map(float, rows.states.mean(axis=0)), strict=True))
        self._read = dict(zip(simulator.state.names, rows.states.T, strict=True))
        clock = [t for e in recording.episodes for t in (float(e.t[0]), float(e.t[-1]))]
        self._duration = max(clock) - min(0.0, min(clock))
        rates = simulator.rates(rows.states, rows.actions, parameters)
        rows_rates = simulator.measured_rates(rows.states, rows.next_states, rows.dt)
        self._forces: dict[str, float] = {}
        self._resists: dict[str, float] = {}
        self._inertias: dict[str, float] = {}
        self._visited: dict[str, tuple[float, float]] = {}
        self._edges: dict[str, Edges] = {}
        self._ripples: dict[str, tuple[tuple[float, float], ...]] = {}
        self._driven = simulator.driven()
        for i, coordinate in enumerate(simulator.coordinates):
            unit = np.zeros((len(rows), len(simulator.coordinates)))
            unit[:, i] = 1.0
            column = simulator.rate.index(coordinate.rate)
            mobility = (
                simulator.rates(rows.states, rows.actions, parameters, unit)[:, column] - rates[:, column]
            )
            usual = float(np.sqrt(np.mean(rates[:, column] ** 2)))
            if usual < UNFORCED * (measured := _typical(np.abs(rows_rates[:, column]), MEDIAN)):
                usual = measured  # nobody pushes: what it does is all that tells how large forces are
            easily = max(float(np.median(np.abs(mobility))), TINY)
            self._forces[coordinate.name] = max(usual / easily, TINY)
            self._inertias[coordinate.name] = 1.0 / easily
            moves = max(float(np.sqrt(np.mean(rows_rates[:, column] ** 2))), TINY)
            self._resists[coordinate.name] = self._forces[coordinate.name] / moves
            at, speed = (simulator.state.index(n) for n in (coordinate.name, coordinate.velocity))
            q, v = rows.states[:, at], rows.states[:, speed]
            missed = (rows_rates - rates)[:, column] / np.where(np.abs(mobility) > 0, mobility, np.inf)
            self._visited[coordinate.name] = float(q.min()), float(q.max())
            self._edges[coordinate.name] = pushed_back(q, missed)
            self._ripples[coordinate.name] = ripples(
                q, v, missed, rows.actions, recording.dt, simulator.state.wraps[at]
            )
        self._loaded = set(simulator.normal_force(rows.states, rates, parameters))

    def place(self, effect: Effect, on: str) -> Place:
        """The place `on` of an effect's site."""
        if effect.site == "force":
            coordinate = next(c for c in self._simulator.coordinates if c.name == on)
            return Place(
                on,
                coordinate.force_unit,
                length=self._simulator.state.units[on],
                span=self._forces[on],
                middle=self._means[on],
                reach=self._reach * self._deviations[on],
                speed=self._spans[coordinate.velocity],
                dt=self._dt,
                loaded=on in self._loaded,
                damping=coordinate.damping,
                friction=coordinate.friction,
                visited=self._visited[on],
                edges=self._edges[on],
                ripples=self._ripples[on],
            )
        if effect.site == "actuator":
            unit = self._simulator.action.units[on]
            driven = next((c for c in self._simulator.coordinates if c.name == self._driven.get(on)), None)
            speed = self._spans[driven.velocity] if driven else 1.0
            length = self._simulator.state.units[driven.name] if driven else ""
            return Place(
                on,
                unit,
                span=self._spans[on],
                reach=self._duration,
                dt=self._dt,
                length=length,
                speed=speed,
                inertia=self._inertias[driven.name] if driven else 1.0,
            )
        if effect.site in ("sensor", "rate") and on in self._deviations:
            read = self._read[on]
            return Place(
                on,
                self._simulator.state.units[on],
                span=self._deviations[on],
                dt=self._dt,
                visited=(float(read.min()), float(read.max())),
                stands=stands(read),
                trails=on in self._trailing,
                silent=unread(read),
            )
        if effect.site == "parameter" and on in self._simulator.parameters:
            declared = self._simulator.parameters[on]
            if declared.additive:
                believed = self._parameters[on]
                ends = (declared.low - believed, declared.high - believed)
                return Place(
                    on, declared.unit, span=declared.additive, dt=self._dt, bounds=ends, additive=True
                )
            return Place(on, "1", dt=self._dt, bounds=self._shares(on))
        if (there := self._simulator.model_places.get(effect.family, {}).get(on)) is not None:
            less, size = (-there.least, np.inf), there.size
            if effect.family == "armature":
                size = max(size, REFLECTED * self._resists[on])
            return Place(
                on, there.unit, size, reach=there.reach, dt=self._dt, bounds=less, centre=there.centre
            )
        return Place(on, "1", dt=self._dt)

    def _shares(self, on: str) -> tuple[float, float]:
        """A parameter's bounds as shares of what is believed of it, which is always between them."""
        declared, believed = self._simulator.parameters[on], self._parameters[on]
        if believed == 0.0:
            return 0.0, np.inf
        ends = sorted((declared.low / believed, declared.high / believed))
        return min(ends[0], 1.0), max(ends[1], 1.0)


def _typical(sizes: FloatArray, quantile: float) -> float:
    """Of values (N,) >= 0: their quantile, the largest where nearly all are 0 (a command that is seldom given)."""
    usual = float(np.quantile(sizes, quantile))
    return max(usual if usual > TINY else float(sizes.max()), TINY)


def _trailing(recording: Recording, simulator: Simulator) -> set[str]:
    """The channels that surely trail the position or the speed that they go with, where both were measured."""
    out: set[str] = set()
    if recording.velocities == "differentiated":
        return out
    steps = [difference(e.states[1:], e.states[:-1], simulator.state) for e in recording.episodes]
    travelled = [np.cumsum(np.insert(moved, 0, 0.0, axis=0), axis=0) for moved in steps]
    for coordinate in simulator.coordinates:
        at, speed = (simulator.state.index(n) for n in (coordinate.name, coordinate.velocity))
        whole = zip(travelled, recording.episodes, strict=True)
        which = trails([(way[:, at], e.states[:, speed], e.t) for way, e in whole])
        if which:
            out.add(coordinate.velocity if which > 0 else coordinate.name)
    return out
