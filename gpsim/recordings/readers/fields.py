"""Dotted paths into messages.

    pose.position.x                                               a field of a nested message
    data.3, pose.covariance.0                                     an element of an array, counted from 0
    transforms.0.transform.translation.x                          the first message of an array of messages
    transforms[child_frame_id=base_link].transform.translation.x  those whose field has this value
    position[name=elbow]                                          the number beside that name, as of a JointState

A selection may name several fields, as [header.frame_id=map,child_frame_id=base_link]. It makes one row for every
element that matches, with that element's own header stamp; a message without a match makes no row. A name selects the
number at the place where a list of texts of the same message holds it, which may be another one in every message.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from operator import attrgetter
from typing import Any

from rosbags.interfaces import Nodetype
from rosbags.typesys.base import normalize_fieldname

from gpsim.recordings.readers.damage import one_line
from gpsim.recordings.readers.definitions import Types

HEADER = "std_msgs/msg/Header"
TIME = "builtin_interfaces/msg/Time"
MAX_LISTED = 64
MAX_FIELDS = 512
_NUMBERS = frozenset(
    ["bool", "byte", "char", "octet", "float32", "float64", "float128"]
    + [f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)]
)  # fmt: skip
_TEXTS = frozenset({"string", "wstring"})
_SEGMENT = re.compile(r"(?P<index>\d{1,9})|(?P<name>[A-Za-z_]\w*)(\[(?P<where>[^\]]*)\])?", re.ASCII)
_SELECTABLE = re.compile(r"[^\],\s]([^\],]*[^\],\s])?|")  # what a selection in brackets can ask for
_SELECTOR_KEYS = ("child_frame_id", "name", "joint_name", "id")
_NAMERS = ("name", "names", "joint_names")  # lists of texts that name what lists of numbers beside them hold


class PathError(Exception):
    """A path that a message type has no number at; the text says what there is instead."""


@dataclass(frozen=True)
class Selection:
    """The elements of the array at `array` (attribute names) whose fields equal the given texts."""

    array: tuple[str, ...]
    where: tuple[tuple[str, str], ...]
    element: str


@dataclass(frozen=True)
class Named:
    """The element of the list `array` at the place where the list `names` of the same message holds `name`."""

    array: str
    names: str
    name: str

    def beside(self) -> Callable[[Any], Any]:
        """From a message to the number; where the name is in the list is remembered while the list says the same."""
        array, names = attrgetter(self.array), attrgetter(self.names)
        place = 0

        def get(message: Any) -> Any:
            nonlocal place
            held = names(message)
            if place >= len(held) or held[place] != self.name:
                place = held.index(self.name)
            return array(message)[place]

        return get


@dataclass(frozen=True)
class FieldPath:
    """A parsed path: `steps` are attribute names, indices and names, from the message or from the selected element."""

    text: str
    selection: Selection | None
    steps: tuple[str | int | Named, ...]


def parse_path(text: str, types: Types, root: str) -> FieldPath:
    """Check a dotted path against a message type; PathError where it does not end at a number."""
    steps: list[str | int | Named] = []
    selection: Selection | None = None
    here: Any = (Nodetype.NAME, root)
    for index, name, where in _segments(text):
        if index is not None:
            here = _element(here, text, index)
            steps.append(index)
            continue
        parent, here = here, _field(here, name, types, text)
        key, equals, value = (where or "").partition("=")
        beside = dict(types[parent[1]][1]).get(key.strip()) if equals else None
        if beside is not None and _lists(here, _NUMBERS) and _lists(beside, _TEXTS):
            # `key` is a list of texts beside a list of numbers.
            named = Named(normalize_fieldname(name), normalize_fieldname(key.strip()), value.strip())
            here = here[1][0]
            steps.append(named)
            continue
        steps.append(normalize_fieldname(name))
        if where is not None:
            if selection is not None or not all(isinstance(step, str) for step in steps):
                raise PathError(f"{text}: only one selection in brackets is possible, before any index")
            here = _element(here, text, None)
            selection = Selection(
                tuple(str(s) for s in steps), _conditions(where, here, types, text), here[1]
            )
            steps = []
    if here[0] != Nodetype.BASE or here[1][0] not in _NUMBERS:
        raise PathError(f"{text}: not a number; it leads to {_name(here)}")
    return FieldPath(text, selection, tuple(steps))


def _segments(text: str) -> list[tuple[int | None, str, str | None]]:
    found: list[tuple[int | None, str, str | None]] = []
    position = 0
    while position < len(text):
        match = _SEGMENT.match(text, position)
        if match is None or (match.end() < len(text) and text[match.end()] != "."):
            raise PathError(
                f"{one_line(text)}: not a path at character {position + 1}; expected as pose.position.x or data.0"
            )
        index = match["index"]
        found.append((None if index is None else int(index), match["name"] or "", match["where"]))
        position = match.end() + 1
    if not found or text.endswith("."):
        raise PathError(f"{one_line(text)!r}: not a path; expected as pose.position.x or data.0")
    return found


def _field(here: Any, name: str, types: Types, text: str) -> Any:
    if here[0] != Nodetype.NAME:
        raise PathError(f"{text}: {name} has no fields, so it has no '{_name(here)}'")
    names = dict(types[here[1]][1])
    if name not in names:
        close = difflib.get_close_matches(name, names, 3, 0.4) or list(names)[:12]
        raise PathError(f"{text}: {here[1]} has no field '{name}'; there are {', '.join(close)}")
    return names[name]


def _element(here: Any, text: str, index: int | None) -> Any:
    if here[0] not in (Nodetype.ARRAY, Nodetype.SEQUENCE):
        raise PathError(f"{text}: {_name(here)} is not an array")
    inner, length = here[1]
    if index is not None and here[0] == Nodetype.ARRAY and index >= length:
        raise PathError(f"{text}: index {index} is outside an array of {length}")
    if index is None and inner[0] != Nodetype.NAME:
        raise PathError(
            f"{text}: elements can be selected only in an array of messages, or by a list of names beside it as "
            f"[name=elbow]; this is {_name(here)}"
        )
    return inner


def _lists(here: Any, kinds: frozenset[str]) -> bool:
    """Whether it is an array of such plain values."""
    return (
        here[0] in (Nodetype.ARRAY, Nodetype.SEQUENCE)
        and here[1][0][0] == Nodetype.BASE
        and here[1][0][1][0] in kinds
    )


def _conditions(where: str, element: Any, types: Types, text: str) -> tuple[tuple[str, str], ...]:
    found = []
    for part in where.split(","):
        key, equals, value = part.partition("=")
        if not equals or not key.strip():
            raise PathError(f"{text}: a selection is written as [child_frame_id=base_link]")
        here = element
        for name in key.strip().split("."):
            here = _field(here, name, types, text)
        if here[0] != Nodetype.BASE:
            raise PathError(f"{text}: {key.strip()} is not a single value; it is {_name(here)}")
        attributes = ".".join(normalize_fieldname(name) for name in key.strip().split("."))
        found.append((attributes, value.strip()))
    return tuple(found)


def _name(description: Any) -> str:
    kind, detail = description
    if kind == Nodetype.BASE:
        return str(detail[0])
    if kind == Nodetype.NAME:
        return f"a {detail}"
    return f"an array of {_name(detail[0])}"


def stamp_path(types: Types, root: str) -> tuple[str, ...] | None:
    """Attributes that lead to a message's own stamp: header.stamp, or a top-level stamp; None without one."""
    for name, description in types[root][1]:
        if description == (Nodetype.NAME, HEADER) and ("stamp", (Nodetype.NAME, TIME)) in types[HEADER][1]:
            return (normalize_fieldname(name), "stamp")
    for name, description in types[root][1]:
        if name == "stamp" and description == (Nodetype.NAME, TIME):
            return ("stamp",)
    return None


