"""Messages: their types from the bag itself, parsed by rosbags, and dotted paths to the numbers in them.

rosbags turns definitions into Python source and runs it, one line per element of a fixed array. A definition is
therefore untrusted input: names must be plain identifiers, and what they expand to must stay small.

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
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from operator import attrgetter
from typing import Any

from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore
from rosbags.typesys.base import normalize_fieldname

from gpsim.recordings.readers.container import MAX_DEFINITION, DamageError, Stream
from gpsim.recordings.values import one_line

Types = Mapping[str, tuple[Any, Any]]
"""rosbags' parse tree: type name -> (constants, fields)."""

MAX_DEPTH = 24
MAX_NODES = 2_000
MAX_NODES_OF_A_LOG = 50_000
_TYPE_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*(/[A-Za-z][A-Za-z0-9_]*){1,3}", re.ASCII)
_FIELD_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*", re.ASCII)
_EMPTY = re.compile(r"\s*(#|$)")
_IDL_SEPARATOR = "=" * 80 + "\n"
_LISTS = (Nodetype.ARRAY, Nodetype.SEQUENCE)
DISTROS = tuple(store.value.removeprefix("ros2_") for store in Stores if store.value.startswith("ros2_"))


@dataclass(frozen=True)
class Decoder:
    """One message type with everything below it, which `types` describe; nodes: fields that it expands to.

    decode_raw: from bytes and type name to a message, by rosbags; raises anything where they do not fit.
    """

    name: str
    types: Types
    decode_raw: Callable[[bytes, str], object]
    nodes: int

    def decode(self, data: bytes) -> object:
        """The message object; DamageError where the bytes do not fit the definition."""
        try:
            return self.decode_raw(data, self.name)
        except Exception as error:
            # rosbags lets a dozen kinds through: SerdeError, struct.error, TypeError, MemoryError ...
            raise DamageError(f"not a {self.name}: {one_line(error, 120)}") from error


@lru_cache(maxsize=8)
def _types_of(store: Stores) -> Types:
    types: Types = get_typestore(store).fielddefs
    return types


def decoder(stream: Stream, distro: str) -> Decoder:
    """The decoder of a stream: from the bag's own definition, else from ROS 2 `distro`; DamageError if neither.

    A stream that is at fault has none. Kept for the next stream that is described in the same words: making one takes
    rosbags some 10 ms a type.
    """
    if stream.fault:
        raise DamageError(stream.fault)
    return _decoder(replace(stream, id=0, topic="", count=None, start=None, end=None), distro)


@lru_cache(maxsize=256)
def _decoder(stream: Stream, distro: str) -> Decoder:
    if stream.encoding not in ("ros1", "cdr"):
        raise DamageError(
            f"messages are encoded as {one_line(stream.encoding, 40)!r}; only ROS 1 and CDR are read"
        )
    own = stream.format != "none"
    types = _parse(stream) if own else _types_of(Stores(f"ros2_{distro}"))
    if stream.type not in types:
        source = "the bag's definition" if own else f"ROS 2 {distro}"
        raise DamageError(f"type {one_line(stream.type, 80)} is not in {source}; name its distribution")
    types = _reachable(types, stream.type)
    nodes = _check_types(types, stream.type)
    store = get_typestore(Stores.EMPTY)
    try:
        store.register(types)
        if stream.digest and stream.encoding == "ros1" and stream.digest != "*":
            made = store.generate_msgdef(stream.type)[1]
            if made != stream.digest:
                raise DamageError(f"definition of {stream.type} does not match its own md5 sum")
        store.get_msgdef(stream.type)
    except DamageError:
        raise
    except Exception as error:  # code generation raises NameError, KeyError, RecursionError ... on nonsense
        raise DamageError(f"definition of {stream.type} is not usable: {one_line(error, 120)}") from error
    decode = store.deserialize_ros1 if stream.encoding == "ros1" else store.deserialize_cdr
    return Decoder(stream.type, types, decode, nodes)


def _parse(stream: Stream) -> Types:
    if len(stream.definition) > MAX_DEFINITION:
        raise DamageError(f"definition of {one_line(stream.type, 80)} is {len(stream.definition)} bytes long")
    if not _TYPE_NAME.fullmatch(stream.type):
        raise DamageError(f"{one_line(stream.type, 80)!r} is not a message type name")
    types: dict[str, tuple[Any, Any]] = dict(_types_of(Stores.EMPTY))
    # Without empty lines and lines of comment: rosbags' parser needs the square of their number in time.
    text = "\n".join(line for line in stream.definition.splitlines() if not _EMPTY.match(line)) + "\n"
    try:
        if stream.format == "msg":
            types.update(get_types_from_msg(text, stream.type))
        else:
            parts = [part.partition("\n")[2] for part in text.split(_IDL_SEPARATOR)[1:]]
            for part in parts if text.startswith(f"{_IDL_SEPARATOR}IDL: ") else [text]:
                types.update(get_types_from_idl(part))
    except Exception as error:  # TypesysError, AssertionError, RecursionError, ValueError, KeyError ...
        raise DamageError(f"definition of {stream.type} cannot be parsed: {one_line(error, 80)}") from error
    return types


