"""What happens to commands: laws of the command alone, laws that remember, delays, and drives."""

from __future__ import annotations

import numpy as np

from gpsim.effects.effect import ActuatorEffect, DriveEffect, Each, ElasticDrive, Values
from gpsim.effects.late import LateEffect
from gpsim.effects.place import EffectParameter, Place, Plausible
from gpsim.simulators import Memory, Simulator

FORGOTTEN = 17.0  # time constants of a lag
FAR = 13.0  # steps: delays beyond are not reached from the shorter starts
MILLION = 1e6  # ppm
LARGEST = 2000.0  # ppm: twenty times what a poor crystal has; clocks without one are no computers'
TOLERATED = 500.0  # ppm, by which a clock may be steered: what drifts more is broken (Linux, adjtimex(2))
REMEMBERED = (
    0.4  # s, at least, whatever the clock of what is driven: the most that a delay is searched for up to
)
SLOWEST, FASTEST = 0.01, 2.5  # of what a sample shows: radians a step at which motor and load may swing
USUAL = 0.3  # radians a step
STARTS = tuple(0.07 * 1.305**k for k in range(13))  # the same: far from how it swings a start shows nothing
LIGHT = 0.3  # of the load's inertia: a motor to begin with


class ActuatorGain(ActuatorEffect):
    """A gain of the actuator: the simulator gets g u.

    Definition: a product.
    """

    family = "actuator_gain"
    sentence = "{on} acts with {gain} times its commanded size"
    function_of = "command"
    needs = "command"
    order = 40
    plausible = {
        "gain": Plausible(
            0.25,
            4.0,
            "1",
            "torque constants are within 10 % (data sheets), wrong gears and units give a factor of two or three",
        )
    }

    @staticmethod
    def law(u: Each, gain: Each) -> Each:
        return gain * u

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Gain [1]."""
        return (EffectParameter("gain", "1", -5.0, 5.0, (0.9,), 0.2, none=1.0),)


class ActuatorBias(ActuatorEffect):
    """A bias of the actuator: the simulator gets u + b.

    Definition: a sum.
    """

    family = "actuator_bias"
    sentence = "{on} acts with an offset of {bias}"
    function_of = "command"
    needs = "nothing"
    order = 70
    plausible = {"bias": Plausible(0.0, 1.0, "size", "estimate: an offset is smaller than the commands")}

    @staticmethod
    def law(u: Each, bias: Each) -> Each:
        return u + bias

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Bias [the action's]."""
        span = place.span
        return (EffectParameter("bias", place.unit, -5 * span, 5 * span, (0.1 * span,), 0.1 * span),)


