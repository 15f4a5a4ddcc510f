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

{MADE.format(source="`gpsim/effects/registry.py`")}
It is what `gpsim diagnose` may name. Names of families and parameters are a contract of
[diagnosis.json](files.md#diagnosisjson).

In a law q is a coordinate, q' its velocity, u a command, y what a sensor says, v and w a vehicle's speed and
turn rate; the names of the other [symbols](../method/notation.md) are those of the parameters. In a unit, U is
the unit of what the effect acts on (of a coordinate: its force, N or N m) and L that of a position (m or rad)."""
COLUMNS = ("family", "acts on", "law", "parameters", "law is a function of", "may be limited")
TAIL = f"""\
`end_stop` has one edge where a recording shows one. It is asked where a force that is missing bends inward near an end
of the way, with at most 8 % of the rows beyond; `cogging_force` where one repeats along the way, two and a half times
at the least: what was not seen to repeat may be any curve. `torque_speed_limit` and `load_friction` are asked where a
command is the force that drives a coordinate. `sensor_saturation` and `overflow` are asked where many readings have
the lowest or the highest value of all, `sensor_dead_zone` where many are exactly 0 and the small ones are missing;
`overflow` is for states that are neither a coordinate nor its velocity. `sensor_lag` is asked where a speed and its
position are both measured, of the one that trails the other: of readings that all trail alike it cannot be told from
an actuator's lag.
`clock_drift` makes commands later and later since the recording's clock began; it is asked where {TOLERATED:g} ppm
come to a step at the end, and grows to 0.4 s at most, or to what a delay may be. A clock that is fast would have
commands act before they are given, and is not asked.
`flexible_coupling` is asked of a command that is the force that drives a coordinate, of a MuJoCo model of motors, and
on request alone (`diagnose.families.also`) where a robot is not [asked by itself](../method/mujoco.md#what-yields):
three numbers and a swing of their own come near to delays, lags and whatever else swings. Its swing is integrated
exactly over a step, however stiff it is.
`lugre_friction` is asked on request alone, too, but of robots, as bristles may bend by any way and each is tried; they
are integrated exactly for an even speed, so that no stiffness asks for shorter steps.
For [MuJoCo models](../how-to/mujoco.md) alone are {", ".join(OF_MODELS)}; the last where every joint has an actuator.
*May be limited*: the effect may act in a `region` only (while a position lies in an interval), or begin at a
moment (`since`), or, where every episode has a clock of its own, with an episode (`since_episode`). *Law is a
function of*: what a free curve is drawn over, to see whether the law holds; `nothing` where no curve can be
drawn, because the effect remembers, ages, is a number, or moves a whole pose. `coefficient` stands in the place
of `force` where the simulator knows the normal force.

Up to seven effects are named together. Several on one action, twist or sensor act in a fixed order, the
physical one, whatever order they were found in. A family applies to every simulator that has such a place:
coordinates, actions, parameters and channels are what [a simulator declares](../how-to/simulator.md). A family
of your own: [bring an effect](../how-to/effect.md). Which of them a recording may be unable to tell apart:
[limits](../method/limits.md#what-looks-alike)."""


OF = {
    "1": "",
    "size": "of the usual size there",
    "speed": "of the usual speed there",
    "size / speed": "of usual force over usual speed",
    "size / speed^2": "of usual force over usual speed squared",
    "size / reach": "of usual force over reach",
    "size / reach^3": "of usual force over reach cubed",
    "1 / reach": "over the recording's length",
    "step": "steps of the recording",
}
"""In what a usual range is counted."""
USUAL = f"""\
## Sizes that machines have

Within these ranges every size is as good as any other. What multiplies (masses, gains) is log-normal about 1 a priori,
with a standard deviation of {LOG_SIZE:g}. An unusual law beyond its range does not stand; a usual one is told, and
[diagnosis.json](files.md#diagnosisjson) says of it that it is `implausible`: twice beyond it is not `named`.
What begins at 0 counts from the value that does nothing, in either direction; of what begins above 0
the ratio counts. Families that are not here have no such range. *By reason*: nobody has measured it.

| family | parameter | usual | source |
|---|---|---|---|"""


MEASURED = """## Measured curves

No families of the catalogue, and offered by no search: they stand where none of its laws holds
([measured curves](../method/diagnosis.md#measured-curves)). `diagnose.families.without` leaves them out."""


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
        "## Where the laws are from",
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

A diagnosis fits all of this at once, and takes away what the recording does not ask for. A law that is not here must
bring {laws.unusual:g} nats more beside its price (drag {laws.drag:g}, what is rare {laws.rare:g}) and a good part
of what the usual ones leave. `diagnose.families.usual` and `.unusual` change the table for a machine of yours.

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
    least = unit.replace("U", "kg m^2") if family == "armature" else unit
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