def _reachable(types: Types, root: str) -> dict[str, tuple[Any, Any]]:
    found: dict[str, tuple[Any, Any]] = {}
    todo = [root]
    while todo:
        name = todo.pop()
        if name in found:
            continue
        if name not in types:
            raise DamageError(f"definition of {root} lacks {one_line(name, 80)}")
        found[name] = types[name]
        for _, description in types[name][1]:
            inner = description[1][0] if description[0] in _LISTS else description
            if inner[0] == Nodetype.NAME:
                todo.append(inner[1])
    return found


def _check_types(types: Types, root: str) -> int:
    """Number of fields that a type expands to; DamageError where rosbags' code generator could not bear it."""
    for name, (constants, fields) in types.items():
        if not _TYPE_NAME.fullmatch(name):
            raise DamageError(f"{one_line(name, 80)!r} is not a message type name")
        for field, *_ in (*constants, *fields):
            if not _FIELD_NAME.fullmatch(field):
                raise DamageError(f"{name}: {one_line(field, 80)!r} is not a field name")
    nodes, _ = _size(types, root, {}, 0)
    if nodes > MAX_NODES:
        raise DamageError(f"{root} expands to {min(nodes, 10**9)} or more fields; the limit is {MAX_NODES}")
    return nodes


def _size(types: Types, name: str, sizes: dict[str, tuple[int, int]], depth: int) -> tuple[int, int]:
    """(objects made, fewest bytes read) for one message of type `name`, every sequence counted once."""
    if depth > MAX_DEPTH:
        raise DamageError(f"{name} is nested more than {MAX_DEPTH} levels deep, or contains itself")
    if name in sizes:
        return sizes[name]
    nodes, size = 1, 0
    for _, description in types[name][1]:
        kind = description[0]
        inner, length = description[1] if kind in _LISTS else (description, 1)
        named = inner[0] == Nodetype.NAME
        below = _size(types, inner[1], sizes, depth + 1) if named else (1, 1)
        if kind == Nodetype.SEQUENCE:
            # Without this a few bytes could stand for millions of objects.
            if below[1] == 0 or below[0] > 64 + 8 * below[1]:
                raise DamageError(
                    f"{name} holds a sequence of {inner[1]}, which has too many fields for its bytes"
                )
            nodes, size = nodes + below[0], size + 4
        else:
            as_block = kind == Nodetype.ARRAY and not named and inner[1][0] != "string"
            nodes += 1 if as_block else length * below[0]
            size += length * below[1]
    sizes[name] = (nodes, size)
    return sizes[name]


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
_NOTHING = "structure_needs_at_least_one_member"  # the field of a message without any


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
            steps.append(Named(normalize_fieldname(name), normalize_fieldname(key.strip()), value.strip()))
            here = here[1][0]
            continue
        steps.append(normalize_fieldname(name))
        if where is not None:
            if selection is not None or not all(isinstance(step, str) for step in steps):
                raise PathError(f"{text}: only one selection in brackets is possible, before any index")
            here = _element(here, text, None)
            array = tuple(str(step) for step in steps)
            selection, steps = Selection(array, _conditions(where, here, types, text), here[1]), []
    if here[0] != Nodetype.BASE or here[1][0] not in _NUMBERS:
        raise PathError(f"{text}: not a number; it leads to {_name(here)}")
    return FieldPath(text, selection, tuple(steps))


def _segments(text: str) -> Iterator[tuple[int | None, str, str | None]]:
    position = 0
    while position < len(text):
        match = _SEGMENT.match(text, position)
        if match is None or (match.end() < len(text) and text[match.end()] != "."):
            raise PathError(
                f"{one_line(text)}: not a path at character {position + 1}; expected as pose.position.x or data.0"
            )
        index = match["index"]
        yield (None if index is None else int(index)), match["name"] or "", match["where"]
        position = match.end() + 1
    if not text or text.endswith("."):
        raise PathError(f"{one_line(text)!r}: not a path; expected as pose.position.x or data.0")