def has_sequences(types: Types) -> bool:
    """Whether the listing of a type's fields needs a look at messages."""
    return any(d[0] == Nodetype.SEQUENCE for _, fields in types.values() for _, d in fields)


def numeric_fields(types: Types, root: str, samples: list[Any]) -> tuple[str, ...]:
    """Paths of the numbers in a type, in order; arrays without fixed length as long as in the sample messages.

    Arrays of more than 64 numbers (images, scans) are left out; their elements can be asked for all the same.
    """
    found: dict[str, None] = {}
    for path in _paths(types, (Nodetype.NAME, root), "", samples, True):
        found[path] = None
        if len(found) >= MAX_FIELDS:
            break
    return tuple(found)


def _paths(types: Types, here: Any, prefix: str, samples: list[Any], selects: bool) -> Iterator[str]:
    """selects: no element was chosen on the way here, so one can be asked for by a selection in brackets."""
    kind, detail = here
    if kind == Nodetype.BASE:
        if detail[0] in _NUMBERS:
            yield prefix
    elif kind == Nodetype.NAME:
        key, held = _names_of(types[detail][1], samples)
        for name, description in types[detail][1]:
            if name == "structure_needs_at_least_one_member":
                continue
            place = f"{prefix}.{name}" if prefix else name
            below = [getattr(sample, normalize_fieldname(name)) for sample in samples]
            if held and _lists(description, _NUMBERS):
                # The names for which a message has a number in this list.
                named = [[str(n) for n in getattr(s, normalize_fieldname(key))] for s in samples]
                there = {n for ns, numbers in zip(named, below, strict=True) for n in ns[: len(numbers)]}
                yield from (f"{place}[{key}={n}]" for n in held if n in there)
                continue
            yield from _paths(types, description, place, below, selects)
    else:
        yield from _array_paths(types, here, prefix, samples, selects)


