"""The files that a model is made of, looked at before MuJoCo opens any of them: what they are, and how much they make.

MuJoCo waits for ever at a pipe, reads a device until memory is full, and makes as many bodies as <replicate> asks for.
XML is read as leniently as MuJoCo reads it, in bounded time and memory: its parser takes comments with `--` in them and
knows no entities of a document's own; the standard library's refuses the former and expands the latter. What is counted
here must be what MuJoCo will see. And why a model does not compile, in one line: file, line and reason.
"""

from __future__ import annotations

import html
import math
import re
import stat
import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from gpsim.errors import UsageError
from gpsim.limits import MODEL_ASSETS, MODEL_BYTES, MODEL_ELEMENTS, MODEL_NUMBERS, allowed, more
from gpsim.mjcf.urdf import mesh_file, mesh_places

MODEL_FILES = (".xml", ".mjcf", ".urdf")
DIRECTORIES = ("meshdir", "texturedir", "assetdir")
REPEATS = dict.fromkeys(("replicate", "composite", "flexcomp"), ("count",))
"""Elements that MuJoCo makes many of, and the attribute whose numbers multiply."""
ROOM = {"texture": ("width", "height"), "hfield": ("nrow", "ncol"), "numeric": ("size",), "user": ("dim",)}
"""Elements that ask for room, and the attributes that multiply."""
INCLUDED = 50  # files within each other
PNG, PIXELS = b"\x89PNG\r\n\x1a\n", slice(16, 24)
_NAME = r"[^\s/>=<\"']++"
_ATTRIBUTE = rf"\s*+({_NAME})\s*+=\s*+(?:\"([^\"]*+)\"|'([^']*+)')"
_TOKEN = re.compile(
    r"<!--(?s:.*?)-->|<!\[CDATA\[(?s:.*?)\]\]>|<\?(?s:.*?)\?>|(?P<declared><![^>]*+>)"
    rf"|</\s*+(?P<closed>{_NAME})[^>]*+>"
    rf"|<(?P<name>{_NAME})(?P<attributes>(?:{_ATTRIBUTE.replace('(' + _NAME, '(?:' + _NAME)})*+)\s*+(?P<empty>/?+)>"
)
_ATTRIBUTES = re.compile(_ATTRIBUTE)
DEEPEST = 500  # as MuJoCo's parser
_ENTITY = re.compile(r"<!\s*(ENTITY|DOCTYPE[^>]*\[)")
MOST = 240  # characters of what somebody else says
_LINE = re.compile(r"(?:, *line |Line number=)(\d+)")
_UNCLOSED = re.compile(r"XML_ERROR_MISMATCHED_ELEMENT.*?XMLElement name=(\w+)")
_NOISE = re.compile(
    r"(XML )?Error: |XML parse error \d+: |Schema violation: |ErrorID=\S+ \(\w+\)|XMLElement name=\w+"
)
_OF = re.compile(r" ?Element name '([^']*)'(?:, id \d+)?| ?Element '([^']*)'")


class XmlError(Exception):
    """What is no XML that a model may be made of: where, and why."""

    def __init__(self, line: int, reason: str) -> None:
        super().__init__(reason)
        self.line, self.reason = line, reason


@dataclass(frozen=True)
class Element:
    """An element where it begins: its tag, its attributes and its line."""

    tag: str
    attributes: Mapping[str, str]
    line: int
    empty: bool


def elements(text: str) -> Iterator[Element | None]:
    """Every element where it begins, and None where one ends that is not empty; raises XmlError.

    What is closed by another's name is MuJoCo's to refuse, which looks at that before anything else: it ends here.
    """
    above: list[str] = []
    position, line = 0, 1
    while (start := text.find("<", position)) >= 0:
        line += text.count("\n", position, start)
        token = _TOKEN.match(text, start)
        if token is None:
            raise XmlError(line, "it is no XML: a < that begins no tag")
        declared = token["declared"]
        if declared is not None and _ENTITY.match(declared):
            raise XmlError(line, "it declares XML entities, which are not allowed; write out their content")
        if token["closed"] is not None:
            if not above or above.pop() != token["closed"]:
                return
            yield None
        elif (tag := token["name"]) is not None:
            pairs = _ATTRIBUTES.finditer(token["attributes"])
            attributes = {m[1]: html.unescape(m[2] if m[2] is not None else m[3]) for m in pairs}
            yield Element(tag, attributes, line, bool(token["empty"]))
            if not token["empty"]:
                above.append(tag)
            if len(above) > DEEPEST:
                raise XmlError(line, f"its elements are nested more than {DEEPEST} deep")
        line += token[0].count("\n")
        position = token.end()


