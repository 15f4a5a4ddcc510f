"""The files that a model is made of, looked at before MuJoCo opens any of them: what they are, and how much they make.

MuJoCo waits for ever at a pipe, reads a device until memory is full, and makes as many bodies as <replicate> asks for.
"""

from __future__ import annotations

import math
import stat
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from gpsim.errors import UsageError
from gpsim.limits import MODEL_ASSETS, MODEL_BYTES, MODEL_ELEMENTS, MODEL_NUMBERS, allowed, more
from gpsim.mjcf.faults import one_line
from gpsim.mjcf.urdf import mesh_file, mesh_places
from gpsim.mjcf.xml_elements import Element, XmlError, elements

MODEL_FILES = (".xml", ".mjcf", ".urdf")
DIRECTORIES = ("meshdir", "texturedir", "assetdir")
REPEATS = {"replicate": ("count",), "composite": ("count",), "flexcomp": ("count",)}
"""Elements that MuJoCo makes many of, and the attribute whose numbers multiply."""
ROOM = {"texture": ("width", "height"), "hfield": ("nrow", "ncol"), "numeric": ("size",), "user": ("dim",)}
"""Elements that ask for room, and the attributes that multiply."""
INCLUDED = 50  # files within each other
PNG, PIXELS = b"\x89PNG\r\n\x1a\n", slice(16, 24)


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
        for place in _places(census, by):
            for candidate in mesh_places(name, place):
                _check_ordinary(candidate, by)
        found = next((f for p in _places(census, by) if (f := mesh_file(name, p)) is not None), None)
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
    census.attached = attached
    census.models[path] = census.made - before


def _take(census: Census, path: Path, times: int) -> None:
    """Count what a file with all that it includes makes, `times` over."""
    if path in census.open:
        return  # MuJoCo refuses it
    if len(census.open) > INCLUDED:
        raise UsageError(
            f"{path}: files that include each other are more than {INCLUDED} deep; put them in one"
        )
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


def _check_made(census: Census, where: str) -> None:
    limit = allowed(MODEL_ELEMENTS)
    if census.made > limit:
        raise UsageError(f"{where} and what is before it make more than {limit} elements; {more()}")


def _count(census: Census, path: Path, element: Element, times: int) -> None:
    census.made += times
    census.attached += times if element.tag == "attach" else 0
    census.numbers += times * _room(element)
    where = f"{path}, line {element.line}"
    _check_made(census, f"{where}: <{one_line(element.tag)}>")
    if census.numbers > allowed(MODEL_NUMBERS):
        raise UsageError(
            f"{where}: <{one_line(element.tag)}> asks for room for {census.numbers:.3g} numbers, the limit is "
            f"{allowed(MODEL_NUMBERS)}; {more(census.numbers, MODEL_NUMBERS)}"
        )
    census.directories += [element.attributes[d] for d in DIRECTORIES if element.attributes.get(d)]
    for key, name in element.attributes.items():
        if not key.startswith("file") or not name:
            continue
        inner = _model_file(census, path, name) if element.tag in ("include", "model") else None
        if inner is None:
            census.named.append((path, name))
        elif element.tag == "include":
            _take(census, inner, times)
        else:
            _take_model(census, inner)


def _model_file(census: Census, path: Path, name: str) -> Path | None:
    """The XML file that another one names; None where it is not there."""
    for place in (path.parent, census.main.parent):
        candidate = place / name
        _check_ordinary(candidate, path)
        if candidate.is_file():
            return candidate.resolve()
    return None


def _places(census: Census, by: Path) -> Iterator[Path]:
    """Folders in which a file that `by` names may lie."""
    for folder in dict.fromkeys((by.parent, census.main.parent)):
        yield folder
        yield from (folder / name for name in dict.fromkeys(census.directories))


def _check_ordinary(path: Path, by: Path) -> None:
    """Refuse what is there and is no file of bytes: opening a pipe or a device may never end."""
    try:
        kind = path.stat().st_mode
    except (OSError, ValueError):
        return  # it is not there: MuJoCo says so
    if not stat.S_ISREG(kind) and not stat.S_ISDIR(kind):
        raise UsageError(
            f"{by}: names {one_line(path)}, which is no ordinary file; name a file of the model's"
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
        keys = [key for key in element.attributes if key.startswith("n")]
        return sum(_product(element, (key,)) for key in keys)
    asked = _product(element, ROOM[element.tag]) if element.tag in ROOM else 0
    shape = (
        _product(element, ("params",)) if element.attributes.get("builtin") and element.tag == "mesh" else 0
    )
    return asked + shape + (_product(element, ("nsample",)) if "nsample" in element.attributes else 0)


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