def _names_of(fields: Any, samples: list[Any]) -> tuple[str, tuple[str, ...]]:
    """The list of texts that names the numbers beside it, and what it holds: nothing where it is of no use."""
    key = next((name for name, d in fields if name in _NAMERS and _lists(d, _TEXTS)), None)
    if key is None or not any(_lists(d, _NUMBERS) for _, d in fields):
        return "", ()
    every = [[str(name) for name in getattr(sample, normalize_fieldname(key))] for sample in samples]
    held = tuple(dict.fromkeys(name for names in every for name in names))
    plain = all(_SELECTABLE.fullmatch(name) and name.isprintable() and name for name in held)
    once = all(len(set(names)) == len(names) for names in every)
    return (key, held) if plain and once and len(held) <= MAX_LISTED else ("", ())


def _array_paths(types: Types, here: Any, prefix: str, samples: list[Any], selects: bool) -> Iterator[str]:
    kind, (inner, length) = here
    if kind == Nodetype.SEQUENCE:
        length = max((len(sample) for sample in samples), default=0)
    key = None
    if kind == Nodetype.SEQUENCE and selects and inner[0] == Nodetype.NAME:
        texts = {name for name, d in types[inner[1]][1] if d[0] == Nodetype.BASE and d[1][0] == "string"}
        key = next((name for name in _SELECTOR_KEYS if name in texts), None)
    elements = [element for sample in samples for element in sample] if key is not None else []
    values = sorted({str(getattr(element, key)) for element in elements}) if key is not None else []
    if key is not None and all(_SELECTABLE.fullmatch(value) and value.isprintable() for value in values):
        for value in values[:MAX_LISTED]:
            chosen = [element for element in elements if str(getattr(element, key)) == value]
            yield from _paths(types, inner, f"{prefix}[{key}={value}]", chosen, False)
    elif length <= MAX_LISTED:
        for index in range(length):
            below = [sample[index] for sample in samples if len(sample) > index]
            yield from _paths(types, inner, f"{prefix}.{index}", below, False)