@dataclass
class Census:
    """What has been met of a model so far: its files, and how much it makes.

    attached: how often the model that is being read attaches another; models: of every other one how many elements it
    makes; open: the files in the middle of which this is. Reading a file again counts as reading another: `read`.
    """

    main: Path
    files: dict[Path, None] = field(default_factory=dict)
    named: list[tuple[Path, str]] = field(default_factory=list)
    directories: list[str] = field(default_factory=list)
    made: int = 0
    numbers: int = 0
    read: int = 0
    attached: int = 0
    models: dict[Path, int] = field(default_factory=dict)
    open: tuple[Path, ...] = ()


def files_of_model(path: Path) -> tuple[Path, ...]:
    """A model's file and all that it names, as far as it is there; raises UsageError for what is not to be opened."""
    main = path.resolve()
    census = Census(main)
    _take_model(census, main)
    heavy = 0
    for by, name in dict.fromkeys(census.named):
        folders = (by.parent, main.parent)
        places = [p for f in folders for p in (f, *(f / d for d in dict.fromkeys(census.directories)))]
        for candidate in (c for place in places for c in mesh_places(name, place)):
            _check_ordinary(candidate, by)
        found = next((f for p in places if (f := mesh_file(name, p)) is not None), None)
        if found is not None and found not in census.files:
            census.files[found] = None
            heavy += _weight(found)
            if heavy > allowed(MODEL_ASSETS):
                raise UsageError(
                    f"{path}: its meshes and pictures take {heavy} bytes, the limit is {allowed(MODEL_ASSETS)}; "
                    f"{more(heavy, MODEL_ASSETS)}"
                )
    return tuple(census.files)


def _take_model(census: Census, path: Path) -> None:
    """Count what a whole model makes, with what it attaches."""
    if path in census.models:
        return
    before, attached, census.attached = census.made, census.attached, 0
    _take(census, path, 1)
    # Which of the models an <attach> means, only MuJoCo knows; they may stand behind it.
    census.made += census.attached * max(census.models.values(), default=0)
    _check_made(census, str(path))
    census.attached, census.models[path] = attached, census.made - before


def _check_made(census: Census, where: str) -> None:
    if census.made > (limit := allowed(MODEL_ELEMENTS)):
        raise UsageError(f"{where} and the elements before it make more than {limit} elements; {more()}")


def _take(census: Census, path: Path, times: int) -> None:
    """Count what a file with all that it includes makes, `times` over."""
    if path in census.open:
        return  # MuJoCo refuses it
    if len(census.open) > INCLUDED:
        raise UsageError(f"{path}: included files are nested more than {INCLUDED} deep; merge them")
    census.files[path] = None
    census.open = (*census.open, path)
    multiples = [times]
    try:
        for element in elements(_text(census, path)):
            if element is None:
                multiples.pop()
                continue
            times = multiples[-1] * _product(element, REPEATS.get(element.tag, ()))
            if not element.empty:
                multiples.append(times)
            _count(census, path, element, times)
    except XmlError as fault:
        raise UsageError(f"{path}, line {fault.line}: does not compile: {fault.reason}") from fault
    census.open = census.open[:-1]


def _count(census: Census, path: Path, element: Element, times: int) -> None:
    census.made += times
    census.attached += times if element.tag == "attach" else 0
    census.numbers += times * _room(element)
    where = f"{path}, line {element.line}: <{one_line(element.tag)}>"
    _check_made(census, where)
    if census.numbers > allowed(MODEL_NUMBERS):
        raise UsageError(
            f"{where} needs space for {census.numbers:.3g} numbers, the limit is {allowed(MODEL_NUMBERS)}; "
            f"{more(census.numbers, MODEL_NUMBERS)}"
        )
    census.directories += [element.attributes[d] for d in DIRECTORIES if element.attributes.get(d)]
    for key, name in element.attributes.items():
        if not key.startswith("file") or not name:
            continue
        inner = None
        if element.tag in ("include", "model"):
            for candidate in (path.parent / name, census.main.parent / name):
                _check_ordinary(candidate, path)
                if candidate.is_file():
                    inner = candidate.resolve()
                    break
        if inner is None:
            census.named.append((path, name))
        elif element.tag == "include":
            _take(census, inner, times)
        else:
            _take_model(census, inner)


