"""What may be missing, as the ladder knows it: which laws are usual for a kind of machine, and what the others cost.

An engineer who identifies a machine starts from all that machines of the kind have, and believes in what they seldom
have when the recording insists. `USUAL` says what the first is, with the reason; `PRICES` what it takes to insist.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from gpsim.diagnosis.fitting import Candidate
from gpsim.diagnosis.settings import Known, LawSettings
from gpsim.effects import (
    RISE,
    ActuatorEffect,
    DriveEffect,
    ForceEffect,
    Gate,
    SensorEffect,
    Term,
    closed,
    declared,
    effect_of,
)
from gpsim.simulators import Simulator

USUAL: Mapping[str, Mapping[str, str]] = {
    "coordinate": {
        "viscous_friction": "bearings and seals are lubricated",
        "coulomb_friction": "sliding and meshing parts also have dry friction",
        "constant_force": "no axis is exactly level, and every amplifier has an offset",
        "parameter_offset": "masses, lengths and stiffnesses are guessed or come from a drawing",
        "actuator_gain": "the constant of a drive comes from a data sheet",
        "actuator_delay": "buses, drivers and cameras cause delays",
        "armature": "the rotor inertia behind gears often exceeds that of the load",
        "joint_offset": "the zero of an encoder is set by hand",
        "sensor_bias": "the zero of a sensor is set by hand",
    },
    "vehicle": {
        "actuator_gain": "wheels wear, and slip a little",
        "actuator_delay": "radio, driver and camera cause delays",
        "actuator_lag": "motors and steering servos need time to respond",
        "actuator_saturation": "batteries and steering angles are limited",
        "actuator_rate_limit": "speed controllers ramp",
        "actuator_bias": "a steering's trim is never exact",
        "steering_bias": "a car does not drive straight",
        "understeer": "tyre slip increases with the turn rate",
        "lateral_slip": "tyres need a slip angle to produce a lateral force",
        "marker_offset": "a marker is rarely exactly on the axle",
        "frame_rotation": "a marker is rarely mounted straight",
        "parameter_offset": "wheelbases are measured with a ruler",
    },
    "robot": {
        "viscous_friction": "bearings, seals and gears are lubricated",
        "coulomb_friction": "gears mesh dry",
        "armature": "the rotor inertia behind gears often exceeds that of the load",
        "constant_force": "every amplifier has an offset, and cables pull",
        "actuator_gain": "a torque constant comes from a data sheet",
        "actuator_delay": "buses delay all commands equally",
        "payload": "somebody mounted something",
    },
    "floating": {
        "viscous_friction": "propellers and hulls have linear drag at low speed; joints are lubricated",
        "quadratic_drag": "frames and hulls meet a fluid",
        "constant_force": "wind and currents push, and the trim is never perfect",
        "actuator_gain": "a thrust constant comes from a data sheet, for another voltage",
        "actuator_lag": "rotors need time to spin up",
        "actuator_delay": "radios and buses are late",
        "parameter_offset": "batteries and payload are weighed separately from the frame; the inertia is a guess",
        "coulomb_friction": "gears mesh dry",
        "armature": "the rotor inertia behind gears often exceeds that of the load",
        "payload": "somebody mounted something",
    },
    "first order": {
        "parameter_offset": "coefficients of a reduced model are guesses",
        "actuator_gain": "the constant of a pump comes from a data sheet",
        "actuator_delay": "pipes, buses and drivers cause delays",
        "sensor_bias": "the zero of a sensor is set by hand",
        "overflow": "vessels have rims",
        "spillover": "vessels have rims, and one stands below the other",
    },
}
"""Kind of machine -> family -> why it is usual there."""

SERVO_GAINS = (
    ".kp",
    ".kv",
)  # of a model's servos, which are usually guessed: firmware counts in units of its own
KNOWN_WELL = (("parameter_offset", "gravity"),)  # what nobody gets wrong

PRESSED = (
    "coefficient"  # the variant of dry friction that goes by what presses, where the simulator knows that
)
DRAG = ("quadratic_drag",)
RARE = (
    "clock_drift", "wheel_saturation", "torque_speed_limit", "lugre_friction", "flexible_coupling", "cubic_spring",
    "sensor_lag", "sensor_dead_zone", "sensor_saturation", "gravity_compensation", "gravity_tilt", "load_friction",
)  # fmt: skip
"""Families that a machine hardly ever has, or that take three numbers and bend to anything."""

STIFF = {"flexible_coupling": "armature", "lugre_friction": "coulomb_friction"}
"""What laws that remember are when nothing yields: a rotor on the load, friction that holds."""

SCANS: Mapping[str, tuple[float, ...]] = {
    "actuator_delay": (0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 9.0, 12.0),
    "sensor_delay": (0.5, 1.0, 2.0, 3.0),
    "actuator_lag": (0.5, 1.0, 2.0, 4.0, 8.0, 16.0),
    "sensor_lag": (0.5, 1.0, 2.0),
    "actuator_dead_zone": (0.03, 0.06, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5),
    "actuator_dead_band": (0.03, 0.08, 0.15, 0.25),
    "actuator_saturation": (0.95, 0.85, 0.75, 0.65, 0.5, 0.4, 0.3),
    "actuator_backlash": (0.03, 0.06, 0.1, 0.2, 0.3),
    "actuator_rate_limit": (0.8, 0.6, 0.45, 0.33, 0.2, 0.12, 0.07, 0.04),
}
"""Family -> where a first parameter that has no slope at nothing is looked for: in steps, or of what was commanded."""


@dataclass(frozen=True)
class Law:
    """A law on offer: a candidate, whether it is usual there, and what it must bring beside its parameters [nats].

    starts: values of all its parameters from which it is looked for where it has no slope at nothing, else none.
    free: the user requires it, and it costs nothing but its parameters. gate: where it acts. owned: whether its
    simulator owns its integration; of_row: whether it is one of many that all joints of a robot have.
    """

    candidate: Candidate
    usual: bool
    price: float
    starts: tuple[tuple[float, ...], ...] = ()

    free: bool = False
    gate: Gate = field(default_factory=Gate)
    owned: bool = False
    of_row: bool = False

    @property
    def key(self) -> tuple[str, str, str]:
        """Family, place and variant."""
        return *self.candidate.identity, self.candidate.variant

    @property
    def parameters(self) -> int:
        """How many numbers it takes, the edges of its gate among them."""
        edges = (
            2 * len(self.gate.region) + (self.gate.since is not None) + (self.gate.since_episode is not None)
        )
        return len(self.candidate.declared) + edges

    @property
    def dry(self) -> bool:
        """Whether it is dry friction and one number, so that it chatters in coarse steps."""
        return self.candidate.family == "coulomb_friction" and len(self.candidate.declared) == 1

    @property
    def grows(self) -> bool:
        """Whether it grows with its first parameter as on a line, once the others say where and how: a spring does."""
        first, effect = self.candidate.declared[0], effect_of(self.candidate.family)
        return isinstance(effect, ForceEffect) and first.none == 0.0 and not (first.place or first.falls)

    @property
    def spans(self) -> bool:
        """Whether it is nothing where all of its parameters are, so that their lines span it: a tilt about two axes."""
        own = self.candidate.declared
        small = all(p.none == 0.0 and not (p.place or p.falls) and p.step is None for p in own)
        return len(own) > 1 and small and effect_of(self.candidate.family).site == "parameter"

    @property
    def is_ratio(self) -> bool:
        """Whether it multiplies something that the base has."""
        return len(self.candidate.declared) == 1 and self.candidate.declared[0].none == 1.0

    @property
    def of_servo(self) -> bool:
        """Whether it is a gain of a servo."""
        return self.candidate.place.on.endswith(SERVO_GAINS)

    @property
    def stiff(self) -> str:
        """The family that it is when nothing yields, of a law that remembers."""
        return STIFF.get(self.candidate.family, "")

    @property
    def has_slope(self) -> bool:
        """Whether its size can be told from its slope where it does nothing."""
        return not self.starts

    @property
    def moments(self) -> list[int]:
        """The parameters that say where on its body a size sits."""
        own = self.candidate.declared
        return [i for i, p in enumerate(own) if self.has_slope and p.place and p.none == p.starts[0]]

    def believed(
        self,
        values: Mapping[tuple[str, str], Sequence[float]],
        deviations: Mapping[tuple[str, str], Sequence[float]],
    ) -> Law:
        """The law with what another look at the recording gave, where that says something of it."""
        where = self.candidate.identity
        if where not in values or self.candidate.variant:
            return self
        both = zip(values[where], deviations[where], strict=True)
        declared = tuple(
            replace(p, believed=(v, sd)) for p, (v, sd) in zip(self.candidate.declared, both, strict=True)
        )
        return replace(self, candidate=replace(self.candidate, declared=declared))

    def term(self, values: Sequence[float]) -> Term:
        """The law with values of its parameters."""
        return replace(self.candidate.term(values), gate=self.gate)

    @property
    def name(self) -> str:
        """What it claims, in words."""
        return self.candidate.name


def laws_of(
    simulator: Simulator, offers: Sequence[Candidate], numbers: LawSettings, known: Known
) -> list[Law]:
    """The laws on offer, the usual ones first; what the user requires costs nothing."""
    kind, owned = kind_of(simulator), closed(simulator) is not None
    unlikely = simulator.unlikely if kind == "floating" else frozenset[str]()
    found = [
        _law(_as_fitted(c), {} if c.place.on in unlikely else USUAL[kind], numbers, known)
        for c in offers
        if not c.only_gated
    ]
    out = [replace(law, owned=owned, of_row=law.usual and kind == "robot") for law in found]
    return sorted(out, key=lambda law: (not law.usual, effect_of(law.candidate.family).site != "parameter"))


def kind_of(simulator: Simulator) -> str:
    """Which table of usual laws a simulator goes by: what it declares, else the one of its sites."""
    declared: str | None = getattr(simulator, "kind", None)
    if declared in USUAL:
        return str(declared)
    if {"v", "v_lateral", "w"} <= set(simulator.rate.names):
        return "vehicle"
    if closed(simulator) is not None:
        return "floating" if simulator.velocities != {c.velocity for c in simulator.coordinates} else "robot"
    return "coordinate" if simulator.coordinates else "first order"


def _law(candidate: Candidate, table: Mapping[str, str], numbers: LawSettings, known: Known) -> Law:
    family, required = candidate.family, known.requires(candidate.identity)
    usual = family in table and candidate.variant in ("", PRESSED) and candidate.identity not in KNOWN_WELL
    usual = usual or candidate.place.on.endswith(SERVO_GAINS)
    usual = known.usual_there(candidate.identity, usual)
    price = 0.0 if usual or required else numbers.unusual
    if not usual and not required:
        price = (
            numbers.drag
            if family in DRAG
            else numbers.rare
            if family in RARE or candidate.identity in KNOWN_WELL
            else price
        )
    return Law(candidate, usual or required, price, _starts(candidate), required)


def _as_fitted(candidate: Candidate) -> Candidate:
    """Of Stribeck friction what it adds to the dry friction beside it."""
    if candidate.family != "stribeck_friction" or candidate.variant:
        return candidate
    own = declared(effect_of(candidate.family), candidate.place, RISE)
    return replace(candidate, variant=RISE, declared=own)


def _starts(candidate: Candidate) -> tuple[tuple[float, ...], ...]:
    """Where a law without a slope at nothing is looked for."""
    effect, first = effect_of(candidate.family), candidate.declared[0]
    others = tuple(p.starts[0] for p in candidate.declared[1:])
    factors = SCANS.get(candidate.family)
    if factors:
        unit = candidate.place.dt if first.unit == "s" else candidate.place.span
        if candidate.family == "actuator_rate_limit":
            unit = candidate.place.span / candidate.place.dt
        values = [f * unit for f in factors if first.low < f * unit < first.high]
        return tuple((v, *others) for v in values)
    smooth = isinstance(effect, (ActuatorEffect, DriveEffect, SensorEffect)) or len(candidate.declared) == 1
    if smooth and not first.falls and len(first.starts) == 1 and first.step is None:
        return ()
    if any(p.paired for p in candidate.declared[1:]):
        count = len(first.starts)
        return tuple(
            tuple(p.starts[k] if len(p.starts) == count else p.starts[0] for p in candidate.declared)
            for k in range(count)
        )
    law = Law(candidate, False, 0.0)
    if law.spans:
        axes = range(len(candidate.declared))
        return tuple(tuple(p.starts[0] * (i == k) for i, p in enumerate(candidate.declared)) for k in axes)
    out: list[tuple[float, ...]] = [(v,) for v in first.starts]
    for p in candidate.declared[1:]:
        out = [(*row, v) for row in out for v in p.starts]
    return tuple(out)
