"""A chain as the tables that compiled code reads; None where something in it has no compiled form.

What is not here falls back to NumPy, which stays the reference: a user's own simulator or law, and gates of actuators
that look at the state, whose commands nobody knows beforehand.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from gpsim.channels import FloatArray, IntArray
from gpsim.effects import (
    CATALOGUE,
    FROM,
    IN_EPISODE,
    TO,
    ActuatorEffect,
    BristleEffect,
    Chain,
    Curve,
    DriveEffect,
    Effect,
    ElasticDrive,
    ForceEffect,
    Gate,
    ParameterEffect,
    RateEffect,
    SensorEffect,
    Term,
    Values,
    VehicleEffect,
    bend_key,
)
from gpsim.kernels import codes, tables
from gpsim.kernels.lanes import LANES, LOAD, U
from gpsim.kernels.tables import LAWS, Hat
from gpsim.simulators import Memory, Whole, unwrapped, whole

SCHEMES = {"fine": codes.FINE, "euler": codes.EULER, "semi_implicit": codes.SEMI_IMPLICIT, "rk4": codes.RK4}
ACTION = 4  # the first column of an action among a compiled state's channels
Column = tuple[int, str, float, str]
"""Where a number of a row comes from: a term, the name among its values, what it is where that is missing, and another
value's name that multiplies it, empty where none does."""


@dataclass(frozen=True)
class Program:
    """The tables of a chain, as `gpsim.kernels.codes` explains their columns, and where a row's values come from.

    actuators: None where what they do has no compiled form; ways: their terms, in the order of the table. bristles:
    terms with such, and their coordinates as compiled code counts them; elastic: drives that are, and their actions.
    """

    layout: IntArray
    terms: IntArray
    conditions: IntArray
    curves: IntArray
    knots: FloatArray
    believed: FloatArray
    kept: IntArray
    rest: FloatArray
    columns: tuple[Column, ...]
    actuators: IntArray | None
    ways: tuple[int, ...]
    bristles: tuple[tuple[int, int], ...]
    elastic: tuple[tuple[int, int], ...]

    def bends(self, memory: Memory, rows: int) -> FloatArray:
        """(B, 6) how far bristles are bent, of each coordinate, then twist and its rate of each action.

        No columns where there is nothing of the kind.
        """
        out = np.zeros((rows, 6 if self.bristles or self.elastic else 0))
        for term, action in self.elastic:
            out[:, 2 + 2 * action : 4 + 2 * action] = memory[bend_key(term)]
        for term, coordinate in self.bristles:
            out[:, coordinate] = memory[bend_key(term)]
        return out

    def values(self, given: Sequence[Values], rows: int) -> FloatArray:
        """(B, V) the numbers of every row from one mapping a term of (B,) arrays."""
        out = np.empty((rows, max(len(self.columns), 1)))
        for i, (term, name, otherwise, times) in enumerate(self.columns):
            out[:, i] = given[term].get(name, otherwise)
            if times:
                out[:, i] *= given[term][times]
        return out


def program_of(chain: Chain) -> Program | None:
    """The tables of a chain; None where something in it has no compiled form."""
    kept = vars(chain)  # beside its cached properties: it is asked for once a batch
    if "program" not in kept:
        kept["program"] = _written(chain)
    found: Program | None = kept["program"]
    return found


def _written(chain: Chain) -> Program | None:
    inner = whole(unwrapped(chain.simulator))
    system = tables.SYSTEMS.get(type(inner.simulator))
    if system is None or len(inner.held) > 1 or chain.scheme not in SCHEMES or not chain.sensors.late_first:
        return None
    try:
        made = _Writer(chain, inner, system).program()
    except _NotCompiled:
        return None
    return None if chain.actuation.looks and made.actuators is None else made


class _NotCompiled(Exception):  # noqa: N818  # no error: NumPy does it
    """A law or a gate has no compiled form."""


