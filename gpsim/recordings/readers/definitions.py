"""Message definitions from the bag itself: parsed by rosbags, checked before any code is made of them.

rosbags turns definitions into Python source and runs it, one line per element of a fixed array. A definition is
therefore untrusted input: names must be plain identifiers, and what they expand to must stay small.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from gpsim.recordings.readers.damage import MAX_DEFINITION, DamageError, one_line
from gpsim.recordings.readers.source import Stream

Types = Mapping[str, tuple[Any, Any]]
"""rosbags' parse tree: type name -> (constants, fields)."""

MAX_DEPTH = 24
MAX_NODES = 2_000
MAX_NODES_OF_A_LOG = 50_000
_TYPE_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*(/[A-Za-z][A-Za-z0-9_]*){1,3}", re.ASCII)
_FIELD_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*", re.ASCII)
_EMPTY = re.compile(r"\s*(#|$)")
_IDL_SEPARATOR = "=" * 80 + "\n"
DISTROS = tuple(store.value.removeprefix("ros2_") for store in Stores if store.value.startswith("ros2_"))


@dataclass(frozen=True)
class Decoder:
    """One message type with everything below it: `store` decodes, `types` describes."""

    name: str
    types: Types
    store: Typestore
    encoding: str
    nodes: int

    @property
    def decode_raw(self) -> Callable[[bytes, str], object]:
        """From bytes and type name to a message, by rosbags; raises anything where they do not fit."""
        ros1 = self.encoding == "ros1"
        decode: Callable[[bytes, str], object] = (
            self.store.deserialize_ros1 if ros1 else self.store.deserialize_cdr
        )
        return decode

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
    types = _parse(stream) if stream.format != "none" else _types_of(Stores(f"ros2_{distro}"))
    if stream.type not in types:
        source = "the bag's definition" if stream.format != "none" else f"ROS 2 {distro}"
        raise DamageError(f"type {one_line(stream.type, 80)} is not in {source}; name its distribution")
    types = _reachable(types, stream.type)
    nodes = check_types(types, stream.type)
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
    return Decoder(stream.type, types, store, stream.encoding, nodes)


def _parse(stream: Stream) -> Types:
    if len(stream.definition) > MAX_DEFINITION:
        raise DamageError(f"definition of {one_line(stream.type, 80)} is {len(stream.definition)} bytes long")
    if not _TYPE_NAME.fullmatch(stream.type):
        raise DamageError(f"{one_line(stream.type, 80)!r} is not a message type name")
    types: dict[str, tuple[Any, Any]] = dict(_types_of(Stores.EMPTY))
    # Without empty lines and lines of comment: rosbags' parser needs the square of their number in time.
    lines = (line for line in stream.definition.splitlines() if not _EMPTY.match(line))
    text = "\n".join(lines) + "\n"
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
            inner = (
                description[1][0] if description[0] in (Nodetype.ARRAY, Nodetype.SEQUENCE) else description
            )
            if inner[0] == Nodetype.NAME:
                todo.append(inner[1])
    return found


def check_types(types: Types, root: str) -> int:
    """Number of fields that a type expands to; DamageError where rosbags' code generator could not bear it."""
    for name, (constants, fields) in types.items():
        if not _TYPE_NAME.fullmatch(name):
            raise DamageError(f"{one_line(name, 80)!r} is not a message type name")
        for field in (*(c[0] for c in constants), *(f[0] for f in fields)):
            if not _FIELD_NAME.fullmatch(field):
                raise DamageError(f"{name}: {one_line(field, 80)!r} is not a field name")
    sizes: dict[str, tuple[int, int]] = {}
    nodes, _ = _size(types, root, sizes, 0)
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
        inner, length = description[1] if kind in (Nodetype.ARRAY, Nodetype.SEQUENCE) else (description, 1)
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
