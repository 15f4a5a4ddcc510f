"""The laws of families that write theirs as one formula, for lanes of rows: compiled from the family's own function.

Which law a term has is known by its number, so that each gets a loop of its own. The loops are alike, and written here
as text: a compiled function cannot be handed another one without losing its loop's speed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from gpsim.effects import CATALOGUE
from gpsim.kernels import lanes, tables
from gpsim.kernels.compiling import compiled
from gpsim.kernels.scalars import place

Loops = Callable[..., None]


def _loops(
    name: str, arguments: str, site: Iterable[str], before: str, body: str, *, dry: bool = False
) -> Loops:
    """A function of (b, lanes, terms' law, where its values begin, v, *arguments): the loop of the law asked for.

    before: lines ahead of all loops; body: what a loop does, in which LAW(inputs) stands for the law of the inputs and
    its values.
    """
    rooms: dict[str, Any] = {"place": place, **{k: v for k, v in vars(lanes).items() if k.isupper()}}
    lines = [
        f"def {name}(b, lanes, law, at, v, {arguments}):",
        *(f"    {line}" for line in before.splitlines()),
    ]
    for family in site:
        effect, number = CATALOGUE[family], tables.OWN[family]
        rooms[f"law_{number}"] = compiled(effect.dry_law if dry else effect.law)  # type: ignore[attr-defined,type-var]
        values = "".join(f", v[at + {i}, i]" for i in range(len(effect.takes)))
        said = body.replace("LAW(", f"law_{number}(").replace("VALUES", values)
        lines += [f"    if law == {number}:", "        for i in range(lanes):"]
        lines += [f"            {line}" for line in said.splitlines()]
    exec(compile("\n".join([*lines, "    return"]), f"<{name}>", "exec"), rooms)
    return compiled(rooms[name])  # type: ignore[no-any-return]


force_of = _loops(
    "force_of",
    "position, speed, to, shares, n",
    tables.OWN_FORCES,
    "position, speed, to = place(position), place(speed), place(to)",
    "b[to + i] += LAW(b[position + i], b[speed + i]VALUES) * shares[n, i]",
)
"""Add to `to` the smooth force of a law at a position and a speed."""

grip_of = _loops(
    "grip_of",
    "position, speed, load, shares, n",
    tables.OWN_DRY,
    "position, speed, load = place(position), place(speed), place(load)",
    "b[MOST + i] += LAW(b[position + i], b[speed + i], abs(b[load + i])VALUES) * shares[n, i]",
    dry=True,
)
"""Add to MOST what the dry friction of a law can hold; load: where its size is."""

given_of = _loops(
    "given_of",
    "command, speed",
    tables.OWN_DRIVES,
    "command, speed = place(command), place(speed)",
    "b[command + i] = LAW(b[command + i], b[speed + i]VALUES)",
)
"""Change a command to what a drive gives of it at a speed."""

twist_of = _loops(
    "twist_of",
    "",
    tables.OWN_TWISTS,
    "",
    "b[R + i], b[R1 + i], b[R2 + i] = LAW(b[R + i], b[R1 + i], b[R2 + i]VALUES)",
)
"""Change R to the twist that a vehicle makes of it."""


def _passed() -> Callable[..., float]:
    """A function of (law, u, v, where its values begin, lane): what a law without memory makes of one command."""
    rooms: dict[str, Any] = {}
    lines = ["def passed_of(law, u, v, at, i):"]
    for family in tables.OWN_ACTUATORS:
        number, effect = tables.OWN[family], CATALOGUE[family]
        rooms[f"law_{number}"] = compiled(effect.law)  # type: ignore[type-var]
        values = "".join(f", v[at + {k}, i]" for k in range(len(effect.takes)))
        lines += [f"    if law == {number}:", f"        return law_{number}(u{values})"]
    exec(compile("\n".join([*lines, "    return u"]), "<passed_of>", "exec"), rooms)
    return compiled(rooms["passed_of"])  # type: ignore[no-any-return]


passed_of = _passed()
