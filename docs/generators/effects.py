"""docs/reference/effects.md: the catalogue, from the registry and what the families' classes say of themselves."""

import inspect
import math
import re

from gpsim.diagnosis.fitting.hypothesis import LOG_SIZE
from gpsim.diagnosis.ladder import USUAL as USUAL_LAWS
from gpsim.diagnosis.settings import Settings
from gpsim.effects.effect import Effect
from gpsim.effects.families.actuators import TOLERATED
from gpsim.effects.place import Place, Plausible
from gpsim.effects.registry import CATALOGUE, CURVES, FAMILIES

from . import MADE

MOST_WORDS = 5  # of a name; what is longer says more
PLACE = Place("q", "U", loaded=True, length="L")
ACTS_ON = {
    "force": "a coordinate",
    "parameter": "a parameter",
    "actuator": "an action",
    "vehicle": "`vehicle`",
    "sensor": "a measured channel",
    "rate": "a state of the first order",
}
OF_MODELS = [f"`{family}`" for family, effect in CATALOGUE.items() if effect.acts_on]
"""Families of [models of bodies](../how-to/mujoco.md)."""
HEAD = f"""# The catalogue of effects

{MADE.format(source="`gpsim/effects/registry.py`")} `gpsim diagnose` can name these effects. The names of families and
parameters are those in [diagnosis.json](files.md#diagnosisjson).

In a law, q is a coordinate, q' its velocity, u a command, y a sensor reading, and v and w are a vehicle's speed and
turn rate. The other [symbols](../method/notation.md) are the names of the parameters. In a unit, U is the unit of the
quantity on which the effect acts (for a coordinate its force, N or N m), and L that of a position (m or rad)."""
COLUMNS = ("family", "acts on", "law", "parameters", "law is a function of", "may be limited")
TAIL = f"""\
*May be limited*: the effect may act only in a `region` (an interval of a position), from a start time (`since`) or,
if every episode has its own clock, from an episode (`since_episode`). *Law is a function of* names the input of the
free curve that tests the law; it is `nothing` if there is no such curve, as for effects with memory, parameters and
poses. `coefficient` replaces `force` if the simulator knows the normal force.

Some families are tested only under conditions:

- `end_stop`: a missing force points inward near an end of the range, with at most 8 % of the rows beyond. It has one
  edge if the recording shows only one.
- `cogging_force`: the missing force repeats at least two and a half times within the range.
- `torque_speed_limit` and `load_friction`: the command is the force that drives a coordinate.
- `sensor_saturation` and `overflow`: many readings have the lowest or the highest value. `overflow` also needs a
  state that is neither a coordinate nor its velocity.
- `sensor_dead_zone`: many readings are exactly 0, and small ones are missing.
- `sensor_lag`: both a position and its speed are measured, and one trails the other. A common lag of all readings
  looks like a lag of the actuator.
- `clock_drift` (commands that are increasingly late): {TOLERATED:g} ppm amount to at least one step at the end. The
  delay grows to at most 0.4 s, or to the limit of a delay. A fast clock would make commands act before they are
  given, and is not tested.
- `flexible_coupling`: MuJoCo models with motors ([conditions](../method/mujoco.md#elastic-joints-and-presliding)).
  For other simulators it is tested on request only (`diagnose.families.also`), because it resembles delays, lags and
  other oscillations. Its oscillation is integrated exactly, for any stiffness.
- `coupled_friction`, `coupled_damping` and `coupled_armature`: two joints in a row, if
  [inverse dynamics](../method/mujoco.md#drives-of-two-joints) show that one drive turns with both.
- `lugre_friction`: on request only, except for robots. The bristles are integrated exactly at constant speed, so a
  high stiffness needs no shorter step.
- {", ".join(OF_MODELS)}: [MuJoCo models](../how-to/mujoco.md) only. The last one requires an actuator at every joint.

An account names up to seven effects. Several effects on one action, twist or sensor act in their physical order. A
family applies to every simulator that has such a place: the coordinates, actions, parameters and channels that
[it declares](../how-to/simulator.md). [Bring an effect](../how-to/effect.md) explains how to add a family, and
[limits](../method/limits.md#what-looks-alike) lists effects that are hard to separate."""


