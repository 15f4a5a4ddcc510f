"""What sensors make of the true state: laws of the reading alone, lags and delays, and of a whole pose."""

from __future__ import annotations

import math

import numpy as np

from gpsim.channels import FloatArray, IntArray
from gpsim.effects.effect import Each, PoseEffect, SensorEffect, Values, changed
from gpsim.effects.place import EffectParameter, Place, Plausible
from gpsim.simulators import Memory, Simulator

REACH = 4.0  # time constants that a lag looks back: what was before is taken for a straight line
LONGEST = 16.0  # steps: so that all of its reach lies in what windows remember
# Of the longest of three steps: a cubic through states nearer to each other would blow up rounding.
CLOSE = 0.05
FURTHEST = 2.3  # times the distance of readings, within which nine of ten times the least is from the edge
LIKELY = 0.7  # the same, within which it is half of the times


class SensorBias(SensorEffect):
    """A sensor bias: y + o.

    Definition: a sum.
    """

    family = "sensor_bias"
    sentence = "the sensor of {on} is off by {offset}"
    function_of = "reading"

    @staticmethod
    def law(reading: Each, offset: Each) -> Each:
        return reading + offset

    def places(self, simulator: Simulator) -> tuple[str, ...]:
        """Every measured channel; where an encoder's zero would say the same, that says it."""
        said = simulator.model_places.get("joint_offset", {})
        return tuple(n for n in super().places(simulator) if n not in said or said[n].steers)

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Offset [the channel's]."""
        span = place.span
        return (EffectParameter("offset", place.unit, -5 * span, 5 * span, (0.1 * span,), 0.1 * span),)


class JointOffset(SensorEffect):
    """A joint's encoder whose zero is off: y + o, and whoever steers by it steers to another place.

    Definition: a sum; a position servo on the joint compares its command with what the encoder says.
    """

    family = "joint_offset"
    acts_on = "a joint"
    sentence = "the zero of {on} is off by {offset}"
    function_of = "reading"
    noun = "joint offset"
    law = staticmethod(SensorBias.law)

    def places(self, simulator: Simulator) -> tuple[str, ...]:
        """Joints of a model that has such."""
        return tuple(simulator.model_places.get(self.family, ()))

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Offset [the joint's]."""
        span = place.span
        return (EffectParameter("offset", place.unit, -5 * span, 5 * span, (0.1 * span,), 0.1 * span),)


class SensorScale(SensorEffect):
    """A sensor scale: k y.

    Definition: a product.
    """

    family = "sensor_scale"
    sentence = "the sensor of {on} reads {scale} times the truth"
    function_of = "reading"
    order = 40
    plausible = {
        "scale": Plausible(0.5, 2.0, "1", "wheel radii and tracks 1 to 10 % (Borenstein and Feng 1996)")
    }

    @staticmethod
    def law(reading: Each, scale: Each) -> Each:
        return reading * scale

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Scale [1]."""
        return (EffectParameter("scale", "1", 0.05, 20.0, (1.1,), 0.2, none=1.0),)


class SensorDeadZone(SensorEffect):
    """A sensor's dead zone: readings smaller than the width are 0, larger ones are right.

    Definition: a threshold, like that of a tachometer with a minimum speed. Tested if a recording has readings of
    exactly 0 and none between 0 and a threshold.
    """

    family = "sensor_dead_zone"
    sentence = "the sensor of {on} reads 0 below {width}"
    function_of = "reading"
    order = 50

    @staticmethod
    def law(reading: Each, width: Each) -> Each:
        return np.where(np.abs(reading) < width, 0.0, reading)

    def offers(self, place: Place, variant: str) -> bool:
        """Where small readings are missing."""
        return variant == "" and bool(place.silent)

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Width [the channel's]: a little less than the smallest reading that is not 0, noise or not.

        Where readings come at random the next one is exponentially far. A fit of simulations knows less: it does not
        know where in the zone a window begins.
        """
        least, apart = place.silent or (0.1 * place.span, 0.01 * place.span)
        low, likely = (max(least - times * apart, 0.0) for times in (FURTHEST, LIKELY))
        known = low, least
        return (EffectParameter("width", place.unit, *known, (likely,), apart, step=apart, exact=known),)


class SensorSaturation(SensorEffect):
    """A sensor at its range's end: the reading never leaves [low, high].

    Definition: clipping, as an analog-to-digital converter or a full vessel does it. Tested if many readings have the
    lowest or highest value of the recording.
    """

    family = "sensor_saturation"
    noun = "sensor range"
    function_of = "reading"
    order = 60
    variants = ("", "lower", "upper")

    @staticmethod
    def law(reading: Each, low: Each = -np.inf, high: Each = np.inf) -> Each:
        return np.minimum(np.maximum(reading, low), high)

    def offers(self, place: Place, variant: str) -> bool:
        """The ends at which readings stand."""
        lower, upper = place.stands
        return {"": lower and upper, "lower": lower and not upper, "upper": upper and not lower}[variant]

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """The ends low and high [the channel's], or one of them."""
        kept = {"": ("low", "high"), "lower": ("low",), "upper": ("high",)}[variant]
        return tuple(place.reading_end(name, highest=name == "high") for name in kept)


class SensorLag(SensorEffect):
    """A sensor's lag: T y' = x - y, the filter of the first order that firmware lays over what it reads.

    Ogata (2010), Modern Control Engineering, 5th ed., section 5-2 (first-order systems). Exact where the true value x
    is a straight line over each substep. Tested on a speed or a position if both were read and one visibly trails the
    other.
    """

    family = "sensor_lag"
    sentence = "the sensor of {on} follows the truth with a lag of {time_constant}"
    function_of = "nothing"
    order = 5
    memory = ("behind", "last")
    plausible = {
        "time_constant": Plausible(
            0.0, 5.0, "step", "firmware filters speeds with cut-offs of 3 to 150 Hz: 1 to 50 ms", least=0.1
        )
    }

    @staticmethod
    def law(reading: Each, step: Each, behind: Each, last: Each, time_constant: Each) -> tuple[Each, Each]:
        """What is read approaches the straight line from the last state to this one."""
        ratio = np.maximum(step, 1e-12) / np.maximum(time_constant, 1e-9)
        return behind * np.exp(-ratio) + (reading - last) * (-np.expm1(-ratio) / ratio), reading

    @staticmethod
    def rest(reading: Each, slope: Each, time_constant: Each) -> tuple[Each, Each]:
        return np.maximum(time_constant, 1e-9) * slope, reading

    def offers(self, place: Place, variant: str) -> bool:
        """Where a channel trails the other one of its coordinate: what trails in both is an actuator's lag."""
        return variant == "" and place.trails

    def reach(self, values: Values) -> float:
        """As far [s] back as a start hardly matters any more."""
        return REACH * float(np.max(values["time_constant"], initial=0.0))

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """time_constant [s]."""
        dt = place.dt
        return (EffectParameter("time_constant", "s", 0.0, LONGEST * dt, (0.5 * dt, 2.5 * dt), dt),)


class SensorDelay(SensorEffect):
    """A sensor delay: y(t - T).

    Definition: a shift; between samples, Lagrange's interpolation (Laakso, Valimaki, Karjalainen and Laine 1996,
    "Splitting the unit delay", IEEE Signal Processing Magazine 13(1)).
    """

    family = "sensor_delay"
    sentence = "the sensor of {on} is {delay} late"
    function_of = "nothing"
    order = 10
    memory = ("past", "head")
    plausible = {"delay": Plausible(0.0, 5.0, "step", "cameras and filters 0.01 to 0.2 s", least=0.5)}

    def reach(self, values: Values) -> float:
        """The longest delay [s]."""
        return float(np.max(values["delay"], initial=0.0))

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Delay [s]."""
        dt = place.dt
        return (EffectParameter("delay", "s", 0.0, place.longest_delay, (0.7 * dt, 2.3 * dt), dt),)

    def begin(
        self,
        history: FloatArray,
        column: int,
        values: Values,
        step: FloatArray,
        steps: FloatArray | None = None,
    ) -> tuple[Memory, FloatArray]:
        """The last states in a ring, and where the oldest lies; on an uneven clock also when [s] each one was."""
        memory = {"past": np.array(history), "head": np.zeros(len(history))}
        if steps is not None:
            when = np.cumsum(steps, axis=1)
            memory["when"] = when - when[:, -1:]
        return memory, history

    def watch(
        self, state: FloatArray, column: int, values: Values, memory: Memory, step: FloatArray
    ) -> FloatArray:
        """Remember the newest state."""
        head = memory["head"].astype(np.int64)
        rows: IntArray | slice = np.arange(len(state))
        if len(head) and (head == head[0]).all():
            # They began together: a column is quicker than picked places.
            rows, head = slice(None), head[0]
        memory["past"][rows, head] = state
        if "when" in memory:
            memory["when"][rows, head] = memory["when"][rows, head - 1] + step
        memory["head"][:] = (head + 1) % memory["past"].shape[1]
        return state

    def measure(
        self, measured: FloatArray, columns: tuple[int, ...], values: Values, memory: Memory, step: FloatArray
    ) -> FloatArray:
        """What the channel was a delay ago; between substeps, Lagrange's cubic through the four around it."""
        (column,) = columns
        if "when" in memory:
            return changed(measured, column, measured[:, column] + _change(values["delay"], column, memory))
        past, rows = memory["past"], np.arange(len(measured))
        depth = past.shape[1]
        newest = (memory["head"].astype(np.int64) - 1) % depth
        back = np.minimum(values["delay"] / step, depth - 2.0)
        # The four lie one substep apart; nothing is known after the newest, and nothing before the oldest.
        first = np.clip(back.astype(np.int64) - 1, 0, max(depth - 4, 0))
        nodes = range(min(4, depth))
        late = np.zeros(len(measured))
        for i in nodes:
            weight = np.ones(len(measured))
            for j in nodes:
                if j != i:
                    weight *= (back - first - j) / (i - j)
            late += weight * past[rows, (newest - first - i) % depth, column]
        return changed(measured, column, measured[:, column] - past[rows, newest, column] + late)


def _change(delay: FloatArray, column: int, memory: Memory) -> FloatArray:
    """(B,) what the channel was a delay (B,) [s] ago less what it is, on an uneven clock.

    Lagrange's cubic through the four states around that moment, a straight line where some of them nearly coincide.
    """
    past, when = memory["past"][:, :, column].T, memory["when"].T  # (K, B), in the order of the ring
    (depth, count), rows = past.shape, np.arange(len(delay))
    oldest = memory["head"].astype(np.int64)
    newest = np.where(oldest > 0, oldest, depth) - 1
    ages = np.subtract(when[newest, rows], when, order="C")
    late = np.minimum(delay, ages[oldest, rows])
    # The moment lies between this state and the next older one. A count is quicker than a search: rings are short.
    before = np.clip((ages <= late).sum(axis=0) - 1, 0, depth - 2)
    first = np.clip(before - 1, 0, max(depth - 4, 0))
    slots = newest - first - np.arange(min(4, depth))[:, None]
    slots += depth * (slots < 0)
    age, was = ages.take(slots * count + rows), past[slots, rows]
    now = past[newest, rows]
    apart = np.diff(age, axis=0)
    smooth = apart.min(axis=0) > CLOSE * apart.max(axis=0)
    to, curved = late - age, np.zeros(count)
    with np.errstate(all="ignore"):
        for i in range(len(age)):
            others = [to[j] / (age[i] - age[j]) for j in range(len(age)) if j != i]
            curved += math.prod(others[1:], start=others[0]) * was[i]
    if smooth.all():
        return np.asarray(curved - now)
    place = (before - first) * count + rows
    near, far, there = age.take(place), age.take(place + count), was.take(place)
    share = np.clip((late - near) / np.where(far > near, far - near, 1.0), 0.0, 1.0)
    straight = there + share * (was.take(place + count) - there)
    return np.asarray(np.where(smooth, curved, straight) - now)


class MarkerOffset(PoseEffect):
    """A marker that sits ahead of and left of the point it stands for: p + R(yaw) (forward, left).

    Murray, Li and Sastry (1994), A Mathematical Introduction to Robotic Manipulation, chapter 2 (rigid body
    motion).
    """

    family = "marker_offset"
    sentence = "the marker sits {forward} ahead and {left} left of the vehicle's reference point"
    function_of = "nothing"
    order = 20
    plausible = dict.fromkeys(
        ("forward", "left"), Plausible(0.0, 2.0, "1", "estimate: a marker sits on its vehicle")
    )

    @staticmethod
    def law(x: Each, y: Each, yaw: Each, forward: Each, left: Each) -> tuple[Each, Each, Each]:
        sin, cos = np.sin(yaw), np.cos(yaw)
        return x + cos * forward - sin * left, y + sin * forward + cos * left, yaw

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Forward and left [m]."""
        return (
            EffectParameter("forward", "m", -5.0, 5.0, (0.05,), 0.05),
            EffectParameter("left", "m", -5.0, 5.0, (0.02,), 0.05),
        )


class FrameRotation(PoseEffect):
    """A frame turned against the vehicle's: yaw + psi.

    Murray, Li and Sastry (1994), A Mathematical Introduction to Robotic Manipulation, chapter 2 (rigid body
    motion).
    """

    family = "frame_rotation"
    sentence = "the measured yaw is turned by {angle}"
    function_of = "nothing"
    order = 30

    @staticmethod
    def law(x: Each, y: Each, yaw: Each, angle: Each) -> tuple[Each, Each, Each]:
        return x, y, yaw + angle

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Angle [rad]."""
        return (EffectParameter("angle", "rad", -3.2, 3.2, (0.05,), 0.05),)
