"""Laws for lanes of rows: compiled from the families' own functions, and curves.

Which law a term has is known by its number, so that each gets a loop of its own. The loops are alike, and written here
as text: a compiled function cannot be handed another one without losing its loop's speed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from gpsim.channels import FloatArray, IntArray
from gpsim.effects import arguments
from gpsim.kernels import codes, lanes, tables
from gpsim.kernels.compiling import blended, compiled, place
from gpsim.kernels.gates import curve, curve_of
from gpsim.kernels.lanes import LANES, MOST, ONE, R1, R2, SUM, U, Y
from gpsim.kernels.tables import Formula

TINY = 2.2250738585072014e-308  # the smallest normal number
Written = Callable[..., Any]


def _asked(one: Formula, known: Mapping[str, str], value: str) -> str:
    """The text by which a law is asked. known: texts of what it may know; value: of its values, from {} on."""
    names = list(one.values)
    given = (known[name] if name in known else value.format(names.index(name)) for name in arguments(one.law))
    return f"law_{one.number}({', '.join(given)})"


def _compiled(name: str, lines: Iterable[str], laws: Iterable[Formula], **rooms: Any) -> Written:
    """The function of this text, which may ask these laws."""
    rooms |= {f"law_{one.number}": compiled(one.law) for one in laws}
    exec(compile("\n".join(lines), f"<{name}>", "exec"), rooms)
    return compiled(rooms[name])  # type: ignore[no-any-return]


def _loops(
    name: str, taken: str, kinds: tuple[int, ...], known: Mapping[str, str], before: str, body: str
) -> Written:
    """A function of (b, lanes, law, where its values begin, v, *taken): the loop of the law asked for.

    before: a line ahead of all loops; body: what a loop does, in which LAW stands for what the law says.
    """
    laws = tables.of_kind(*kinds)
    lines = [f"def {name}(b, lanes, law, at, v, {taken}):", f"    {before}"]
    for one in laws:
        texts = dict(known)
        if one.number // codes.KIND_WIDTH * codes.KIND_WIDTH == codes.WEIGHED:
            texts["load"] = "b[LOAD + i]"
        said = body.replace("LAW", _asked(one, texts, "v[at + {}, i]"))
        lines += [f"    if law == {one.number}:", "        for i in range(lanes):", f"            {said}"]
    places = {k: v for k, v in vars(lanes).items() if k.isupper() or k[:-1].isupper()}
    return _compiled(name, [*lines, "    return"], laws, place=place, blended=blended, **places)


push_of = _loops(
    "push_of",
    "position, speed, to, shares, n",
    (codes.PUSHES,),
    {"q": "b[position + i]", "speed": "b[speed + i]"},
    "position, speed, to = place(position), place(speed), place(to)",
    "b[to + i] += LAW * shares[n, i]",
)
"""Add to `to` the smooth force of a law at a position and a speed."""
grip_of = _loops(
    "grip_of",
    "position, speed, load, shares, n",
    (codes.GRIPS, codes.WEIGHED, codes.LOADED),
    {"q": "b[position + i]", "speed": "b[speed + i]", "load": "abs(b[load + i])"},
    "position, speed, load = place(position), place(speed), place(load)",
    "b[MOST + i] += LAW * shares[n, i]",
)
"""Add to MOST what the dry friction of a law can hold; load: where what drives the coordinate is."""
given_of = _loops(
    "given_of",
    "command, speed",
    (codes.GIVES,),
    {"u": "b[command + i]", "speed": "b[speed + i]"},
    "command, speed = place(command), place(speed)",
    "b[command + i] = LAW",
)
"""Change a command to what a drive gives of it at a speed."""
correct_of = _loops(
    "correct_of",
    "to, gated, shares, n",
    (codes.BELIEVED,),
    {"believed": "b[to + i]"},
    "to = place(to)",
    "b[to + i] = blended(shares[n, i], LAW, b[to + i]) if gated else LAW",
)
"""Change a parameter, as it was believed, to what it is."""
twist_of = _loops(
    "twist_of",
    "n",
    (codes.TURNS,),
    {"v": "b[R + i]", "lateral": "b[R1 + i]", "w": "b[R2 + i]"},
    "pass",
    "b[R + i], b[R1 + i], b[R2 + i] = LAW",
)
"""Change R to the twist that a vehicle makes of it."""


def _late() -> Written:
    """A function of (law, step, t, v, where its values begin, lane): by how much [s] commands are late."""
    laws, lines = tables.of_kind(codes.LATE), ["def late_of(law, step, t, v, at, i):"]
    for one in laws:
        said = _asked(one, {"step": "step", "t": "t"}, "v[at + {}, i]")
        lines += [f"    if law == {one.number}:", f"        return {said}"]
    return _compiled("late_of", [*lines, "    return 0.0"], laws)


def _changed() -> Written:
    """A function of (law, where its values begin, v, lane, memory, its place there, pieces, how many).

    It changes that many pieces to what the law makes of them.
    """
    laws = tables.of_kind(codes.PASSES)
    lines = ["def changed_by(law, at, v, lane, memory, place, pieces, count):"]
    for one in laws:
        kept = [f"m{k}" for k in range(len(one.effect.memory))]
        texts = {"u": "pieces[0, i]", "t": "pieces[2, i]", "step": "pieces[1, i]"}
        texts |= dict(zip(one.effect.memory, kept, strict=True))
        lines += [f"    if law == {one.number}:"]
        lines += [f"        x{k} = v[at + {k}, lane]" for k in range(len(one.values))]
        lines += [f"        {m} = memory[place + {k}]" for k, m in enumerate(kept)]
        lines += ["        for i in range(count):"]
        lines += [f"            {', '.join(['pieces[0, i]', *kept])} = {_asked(one, texts, 'x{}')}"]
        lines += [f"        memory[place + {k}] = {m}" for k, m in enumerate(kept)]
    return _compiled("changed_by", lines, laws)


late_of, changed_by = _late(), _changed()


@compiled
def force(
    b: FloatArray,
    lanes: int,
    terms: IntArray,
    n: int,
    v: FloatArray,
    shares: FloatArray,
    curves: IntArray,
    knots: FloatArray,
    to: int,
) -> None:
    """Add to `to` a smooth force on the coordinate of the term n in the stage's state."""
    law, at = terms[n, codes.LAW], terms[n, codes.VALUE]
    position = place(Y + 2 * terms[n, codes.ON] * LANES)
    speed, to = place(position + LANES), place(to)
    if law >= codes.PUSHES:
        push_of(b, lanes, law, at, v, position, speed, to, shares, n)
        return
    about = terms[n, codes.CURVE]
    curve(
        b,
        lanes,
        speed if curves[about, codes.FIRST] else position,
        position,
        at,
        curves,
        about,
        knots,
        v,
        ONE,
    )
    for i in range(lanes):
        b[to + i] += b[ONE + i] * shares[n, i]