OF = {
    "1": "",
    "size": "times the usual size there",
    "speed": "times the usual speed there",
    "size / speed": "times usual force over usual speed",
    "size / speed^2": "times usual force over usual speed squared",
    "size / reach": "times usual force over range",
    "size / reach^3": "times usual force over range cubed",
    "1 / reach": "over the range of the recording",
    "step": "steps of the recording",
}
"""The unit of a usual range."""
USUAL = f"""\
## Sizes that machines have

Within these ranges all sizes are equally plausible. Factors (masses, gains) have a log-normal prior around 1 with a
standard deviation of {LOG_SIZE:g}. An unusual law outside its range is rejected. A usual one is reported and marked
`implausible` in [diagnosis.json](files.md#diagnosisjson). More than a factor of two outside the range, the verdict is
not `named`. A range that starts at 0 counts from the value without effect, in both directions; otherwise the ratio
counts. Other families have no such range. *By reason* marks an estimate without a measurement.

| family | parameter | usual | source |
|---|---|---|---|"""


MEASURED = """## Measured curves

These curves are used if no law of the catalogue holds ([how](../method/diagnosis.md#measured-curves)).
`diagnose.families.without` leaves them out."""


def effects_page() -> str:
    """The table of families, the sizes of their parameters, and where each law is from."""
    rows = [_row(family, effect) for family, effect in FAMILIES.items()]
    heads, *lines = [f"| {' | '.join(cells)} |" for cells in (COLUMNS, *rows)]
    table = "\n".join([heads, "|---" * len(COLUMNS) + "|", *lines])
    sources = "\n".join(f"- `{family}`: {_source(effect)}" for family, effect in FAMILIES.items())
    sizes = [
        f"| `{family}` | `{name}` | {_range(family, name, usual)} | {usual.source} |"
        for family, effect in FAMILIES.items()
        for name, usual in effect.plausible.items()
    ]
    usual = "\n".join([USUAL, *sizes])
    curves = "\n".join(f"- `{family}`: {_first(effect)}" for family, effect in CURVES.items())
    parts = [
        HEAD,
        table,
        TAIL,
        _usual_machines(),
        usual,
        MEASURED,
        curves,
        "## References of the laws",
        sources,
    ]
    return "\n\n".join(parts) + "\n"


def _usual_machines() -> str:
    """What machines of a kind usually have, and why; all else must bring more."""
    laws = Settings().laws
    lines = [
        f"| {kind} | `{family}` | {why} |"
        for kind, table in USUAL_LAWS.items()
        for family, why in table.items()
    ]
    head = f"""## What is usual

A diagnosis fits all usual laws at once, and removes those that the recording does not need. Any other law must
improve the fit by {laws.unusual:g} nats more than its price (drag {laws.drag:g}, rare laws {laws.rare:g}), and remove
a good part of the remaining error. `diagnose.families.usual` and `.unusual` change this table for your machine.

| kind | family | why |
|---|---|---|
"""
    return head + "\n".join(lines)


def _first(effect: Effect) -> str:
    """The first line of a class's docstring."""
    return (inspect.getdoc(type(effect)) or "").split("\n")[0]


def _range(family: str, name: str, usual: Plausible) -> str:
    """`0 to 5 s^2/m^2`, or in parts of what is usual where it acts, then what its end is at the least."""
    effect = FAMILIES[family]
    unit = next(p.unit for v in effect.variants for p in effect.parameters(PLACE, v) if p.name == name)
    unit = "" if unit == "1" else f" {unit}"
    high = f"from {usual.low:g}" if math.isinf(usual.high) else f"{usual.low:g} to {usual.high:g}"
    counted = f"{high} {OF[usual.of]}" if OF[usual.of] else f"{high}{unit}"
    least = unit.replace("U", "kg m^2") if family.endswith("armature") else unit
    return f"{counted}, to {usual.least:g}{least} at least" if usual.least else counted


def _row(family: str, effect: Effect) -> list[str]:
    pose = effect.places.__qualname__.startswith("PoseEffect")
    return [
        f"`{family}`",
        "`pose`" if pose else effect.acts_on or ACTS_ON[effect.site],
        _law(effect),
        ", ".join(
            dict.fromkeys(
                f"`{p.name}` [{p.unit}]" for v in effect.variants for p in effect.parameters(PLACE, v)
            )
        ),
        effect.function_of,
        "region only" if effect.needs_region else "yes" if effect.gated else "no",
    ]


def _law(effect: Effect) -> str:
    """The first sentence of its class, without the words before a colon that only say the family's name again."""
    law = _parts(effect)[0].rstrip(".")
    before, _, after = law.partition(": ")
    told = after if after and len(before.split()) <= MOST_WORDS else law
    return re.sub(r"\|([^|]*)\|", r"abs(\1)", told)


def _parts(effect: Effect) -> tuple[str, str]:
    """What the class says of itself: the law, and the source behind it."""
    head, _, below = (inspect.getdoc(type(effect)) or "").partition("\n\n")
    return " ".join(head.split()), " ".join(below.split())


def _source(effect: Effect) -> str:
    return _parts(effect)[1].rstrip(".").replace("|", "\\|") + "."
