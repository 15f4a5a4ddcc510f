"""What acts between one substep and the next: laws that MuJoCo has no field for, gates, accelerations from outside."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gpsim.channels import Channels, FloatArray
from gpsim.effects import BristleEffect, ElasticDrive, ForceEffect, ParameterEffect, RateEffect, Term, Values
from gpsim.errors import UsageError
from gpsim.mjcf.afloat import Axis
from gpsim.mjcf.body import Body
from gpsim.mjcf.motors import given
from gpsim.mjcf.native import FORCE, FRICTION, Fields, add_friction, native_of, parameter_fields

PASSED_ON = ("actuator", "sensor")
"""Sites whose effects are the chain's."""


@dataclass(frozen=True)
class Plan:
    """How the terms of a hypothesis act in a model, which follows from what they are and not from their values.

    lasting: terms whose fields stand as long as a rollout lasts; passing: those looked at anew at every substep.
    """

    body: Body
    terms: tuple[Term, ...]
    parameters: Mapping[str, float]

    @cached_property
    def lasting(self) -> list[int]:
        """Indices of terms that are written once."""
        return [i for i, t in enumerate(self.terms) if self._written(t) and not t.gate]

    @cached_property
    def passing(self) -> list[int]:
        """Indices of terms that are written at every substep."""
        own = [t.effect.site not in PASSED_ON or isinstance(t.effect, ElasticDrive) for t in self.terms]
        acts = [i for i, t in enumerate(self.terms) if own[i] or native_of(t, self.body)]
        return [i for i in acts if i not in self.lasting]

    @cached_property
    def fields(self) -> frozenset[str]:
        """The fields that simulations need of their own."""
        needed: set[str] = set()
        for i in (*self.lasting, *self.passing):
            needed.update(self._fields_of(self.terms[i]))
        for name in self._other:
            needed.update(parameter_fields(self.body, name))
        return frozenset(needed - {FORCE})

    @cached_property
    def moving_fields(self) -> tuple[str, ...]:
        """Fields that change from substep to substep."""
        return tuple(sorted({f for i in self.passing for f in self._fields_of(self.terms[i])} - {FORCE}))

    def write(
        self, which: Sequence[int], fields: Fields, values: Sequence[Values], shares: Mapping[int, FloatArray]
    ) -> None:
        """Write terms that need to know no state into the fields; shares (B,) of those behind gates."""
        whole = np.ones(fields.count)
        for i in which:
            term, share = self.terms[i], shares.get(i, whole)
            native = native_of(term, self.body)
            if native is not None:
                native.write(fields, self.body, term.on, values[i], share)
            elif isinstance(term.effect, ParameterEffect):
                self._write_parameter(fields, term, values[i], share)

    def believed(self, fields: Fields) -> None:
        """Write what is believed of parameters where that is not what the model says."""
        for name in self._other:
            self.body.knobs[name].write(fields, np.full(fields.count, self.parameters[name]))

    @cached_property
    def timed(self) -> bool:
        """Whether all that passes is written and waits for a moment only: most windows are before or after it."""
        passing = [self.terms[i] for i in self.passing]
        return bool(passing) and all(self._written(t) and not t.gate.region for t in passing)

    def acts_on_state(self, i: int) -> bool:
        """Whether a term's force has to be worked out from where the system is."""
        return native_of(self.terms[i], self.body) is None and isinstance(self.terms[i].effect, ForceEffect)

    @cached_property
    def _other(self) -> list[str]:
        """Parameters that are believed to be other than the model says."""
        declared = self.body.parameters
        return [n for n, v in self.parameters.items() if n in declared and v != declared[n].default]

    def _written(self, term: Term) -> bool:
        return native_of(term, self.body) is not None or isinstance(term.effect, ParameterEffect)

    def _fields_of(self, term: Term) -> tuple[str, ...]:
        native, effect = native_of(term, self.body), term.effect
        if native is not None:
            return native.fields
        if isinstance(effect, ParameterEffect):
            return tuple(field for on in term.places for field in parameter_fields(self.body, on))
        if isinstance(effect, (BristleEffect, ElasticDrive)):
            return (FORCE,)
        if isinstance(effect, ForceEffect):
            return FRICTION if effect.dry else (FORCE,)
        if isinstance(effect, RateEffect):
            return ()
        raise UsageError(f"{term.family} on {term.on}: a MuJoCo model cannot take it")

    def _write_parameter(self, fields: Fields, term: Term, values: Values, share: FloatArray) -> None:
        effect = term.effect
        assert isinstance(effect, ParameterEffect)
        for on in term.places:
            believed = np.full(fields.count, self.parameters[on])
            value = effect.corrected(believed, values)
            self.body.knobs[on].write(fields, share * value + (1.0 - share) * believed)


@dataclass(frozen=True)
class Moment:
    """Where a batch is when a substep begins: state (B, S), command (B, A), clock and length of the substep (B,) s."""

    state: FloatArray
    command: FloatArray
    t: FloatArray
    step: FloatArray


def shares_of(
    plan: Plan, channels: Channels, at: Moment, ahead: FloatArray, values: Sequence[Values]
) -> dict[int, FloatArray]:
    """(B,) of each gated term: how much of the substep it acts; ahead (B, S): about where the substep ends."""
    return {
        i: plan.terms[i].gate.share((at.state, ahead), at.command, at.t, at.step, channels, values[i])
        for i in plan.passing
        if plan.terms[i].gate
    }


def write_laws(
    plan: Plan,
    fields: Fields,
    columns: Mapping[str, tuple[int, int, int]],
    axes: Mapping[str, Axis],
    at: Moment,
    values: Sequence[Values],
    shares: Mapping[int, FloatArray],
    known: Mapping[str, FloatArray],
) -> None:
    """Forces and grips of laws that look at the state, and at what a joint's motors give.

    columns: of a coordinate its position, velocity and dof; axes: of places at free joints; known: the fields (B, ...)
    that stand meanwhile.
    """
    for i in plan.passing:
        if not plan.acts_on_state(i):
            continue
        term, share = plan.terms[i], shares.get(i, 1.0)
        effect = term.effect
        assert isinstance(effect, ForceEffect)
        for on in term.places:
            if on in axes:
                speed, direction = axes[on].along(at.state)
                force = effect.force(speed, speed, values[i])
                assert force is not None, term.family
                fields[FORCE][:, axes[on].dofs] += (share * force)[:, None] * direction
                continue
            position, velocity, dof = columns[on]
            where, speed = at.state[:, position], at.state[:, velocity]
            force = effect.force(where, speed, values[i])
            if force is not None:
                fields[FORCE][:, dof] += share * force
            load = None
            if effect.loaded_by_command:
                motors = plan.body.motors[on]
                load = np.abs(given(plan.body.model, motors, at.command, where, speed, known))
            grip = effect.grip(where, speed, values[i], load)
            if grip is not None:
                add_friction(fields, dof, share * grip)