def _check_ordinary(path: Path, by: Path) -> None:
    """Refuse what is there and is no file of bytes: opening a pipe or a device may never end."""
    try:
        kind = path.stat().st_mode
    except (OSError, ValueError):
        return  # it is not there: MuJoCo says so
    if not stat.S_ISREG(kind) and not stat.S_ISDIR(kind):
        raise UsageError(
            f"{by}: names {one_line(path)}, which is not a regular file; name a file of the model"
        )


def _text(census: Census, path: Path) -> str:
    """A file's text; the bytes that all of them take are bounded."""
    limit = allowed(MODEL_BYTES)
    try:
        with path.open("rb") as file:
            raw = file.read(limit - census.read + 1)
    except OSError as error:
        raise UsageError(f"{path}: cannot be read ({error.strerror or error}); make it readable") from error
    census.read += len(raw)
    if census.read > limit:
        raise UsageError(f"{path}: the XML of a model has at most {limit} bytes, this has more; {more()}")
    return raw.decode("utf-8", errors="replace")


def _room(element: Element) -> int:
    """How many numbers an element asks room for, beside what every element takes."""
    if element.tag == "size":
        return sum(_product(element, (key,)) for key in element.attributes if key.startswith("n"))
    asked = _product(element, ROOM[element.tag]) if element.tag in ROOM else 0
    if element.attributes.get("builtin") and element.tag == "mesh":
        asked += _product(element, ("params",))
    return asked + (_product(element, ("nsample",)) if "nsample" in element.attributes else 0)


def _product(element: Element, keys: tuple[str, ...]) -> int:
    """The product of the numbers in some attributes, 1 where there are none; MuJoCo refuses what is no number."""
    product = 1.0
    for word in (word for key in keys for word in element.attributes.get(key, "").split()):
        try:
            product *= max(1.0, float(word))
        except ValueError:
            continue
    return int(product) if math.isfinite(product) else 1 << 62


def _weight(path: Path) -> int:
    """Bytes that a file of a mesh or picture makes, about."""
    try:
        size = path.stat().st_size
        with path.open("rb") as file:
            head = file.read(PIXELS.stop)
    except OSError:
        return 0  # MuJoCo says why
    if head.startswith(PNG) and len(head) == PIXELS.stop:
        width, height = struct.unpack(">II", head[PIXELS])
        return max(size, 4 * int(width) * int(height))
    return size


def compile_fault(path: Path, error: BaseException) -> UsageError:
    """A fault of an XML: MuJoCo's own words, behind the line that they are about."""
    said = one_line(error)
    number = int(found[1]) if (found := _LINE.search(said)) else _line_of(path, said)
    at = f"{path}, line {number}" if number else str(path)
    if (unclosed := _UNCLOSED.search(said)) is not None:
        return UsageError(f"{at}: does not compile: <{unclosed[1]}> is not closed, or by another's name")
    of = _OF.search(said)
    place = "" if of is None else f" (in '{of[1]}')" if of[1] else f" (in <{of[2]}>)" if of[2] else ""
    short = " ".join(_NOISE.sub("", _LINE.sub("", _OF.sub("", said))).split()).strip(" ,")
    return UsageError(f"{at}: does not compile: {short}{place}")


def one_line(said: object) -> str:
    """One printable line of what MuJoCo, a file or somebody's code says, which may be several."""
    flat = " ".join(str(said).split())[:MOST]
    return "".join(c if c.isprintable() else "?" for c in flat)


def _line_of(path: Path, said: str) -> int:
    """The line that holds what the message quotes, 0 where it quotes nothing of the file."""
    quoted = [word for word in re.findall(r"'([^']*)'", said) if word]
    sought = [f'"{word}"' for word in quoted] or (["<key "] if "keyframe" in said else [])
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError):
        return 0
    return next((n for n, line in enumerate(lines, 1) if any(word in line for word in sought)), 0)