class _Writer:
    """Writes the tables of one chain."""

    def __init__(self, chain: Chain, inner: Whole, system: int) -> None:
        self.chain, self.inner, self.system = chain, inner, system
        self.columns: list[Column] = []
        self.terms: list[list[int]] = []
        self.conditions: list[list[int]] = []
        self.curves: list[list[int]] = []
        self.knots: list[float] = []

    def program(self) -> Program:
        """All of it."""
        chain, inner = self.chain, self.inner
        ends = self._written()
        ways, actuators = self._acting()
        still = sum(1 << i for i in range(len(inner.rest)) if i not in inner.kept)
        changing = any(t[codes.GATE] < t[codes.GATE_END] for t in self.terms)
        ahead = 0
        if chain.scheme == "fine" and chain.refinement > 1:
            ahead = 1 if chain.looks_at_positions else 2
        first = [self.system, SCHEMES[chain.scheme], inner.held[0] if inner.held else -1, len(inner.kept)]
        first += [len(chain.simulator.action), 1, 0, ahead, still]
        return Program(
            np.array([*first, *ends, int(changing), LANES, int(chain.actuation.looks), 0], dtype=np.int64),
            _table(self.terms, codes.TERM_WIDTH),
            _table(self.conditions, codes.CONDITION_WIDTH),
            _table(self.curves, codes.CURVE_WIDTH),
            np.array(self.knots or [0.0]),
            np.array([float(chain.parameters[name]) for name in inner.simulator.parameters] or [0.0]),
            np.array(inner.kept, dtype=np.int64),
            np.concatenate([inner.rest, np.zeros(4 - len(inner.rest))]),
            tuple(self.columns),
            actuators,
            ways,
            tuple((i, self._place(chain.terms[i])) for i, _ in chain.bristles),
            tuple((i, column) for i, column, *_ in chain.elastic),
        )

    def _acting(self) -> tuple[tuple[int, ...], IntArray | None]:
        """The terms of actuators in the order of their ways, and their table; none where one has no compiled form."""
        of, action, rows = self.chain.terms, self.chain.simulator.action, []
        found = [i for i, t in enumerate(of) if isinstance(t.effect, ActuatorEffect)]
        found.sort(key=lambda i: of[i].effect.order)
        ways = tuple(i for on in dict.fromkeys(of[i].on for i in found) for i in found if of[i].on == on)
        for place, i in enumerate(ways):
            law = _law_of(of[i])
            if law is None:
                return ways, None
            followed = of[i].on in [of[j].on for j in ways[place + 1 :]]
            at = len(self.columns)
            self.columns += [(i, name, otherwise, "") for name, otherwise in law[1].items()]
            rows.append(
                [law[0], action.index(of[i].on), at, *self._gated(i, of[i].gate), 0, 0, int(followed)]
            )
        table = _table(rows, codes.ACTUATOR_WIDTH)
        delays = [row[codes.ON] for row in rows if row[codes.LAW] < codes.PASSES]
        return ways, table if len(set(delays)) == len(delays) else None

    def _written(self) -> list[int]:
        """Write the terms, site by site; where each site's begin, and where they end."""
        of = self.chain.terms
        forces = [i for i, t in enumerate(of) if isinstance(t.effect, ForceEffect)]
        dry = [i for i in forces if _is_dry(of[i].effect)]
        coordinates = list(dict.fromkeys(of[i].on for i in dry))
        bristled = [of[i].on for i in dry if isinstance(of[i].effect, BristleEffect)]
        if len(set(bristled)) < len(bristled):  # there is room for one bend a coordinate
            raise _NotCompiled
        parts = [
            # Elastic ones last: they transmit what the others give.
            sorted(
                (i for i, t in enumerate(of) if isinstance(t.effect, DriveEffect)),
                key=lambda i: isinstance(of[i].effect, ElasticDrive),
            ),
            [i for i in forces if i not in dry],
            # Bristles first, then those of a coordinate together.
            sorted(
                dry, key=lambda i: (not isinstance(of[i].effect, BristleEffect), coordinates.index(of[i].on))
            ),
            [i for i, t in enumerate(of) if isinstance(t.effect, ParameterEffect)],
            sorted(
                (i for i, t in enumerate(of) if isinstance(t.effect, VehicleEffect)),
                key=lambda i: of[i].effect.order,
            ),
            [i for i, t in enumerate(of) if isinstance(t.effect, RateEffect)],
        ]
        others = [t for t in of if isinstance(t.effect, ActuatorEffect | SensorEffect)]
        if sum(map(len, parts)) + len(others) < len(of):
            raise _NotCompiled
        begins = []
        for part in parts:
            begins.append(len(self.terms))
            for i in part:
                self._write(i, of[i])
        return [*begins[1:], len(self.terms)]  # those of drives begin where all do

    def _write(self, index: int, term: Term) -> None:
        effect = term.effect
        gate = self._gated(index, term.gate)
        tabled: Curve | None = getattr(effect, "curve", None)
        if tabled is not None:
            self._write_curve(index, term, tabled, gate)
            return
        law = _law_of(term)
        if law is None:
            raise _NotCompiled
        self.terms.append([law[0], self._place(term), len(self.columns), *gate, self._command(term)])
        self.columns += [(index, name, otherwise, "") for name, otherwise in law[1].items()]

    def _write_curve(self, index: int, term: Term, curve: Curve, gate: tuple[int, int]) -> None:
        if curve.of not in tables.CURVES or len(curve.axes) > 2 or min(map(len, curve.axes)) < 2:
            raise _NotCompiled
        own = curve.of in ("force", "grip", "turn", "slip")
        on = self._place(term) if own else curve.on
        if curve.of in ("turn", "slip"):
            on = codes.CLOSING if curve.beside else codes.ALONE
        for place, (family, values) in enumerate(curve.beside):
            formula = LAWS.get(CATALOGUE[family].law_of(values)) if family in CATALOGUE else None
            if formula is None or formula.number // codes.KIND_WIDTH * codes.KIND_WIDTH != codes.TURNS:
                raise _NotCompiled
            law, names = formula.number, formula.values
            self.terms.append(
                [law, codes.WITHIN if place else codes.OPENING, len(self.columns), gate[0], gate[0], -1]
            )
            self.columns += [(index, "", values[name], "") for name in names]
        self.terms.append([tables.CURVES[curve.of], on, len(self.columns), *gate, len(self.curves)])
        about: list[int] = []
        for axis, channel, wraps in zip(curve.axes, curve.inputs, curve.wraps, strict=True):
            column = channel if own else self._channel(channel)
            about += [column, int(wraps), len(self.knots), len(self.knots) + len(axis)]
            self.knots += axis
        self.curves.append([*about, -1, 0, 0, 0][: codes.CURVE_WIDTH])
        if curve.heights:
            self.columns += [(index, "", height, curve.times) for height in curve.heights]
        else:
            self.columns += [(index, name, np.nan, "") for name in curve.names]

    def _place(self, term: Term) -> int:
        """The coordinate or the parameter that a term acts on."""
        simulator = self.chain.simulator
        if isinstance(term.effect, ForceEffect | DriveEffect):
            names = [c.name for c in simulator.coordinates]
            on = simulator.driven()[term.on] if isinstance(term.effect, DriveEffect) else term.on
            return self.inner.own[names.index(on)]
        if isinstance(term.effect, ParameterEffect):
            return list(self.inner.simulator.parameters).index(term.on)
        return 0

    def _command(self, term: Term) -> int:
        """The action that a drive gives, or that presses on what rubs; -1 of all others."""
        effect, simulator = term.effect, self.chain.simulator
        if isinstance(effect, DriveEffect):
            return simulator.action.index(term.on)
        if isinstance(effect, ForceEffect) and effect.loaded_by_command:
            if term.on in simulator.served:
                return (LOAD - U) // LANES  # where `rates` leaves what the drive gives
            return next(simulator.action.index(u) for u, on in simulator.driven().items() if on == term.on)
        return -1

    def _channel(self, column: int) -> int:
        """A channel of state and action as compiled code counts them."""
        states = len(self.inner.kept)
        return self.inner.kept[column] if column < states else ACTION + column - states

    def _gated(self, index: int, gate: Gate) -> tuple[int, int]:
        """Write a gate's conditions; the first of them and the one after the last."""
        first = len(self.conditions)
        hat: Hat | None = getattr(gate, "hat", None)
        if type(gate) is not Gate and hat is None:
            raise _NotCompiled
        channels = self.chain.channels
        for name, (low, high) in gate.region.items():
            column = channels.index(name)
            edges = self._column(index, FROM, low), self._column(index, TO, high)
            wraps = int(channels.wraps[column])
            self.conditions.append([codes.REGION, self._channel(column), wraps, *edges, 0, 0])
        if gate.since is not None:
            self.conditions.append([codes.SINCE, 0, 0, self._column(index, FROM, gate.since), 0, 0, 0])
        if gate and gate.until is not None:
            self.conditions.append([codes.UNTIL, 0, 0, self._column(index, TO, gate.until), 0, 0, 0])
        if gate.since_episode is not None:
            since = self._column(index, "", float(gate.since_episode))
            own = self._column(index, IN_EPISODE, np.inf)
            self.conditions.append([codes.EPISODE, 0, 0, since, own, 0, 0])
        if hat is not None:
            column, begins = channels.index(hat.along), len(self.knots)
            self.knots += hat.knots
            wraps = int(channels.wraps[column])
            about = [codes.HAT, self._channel(column), wraps, hat.place, 0, begins, len(self.knots)]
            self.conditions.append(about)
        return first, len(self.conditions)

    def _column(self, index: int, name: str, otherwise: float) -> int:
        self.columns.append((index, name, float(otherwise), ""))
        return len(self.columns) - 1


def _is_dry(effect: Effect) -> bool:
    return isinstance(effect, ForceEffect) and effect.dry


def _law_of(term: Term) -> tuple[int, Mapping[str, float]] | None:
    """The number of a catalogue's law and its values, with what each is where it is missing; None of another's."""
    effect = term.effect
    if CATALOGUE.get(term.family) is not effect:
        return None
    if isinstance(effect, BristleEffect | ElasticDrive):
        return codes.BRISTLES if isinstance(effect, BristleEffect) else codes.ELASTIC, effect.takes
    found = LAWS.get(effect.law_of(term.values))
    return None if found is None else (found.number, found.values)


def _table(rows: list[list[int]], width: int) -> IntArray:
    return np.array(rows, dtype=np.int64).reshape(-1, width)
