"""From decoded messages to rows of numbers: one compiled getter a stream, float64 columns in blocks."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Sequence
from itertools import chain
from operator import attrgetter
from typing import Any

import numpy as np

from gpsim.channels import FloatArray, IntArray
from gpsim.recordings.readers.definitions import Decoder
from gpsim.recordings.readers.fields import Named, Path, Selection, parse_path, stamp_path

BLOCK = 4096
NAN = float("nan")
NO_STAMP = -(2**63)
Row = Sequence[Any]
Rows = Callable[[Any], Sequence[Row]]


class Columns:
    """Grows as rows come: receive time [ns], stamp [ns] and values, each in one flat array.

    Python objects live for one block of 4096 rows only. The arrays grow in place (array.array, which reallocates by
    a sixteenth), so that a column's memory is 8 bytes a value, with no second copy at the end.
    """

    def __init__(self, names: tuple[str, ...]) -> None:
        self.names = names
        self.absent: dict[str, int] = {}
        self._receive: list[int] = []
        self._rows: list[Row] = []
        self._times = (array("q"), array("q"))
        self._values = [array("d") for _ in names]

    def append(self, receive: int, row: Row) -> None:
        """Add one row: the values in the order of `names`, then the stamp's seconds and nanoseconds."""
        self._receive.append(receive)
        self._rows.append(row)
        if len(self._rows) >= BLOCK:
            self._flush()

    def _flush(self) -> None:
        width = len(self.names) + 2
        flat = np.fromiter(chain.from_iterable(self._rows), dtype=np.float64, count=len(self._rows) * width)
        *columns, seconds, nanoseconds = flat.reshape(-1, width).T
        known = np.isfinite(seconds)
        stamp = np.full(len(known), NO_STAMP, dtype=np.int64)
        stamp[known] = seconds[known].astype(np.int64) * 10**9 + nanoseconds[known].astype(np.int64)
        self._times[0].extend(self._receive)
        self._times[1].frombytes(stamp.tobytes())
        for kept, column in zip(self._values, columns, strict=True):
            kept.frombytes(column.tobytes())
        self._receive.clear()
        self._rows.clear()

    def receive_ns(self) -> IntArray:
        """(N,) receive times [ns]."""
        self._flush()
        return np.frombuffer(self._times[0], dtype=np.int64)

    def stamp_ns(self) -> IntArray:
        """(N,) header stamps [ns]; NO_STAMP where a message has none."""
        self._flush()
        return np.frombuffer(self._times[1], dtype=np.int64)

    def values(self) -> dict[str, FloatArray]:
        """Field to (N,) values. No row may come after it."""
        self._flush()
        return {
            name: np.frombuffer(kept, dtype=np.float64)
            for name, kept in zip(self.names, self._values, strict=True)
        }


def row_maker(decoder: Decoder, wanted: Sequence[str], absent: dict[str, int]) -> Rows:
    """A function from message to rows (values in the order of `wanted`, stamp seconds, stamp nanoseconds).

    absent counts, by field, the rows whose message has no such element. Raises PathError.
    """
    paths = [parse_path(text, decoder.types, decoder.name) for text in wanted]
    selections = list(dict.fromkeys(path.selection for path in paths))
    stamp = stamp_path(decoder.types, decoder.name)
    if selections == [None] and stamp and all(isinstance(s, str) for p in paths for s in p.steps):
        prefix = ".".join(stamp)
        get = attrgetter(*(".".join(map(str, p.steps)) for p in paths), f"{prefix}.sec", f"{prefix}.nanosec")
        return lambda message: (get(message),)
    makers = [_group(selection, paths, decoder, absent) for selection in selections]
    if len(makers) == 1:
        return makers[0]
    return lambda message: [row for maker in makers for row in maker(message)]


def _group(selection: Selection | None, paths: list[Path], decoder: Decoder, absent: dict[str, int]) -> Rows:
    """Rows of the paths that share a selection; the others' columns are absent in them."""
    getters = [_getter(p, absent) if p.selection == selection else _never(p, absent) for p in paths]
    own = stamp_path(decoder.types, decoder.name)
    outer = _stamp(own)
    if selection is None:
        return lambda message: ([*(get(message) for get in getters), *outer(message)],)
    chosen = _stamp(stamp_path(decoder.types, selection.element))
    has_own = stamp_path(decoder.types, selection.element) is not None
    elements = attrgetter(".".join(selection.array))
    keys = [(attrgetter(name), value) for name, value in selection.where]

    def rows(message: Any) -> list[Row]:
        return [
            [*(get(element) for get in getters), *(chosen(element) if has_own else outer(message))]
            for element in elements(message)
            if all(str(get(element)) == value for get, value in keys)
        ]

    return rows


def _stamp(path: tuple[str, ...] | None) -> Callable[[Any], tuple[float, float]]:
    if path is None:
        return lambda _: (NAN, NAN)
    get: Callable[[Any], tuple[float, float]] = attrgetter(
        f"{'.'.join(path)}.sec", f"{'.'.join(path)}.nanosec"
    )
    return get


def _getter(path: Path, absent: dict[str, int]) -> Callable[[Any], float]:
    """Follow attributes and indices; an index beyond the array's end, or a name not there, is NaN and counted."""
    steps: list[Callable[[Any], Any]] = []
    names: list[str] = []
    for step in path.steps:
        if isinstance(step, str):
            names.append(step)
            continue
        if names:
            steps.append(attrgetter(".".join(names)))
            names = []
        steps.append(_at(step) if isinstance(step, int) else _beside(step))
    if names:
        steps.append(attrgetter(".".join(names)))
    if len(steps) == 1 and isinstance(steps[0], attrgetter):
        return steps[0]

    def get(value: Any) -> float:
        try:
            for step in steps:
                value = step(value)
        except (IndexError, ValueError):  # an array too short, a name that is not there
            absent[path.text] = absent.get(path.text, 0) + 1
            return NAN
        return float(value)

    return get


def _at(index: int) -> Callable[[Any], Any]:
    return lambda array: array[index]


def _beside(step: Named) -> Callable[[Any], Any]:
    """The number beside a name; where it is in the list is remembered as long as the list says the same."""
    array, names = attrgetter(step.array), attrgetter(step.names)
    place = 0

    def get(message: Any) -> Any:
        nonlocal place
        held = names(message)
        if place >= len(held) or held[place] != step.name:
            place = held.index(step.name)
        return array(message)[place]

    return get


def _never(path: Path, absent: dict[str, int]) -> Callable[[Any], float]:
    def get(_: Any) -> float:
        absent[path.text] = absent.get(path.text, 0) + 1
        return NAN

    return get


def seconds(nanoseconds: IntArray, epoch_ns: int) -> FloatArray:
    """Integer nanoseconds to seconds after the epoch; exact to 1 ns within 100 days of it."""
    return np.asarray((nanoseconds - epoch_ns) / 1e9, dtype=np.float64)