class ActuatorDeadZone(ActuatorEffect):
    """A dead zone: commands smaller than the width do nothing, larger ones act in full.

    Khalil (2002), Nonlinear Systems, 3rd ed., section 1.2.7, whose dead zone also reduces larger commands; this one
    jumps, like a driver that sets small commands to 0.
    """

    family = "actuator_dead_zone"
    sentence = "{on} does nothing below {width}"
    function_of = "command"
    order = 20

    @staticmethod
    def law(u: Each, width: Each) -> Each:
        return u * (np.abs(u) >= width)

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Width [the action's]; from several starts, as no small width can be seen."""
        span = place.span
        starts = tuple(share * span for share in (0.04, 0.08, 0.13, 0.2, 0.3, 0.45))
        return (EffectParameter("width", place.unit, 0.0, span, starts, 0.1 * span, step=0.02 * span),)


class ActuatorDeadBand(ActuatorEffect):
    """A dead band: u - w sgn(u) outside abs(u) < w, 0 inside: what larger commands lose, too, as play in a gear takes it.

    Khalil (2002), Nonlinear Systems, 3rd ed., section 1.2.7 (dead zone).
    """  # noqa: E501

    family = "actuator_dead_band"
    sentence = "{on} loses {width} of every command, and ignores smaller commands"
    function_of = "command"
    order = 21

    @staticmethod
    def law(u: Each, width: Each) -> Each:
        return np.sign(u) * np.maximum(np.abs(u) - width, 0.0)

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Width [the action's]; a small one is felt by every larger command."""
        span = place.span
        return (EffectParameter("width", place.unit, 0.0, span, (0.05 * span, 0.25 * span), 0.1 * span),)


class ActuatorSaturation(ActuatorEffect):
    """Saturation: the simulator gets u clipped to [-limit, limit].

    Khalil (2002), Nonlinear Systems, 3rd ed., section 1.2.7.
    """

    family = "actuator_saturation"
    sentence = "{on} saturates at {limit}"
    function_of = "command"
    order = 30
    plausible = {
        "limit": Plausible(0.1, np.inf, "size", "estimate: commands do not exceed ten times the limit")
    }

    @staticmethod
    def law(u: Each, limit: Each) -> Each:
        return np.minimum(np.maximum(u, -limit), limit)

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Limit [the action's]; from several starts, as a limit out of reach has no gradient."""
        span = place.span
        starts = (0.8 * span, 0.5 * span, 0.25 * span)
        return (EffectParameter("limit", place.unit, 0.0, 3 * span, starts, 0.1 * span, falls=True),)


class ActuatorAsymmetry(ActuatorEffect):
    """Asymmetry: g+ u for u > 0, g- u for u < 0.

    Definition: two gains for the one of `actuator_gain`, as a motor controller scales its two directions.
    """

    family = "actuator_asymmetry"
    sentence = (
        "{on} acts with {gain_positive} times positive commands and {gain_negative} times negative commands"
    )
    function_of = "command"
    order = 50
    plausible = dict.fromkeys(("gain_positive", "gain_negative"), Plausible(0.25, 4.0, "1", "as a gain"))

    @staticmethod
    def law(u: Each, gain_positive: Each, gain_negative: Each) -> Each:
        return gain_positive * np.maximum(u, 0.0) + gain_negative * np.minimum(u, 0.0)

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """gain_positive and gain_negative [1]."""
        return (
            EffectParameter("gain_positive", "1", -5.0, 5.0, (0.9,), 0.2, none=1.0),
            EffectParameter("gain_negative", "1", -5.0, 5.0, (1.1,), 0.2, none=1.0),
        )


class BatterySag(ActuatorEffect):
    """Battery sag: the gain falls with time, g = 1 - loss t.

    Definition: a straight line instead of a discharge curve (Shepherd 1965, "Design of primary and secondary
    cells II. An equation describing battery discharge", Journal of the Electrochemical Society 112(7)). t: since
    the clock began.
    """

    family = "battery_sag"
    sentence = "{on} loses {loss_per_second} of its strength (battery sag)"
    function_of = "nothing"
    needs = "command"
    order = 60
    holds = False
    drifts = True
    plausible = {
        "loss_per_second": Plausible(
            0.0, 1.0, "1 / reach", "estimate: the battery is empty at the end of the recording"
        )
    }

    @staticmethod
    def law(u: Each, t: Each, loss_per_second: Each) -> Each:
        return u * np.maximum(1.0 - loss_per_second * t, 0.0)

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """loss_per_second [1/s]."""
        typical = 1.0 / max(place.reach, 1e-9)
        return (EffectParameter("loss_per_second", "1/s", 0.0, 2 * typical, (0.2 * typical,), 0.2 * typical),)


class ActuatorBacklash(ActuatorEffect):
    """Backlash: the play operator; the output moves only when the input pushes against an end of the gap.

    Krasnoselskii and Pokrovskii (1989), Systems with Hysteresis, section 2.1.
    """

    family = "actuator_backlash"
    sentence = "{on} has a backlash of half width {half_width}"
    function_of = "nothing"
    order = 80
    memory = ("level",)

    @staticmethod
    def law(u: Each, level: Each, half_width: Each) -> tuple[Each, Each]:
        level = np.minimum(np.maximum(u - half_width, level), u + half_width)
        return level, level

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """half_width [the action's]; from several starts."""
        span = place.span
        starts = (0.05 * span, 0.2 * span, 0.5 * span)
        return (EffectParameter("half_width", place.unit, 0.0, span, starts, 0.1 * span),)


class ActuatorRateLimit(ActuatorEffect):
    """A rate limit: |u_a'| <= r.

    Duda (1997), "Prediction of pilot-in-the-loop oscillations due to rate saturation", Journal of Guidance,
    Control, and Dynamics 20(3).
    """

    family = "actuator_rate_limit"
    sentence = "{on} changes no faster than {rate}"
    function_of = "nothing"
    order = 90
    holds = False
    memory = ("level",)

    @staticmethod
    def law(u: Each, step: Each, level: Each, rate: Each) -> tuple[Each, Each]:
        """The mean of a level that moves towards the command no faster than the rate."""
        reach = rate * step
        now = np.minimum(np.maximum(u, level - reach), level + reach)
        moved = now - level
        return now - moved * np.abs(moved) / np.maximum(2.0 * reach, 1e-300), now

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Rate [the action's per second]; from several starts."""
        typical, unit = place.span / place.dt, f"{place.unit}/s"
        starts = (0.5 * typical, 0.15 * typical, 0.04 * typical)
        return (
            EffectParameter("rate", unit, 1e-4 * typical, 4 * typical, starts, 0.1 * typical, falls=True),
        )


class ActuatorLag(ActuatorEffect):
    """A first-order lag: T u_a' = u - u_a, exact for a command held over the substep.

    Ogata (2010), Modern Control Engineering, 5th ed., section 5-2 (first-order systems).
    """

    family = "actuator_lag"
    sentence = "{on} follows its command with a lag of {time_constant}"
    function_of = "nothing"
    order = 95
    holds = False
    memory = ("level",)
    plausible = {
        "time_constant": Plausible(
            0.0,
            10.0,
            "step",
            "electric drives 0.01 to 0.1 s, servos and cars up to 0.5 s (Rajamani 2012, chapter 5)",
            least=1.0,
        )
    }

    @staticmethod
    def law(u: Each, step: Each, level: Each, time_constant: Each) -> tuple[Each, Each]:
        """The mean of the exponential approach to the command, and where it ends."""
        ratio = np.maximum(step, 1e-12) / np.maximum(time_constant, 1e-9)
        gone, behind = -np.expm1(-ratio), level - u
        return u + behind * (gone / ratio), u + behind * (1.0 - gone)

    def remembers(self, values: Values) -> float:
        """So many time constants [s] that less than a ten millionth is left."""
        return FORGOTTEN * float(np.max(values["time_constant"], initial=0.0))

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """time_constant [s]."""
        dt = place.dt
        return (EffectParameter("time_constant", "s", 0.02 * dt, 50 * dt, (0.7 * dt, 3 * dt, 10 * dt), dt),)


class ActuatorDelay(LateEffect):
    """A delay: the simulator gets u(t - T), averaged over a substep.

    Astrom and Wittenmark (1997), Computer-Controlled Systems, 3rd ed., chapter 2 (sampling a system with a time
    delay): a delay of a part of a step makes two neighbouring commands act in one step.
    """

    family = "actuator_delay"
    sentence = "{on} acts {delay} late"
    order = 10
    plausible = {
        "delay": Plausible(0.0, 6.0, "step", "networks and drivers 0.01 to 0.3 s (a Limo: 0.27 s)", least=0.5)
    }

    @staticmethod
    def law(delay: Each) -> Each:
        return delay

    def remembers(self, values: Values) -> float:
        """The longest delay [s]."""
        return float(np.max(values["delay"], initial=0.0))

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Delay [s]."""
        dt = place.dt
        starts: tuple[float, ...] = (0.7 * dt, 2.3 * dt, 5.3 * dt)
        if place.longest_delay > FAR * dt:
            starts += (FAR * dt,)
        return (EffectParameter("delay", "s", 0.0, place.longest_delay, starts, dt),)


class ClockDrift(LateEffect):
    """A clock that drifts: the simulator gets u(t - d t), with t since the clock began.

    Definition: a computer that gives commands by its own clock, which is slow by d against that of the readings. An
    even rate is the first order of an oscillator's drift. It acts on commands and makes them increasingly late. A
    fast clock would make them act before they are given, which no simulator can step through that is driven live;
    and what a sensor reads is not asked when it was read, so that side has no clock.
    """

    family = "clock_drift"
    noun = "clock drift"
    sentence = "the clock of {on} is slow by {drift}, so commands are increasingly late"
    gated = False
    drifts = True
    holds = False
    order = 11
    plausible = {
        "drift": Plausible(
            0.0,
            TOLERATED,
            "1",
            "crystals 1 to 100 ppm each; clocks are steered by 500 at most (Linux, adjtimex(2))",
        )
    }

    @staticmethod
    def law(step: Each, t: Each, drift: Each) -> Each:
        """As in the middle of each substep; within it that changes by d times its length."""
        return 1e-6 * drift * np.maximum(t + step / 2, 0.0)

    def begin(self, count: int, longest: float, step: float) -> Memory:
        """The commands of the last `longest` seconds, of some tenths at least."""
        return super().begin(count, max(longest, REMEMBERED), step)

    def remembers(self, values: Values) -> float:
        """Who does not know the time does not know how long [s]: all that is remembered may matter."""
        return np.inf

    def offers(self, place: Place, variant: str) -> bool:
        """Where the recording is so long that a clock that is taken for a good one comes to a step in the end."""
        return variant == "" and TOLERATED * place.reach >= MILLION * place.dt

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Drift [ppm]; commands are never later than a delay may be."""
        step = MILLION * place.dt / max(place.reach, 1e-9)  # ppm that come to a step in the end
        high = min(LARGEST, MILLION * place.longest_delay / max(place.reach, 1e-9))
        starts = tuple(dict.fromkeys(min(steps * step, 0.5 * high) for steps in (0.7, 2.3)))
        return (EffectParameter("drift", "ppm", 0.0, high, starts, min(step, high)),)


class TorqueSpeedLimit(DriveEffect):
    """A torque-speed line: abs(u) <= S (1 - q'/v0) while the drive pushes with the motion, at most S against it.

    Definition: the line of a DC motor at full voltage, S at standstill and 0 at the no-load speed v0, with the current
    limited to that of standstill (Hughes 2013, Electric Motors and Drives, 4th ed., chapter 3).
    """

    family = "torque_speed_limit"
    noun = "torque-speed line"
    sentence = "{on} gives {stall} at standstill, decreasing with speed to zero at {no_load_speed}"
    plausible = {
        "stall": Plausible(0.1, np.inf, "size", "as a saturation"),
        "no_load_speed": Plausible(
            0.5, np.inf, "speed", "estimate: a motor is never driven at twice its no-load speed"
        ),
    }

    @staticmethod
    def law(u: Each, speed: Each, stall: Each, no_load_speed: Each) -> Each:
        ahead = np.minimum(np.maximum(1.0 - speed / no_load_speed, 0.0), 1.0)
        back = np.minimum(np.maximum(1.0 + speed / no_load_speed, 0.0), 1.0)
        return np.minimum(np.maximum(u, -stall * back), stall * ahead)

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Stall [the action's] and no_load_speed [the driven coordinate's]; a line out of reach has no gradient."""
        span, speed, unit = place.span, place.speed, f"{place.position_unit}/s"
        high, fast = (1.5 * span, 0.8 * span), (1.1 * speed, 2.0 * speed)
        return (
            EffectParameter("stall", place.unit, 0.0, 20 * span, high, 0.2 * span, falls=True),
            EffectParameter("no_load_speed", unit, 0.2 * speed, 50 * speed, fast, 0.3 * speed, falls=True),
        )


class FlexibleCoupling(ElasticDrive):
    """A flexible coupling: J w' = u - T, T = k z + d z', z' = w - q', and the load gets T in the place of u.

    Definition: two inertias with a spring and a damper between them, such as a motor and its load behind a belt, a
    harmonic drive or a long shaft (Spong 1987, "Modeling and control of elastic joint robots", Journal of Dynamic
    Systems, Measurement, and Control 109(4)). The motor is ahead of the load by z. A very stiff one acts as a rotor
    of inertia J on the load, one without J has no effect. It has its own motion, so the load continues when the
    command ends.
    """

    family = "flexible_coupling"
    noun = "flexible coupling"
    sentence = "{on} drives its load through a spring ({stiffness}) and a damper ({damping}), motor {inertia}"
    takes = dict.fromkeys(("stiffness", "damping", "inertia"), np.nan)
    asked = False  # three numbers and ringing: lags, delays and sprung masses look like it
    of_robots = True

    def places(self, simulator: Simulator) -> tuple[str, ...]:
        """Every action that drives a coordinate by itself; of a MuJoCo model motors, no servos."""
        return tuple(simulator.coupled())

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Stiffness, damping and inertia of the motor, in the action's unit."""
        unit, length, load, rate = place.unit, place.position_unit, place.inertia, 1.0 / place.dt
        light = LIGHT / (1.0 + LIGHT) * load  # of both, as they swing against each other
        return (
            EffectParameter(
                "stiffness",
                f"{unit}/{length}",
                LIGHT * load * (SLOWEST * rate) ** 2,
                load * (FASTEST * rate) ** 2,
                tuple(light * (start * rate) ** 2 for start in STARTS),
                0.1 * light * (USUAL * rate) ** 2,
                place=True,
            ),
            EffectParameter(
                "damping",
                f"{unit} s/{length}",
                0.0,
                load * FASTEST * rate,
                (0.1 * light * USUAL * rate,),
                0.1 * light * rate,
                place=True,
            ),
            EffectParameter(
                "inertia", f"{unit} s^2/{length}", 1e-3 * load, 10.0 * load, (LIGHT * load,), 0.1 * load
            ),
        )