@compiled
def friction_limit(
    b: FloatArray,
    lanes: int,
    terms: IntArray,
    n: int,
    v: FloatArray,
    shares: FloatArray,
    loaded: bool,
    curves: IntArray,
    knots: FloatArray,
) -> None:
    """Add to MOST what the dry friction of the term n can hold; loaded: there is a normal force, in LOAD."""
    law, at = terms[n, codes.LAW], terms[n, codes.VALUE]
    position = place(Y + 2 * terms[n, codes.ON] * LANES)
    speed = place(position + LANES)
    if law >= codes.PUSHES:
        if loaded or law < codes.WEIGHED or law >= codes.LOADED:
            grip_of(
                b, lanes, law, at, v, position, speed, place(U + terms[n, codes.CURVE] * LANES), shares, n
            )
        return
    about = terms[n, codes.CURVE]
    of_speed = curves[about, codes.FIRST] == 1
    curve(b, lanes, speed if of_speed else position, position, at, curves, about, knots, v, ONE)
    if of_speed:  # of what rests, the mean of both directions
        for i in range(lanes):
            if b[speed + i] == 0.0:
                b[ONE + i] = 0.5 * (b[ONE + i] + curve_of(-TINY, at, curves, about, knots, v, i))
    for i in range(lanes):
        b[MOST + i] += b[ONE + i] * shares[n, i]


@compiled
def twist(
    b: FloatArray, lanes: int, terms: IntArray, n: int, v: FloatArray, curves: IntArray, knots: FloatArray
) -> None:
    """Change R to what a vehicle makes of that twist (speed, sideways speed, turn rate), which was in SUM before."""
    law, at = terms[n, codes.LAW], terms[n, codes.VALUE]
    if law >= codes.TURNS:
        twist_of(b, lanes, law, at, v, n)
        return
    curve(b, lanes, place(SUM), place(SUM + 2 * LANES), at, curves, terms[n, codes.CURVE], knots, v, ONE)
    if law == codes.TURN_CURVE:
        for i in range(lanes):
            b[R2 + i] += b[ONE + i]
    else:
        for i in range(lanes):
            b[R1 + i] += b[ONE + i]