def _field(here: Any, name: str, types: Types, text: str) -> Any:
    if here[0] != Nodetype.NAME:
        raise PathError(f"{text}: {name} has no fields, so it has no '{_name(here)}'")
    names = dict(types[here[1]][1])
    if name not in names:
        close = difflib.get_close_matches(name, names, 3, 0.4) or list(names)[:12]
        raise PathError(f"{text}: {here[1]} has no field '{name}'; there are {', '.join(close)}")
    return names[name]


def _element(here: Any, text: str, index: int | None) -> Any:
    if here[0] not in _LISTS:
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
    return here[0] in _LISTS and here[1][0][0] == Nodetype.BASE and here[1][0][1][0] in kinds


def _conditions(where: str, element: Any, types: Types, text: str) -> tuple[tuple[str, str], ...]:
    found = []
    for part in where.split(","):
        key, equals, value = part.partition("=")
        names = key.strip().split(".")
        if not equals or not key.strip():
            raise PathError(f"{text}: a selection is written as [child_frame_id=base_link]")
        here = element
        for name in names:
            here = _field(here, name, types, text)
        if here[0] != Nodetype.BASE:
            raise PathError(f"{text}: {key.strip()} is not a single value; it is {_name(here)}")
        found.append((".".join(map(normalize_fieldname, names)), value.strip()))
    return tuple(found)


def _name(description: Any) -> str:
    kind, detail = description
    if kind == Nodetype.BASE:
        return str(detail[0])
    return f"a {detail}" if kind == Nodetype.NAME else f"an array of {_name(detail[0])}"


def stamp_path(types: Types, root: str) -> tuple[str, ...] | None:
    """Attributes that lead to a message's own stamp: header.stamp, or a top-level stamp; None without one."""
    for name, description in types[root][1]:
        if description == (Nodetype.NAME, HEADER) and ("stamp", (Nodetype.NAME, TIME)) in types[HEADER][1]:
            return (normalize_fieldname(name), "stamp")
    return ("stamp",) if ("stamp", (Nodetype.NAME, TIME)) in types[root][1] else None


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
        return
    if kind != Nodetype.NAME:
        yield from _array_paths(types, here, prefix, samples, selects)
        return
    key, held = _names_of(types[detail][1], samples)
    for name, description in types[detail][1]:
        if name == _NOTHING:
            continue
        place = f"{prefix}.{name}" if prefix else name
        below = [getattr(sample, normalize_fieldname(name)) for sample in samples]
        if held and _lists(description, _NUMBERS):
            # The names for which a message has a number in this list.
            named = [[str(n) for n in getattr(s, normalize_fieldname(key))] for s in samples]
            there = {n for ns, numbers in zip(named, below, strict=True) for n in ns[: len(numbers)]}
            yield from (f"{place}[{key}={n}]" for n in held if n in there)
        else:
            yield from _paths(types, description, place, below, selects)


def _names_of(fields: Any, samples: list[Any]) -> tuple[str, tuple[str, ...]]:
    """The list of texts that names the numbers beside it, and what it holds: nothing where it is of no use."""
    key = next((name for name, d in fields if name in _NAMERS and _lists(d, _TEXTS)), None)
    if key is None or not any(_lists(d, _NUMBERS) for _, d in fields):
        return "", ()
    every = [[str(name) for name in getattr(sample, normalize_fieldname(key))] for sample in samples]
    held = tuple(dict.fromkeys(name for names in every for name in names))
    plain = all(_selectable(name) and name for name in held)
    once = all(len(set(names)) == len(names) for names in every)
    return (key, held) if plain and once and len(held) <= MAX_LISTED else ("", ())


def _selectable(value: str) -> bool:
    return bool(_SELECTABLE.fullmatch(value)) and value.isprintable()


def _array_paths(types: Types, here: Any, prefix: str, samples: list[Any], selects: bool) -> Iterator[str]:
    kind, (inner, length) = here
    key, elements, values = None, [], list[str]()
    if kind == Nodetype.SEQUENCE:
        length = max((len(sample) for sample in samples), default=0)
        if selects and inner[0] == Nodetype.NAME:
            texts = {name for name, d in types[inner[1]][1] if d[0] == Nodetype.BASE and d[1][0] == "string"}
            key = next((name for name in _SELECTOR_KEYS if name in texts), None)
    if key is not None:
        elements = [element for sample in samples for element in sample]
        values = sorted({str(getattr(element, key)) for element in elements})
    if key is not None and all(map(_selectable, values)):
        for value in values[:MAX_LISTED]:
            chosen = [element for element in elements if str(getattr(element, key)) == value]
            yield from _paths(types, inner, f"{prefix}[{key}={value}]", chosen, False)
    elif length <= MAX_LISTED:
        for index in range(length):
            below = [sample[index] for sample in samples if len(sample) > index]
            yield from _paths(types, inner, f"{prefix}.{index}", below, False)
