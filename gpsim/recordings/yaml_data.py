"""YAML files of data, from strangers: plain values and nothing else, and every fault is one line.

What is read here is data (mappings, recording.yaml, metadata.yaml), no configuration: `${...}` is text like any other.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import yaml

from gpsim.errors import UsageError
from gpsim.files import regular_bytes, unreadable
from gpsim.recordings.values import one_line

MOST_BYTES = 16 << 20  # of a file; a recording of 10 000 episodes takes 1 MiB
MOST_REPEATED = 10_000  # values that aliases may add to those that are written
_TEXT, _MERGE = "tag:yaml.org,2002:str", "tag:yaml.org,2002:merge"
_PLAIN = {f"tag:yaml.org,2002:{kind}" for kind in ("null", "bool", "int", "float", "str", "seq", "map")}


class YamlError(Exception):
    """Text that is no plain YAML: one line that says where and why, without the file's name."""


class _Loader(yaml.SafeLoader):
    """Dates stay as they are written, as text: nothing here is a date, and JSON knows none."""

    yaml_implicit_resolvers = {  # noqa: RUF012 (as the base class does)
        first: [(tag, pattern) for tag, pattern in found if not tag.endswith(":timestamp")]
        for first, found in yaml.SafeLoader.yaml_implicit_resolvers.items()
    }


def read_yaml(path: Path, where: str = "") -> Any:
    """The plain values of a YAML file of data; UsageError (file, line, key) for everything else.

    where: what the message calls the file, if not by its path.
    """
    try:
        return parse_yaml(regular_bytes(path, MOST_BYTES).decode("utf-8"))
    except OSError as error:
        raise unreadable(path, error) from error
    except UnicodeDecodeError as error:
        raise UsageError(f"{where or path}: not readable as YAML: it is not UTF-8 text") from error
    except YamlError as error:
        raise UsageError(f"{where or path}: {error}") from error


def check_bounded(path: Path) -> None:
    """Raise UsageError where a file that another parser will read stands for far more than is written in it.

    Its aliases repeat more than 10 000 values, it is nested too deeply, large, or no file. Other faults are that
    parser's to tell.
    """
    try:
        _made(regular_bytes(path, MOST_BYTES), plain=False)
    except YamlError as error:
        raise UsageError(f"{path}: {error}") from error
    except OSError as error:
        raise unreadable(path, error) from error
    except (RecursionError, MemoryError) as error:
        raise UsageError(f"{path}: not readable as YAML: it is nested too deeply") from error
    except (yaml.YAMLError, ValueError):
        return


def parse_yaml(text: str) -> Any:
    """Plain values: nothing, true, numbers, texts, lists and tables whose keys are distinct texts.

    Raises YamlError where a key is written twice, a value is of another kind, an alias contains itself, or aliases
    repeat more than 10 000 values (a few lines could stand for billions).
    """
    try:
        return _made(text, plain=True)
    except yaml.MarkedYAMLError as error:
        what = one_line(" ".join(filter(None, (error.context, error.problem))), 160)
        raise YamlError(f"{_line(error.problem_mark)}not readable as YAML: {what}") from error
    except (yaml.YAMLError, ValueError, OverflowError) as error:
        raise YamlError(f"not readable as YAML: {one_line(error, 160)}") from error
    except (RecursionError, MemoryError) as error:
        raise YamlError("not readable as YAML: it is nested too deeply") from error


def _made(text: str | bytes, *, plain: bool) -> Any:
    """What a document holds, after a look at its nodes; plain: of plain values alone, each key once."""
    loader = _Loader(text)
    try:
        node = loader.get_single_node()
        if node is None:
            return None
        _size(node, plain, {})
        return loader.construct_document(node) if plain else None
    finally:
        loader.dispose()


def _line(mark: Any) -> str:
    return "" if mark is None else f"line {mark.line + 1}: "


def _size(node: yaml.Node, plain: bool, sizes: dict[int, int]) -> int:
    """How many values a node stands for, with what aliases repeat; sizes: of the nodes seen, which were written once.

    Those that are still looked into have size 0.
    """
    where = _line(node.start_mark)
    if id(node) in sizes:
        if not sizes[id(node)]:
            raise YamlError(f"{where}an alias (*name) contains itself")
        return sizes[id(node)]
    sizes[id(node)] = 0
    if plain and node.tag not in _PLAIN:
        raise YamlError(f"{where}{one_line(node.tag, 60)} is not a plain value; use text, numbers, lists")
    total = 1 + sum(_size(part, plain, sizes) for part in _parts(node, plain))
    if total - len(sizes) > MOST_REPEATED:
        raise YamlError(f"{where}aliases (*name) expand to more than {MOST_REPEATED} values; write them out")
    sizes[id(node)] = total
    return total


def _parts(node: yaml.Node, plain: bool) -> Iterator[yaml.Node]:
    """The nodes inside a node; YamlError where a key is no plain word or number, or is written twice.

    Keys become text as they are written: a channel may be called `on`, or 1.
    """
    if not isinstance(node, yaml.MappingNode):
        yield from node.value if isinstance(node, yaml.SequenceNode) else ()
        return
    lines: dict[str, int] = {}
    for place, (key, value) in enumerate(node.value):
        where = _line(key.start_mark)
        if plain:
            if key.tag == _MERGE:
                raise YamlError(f"{where}the key << takes in another table; write its keys out")
            if not isinstance(key, yaml.ScalarNode):
                raise YamlError(f"{where}a list or a table cannot be a key")
            if key.value in lines:
                first = lines[key.value]
                raise YamlError(f"{where}duplicate key '{one_line(key.value, 60)}', already in line {first}")
            lines[key.value] = key.start_mark.line + 1
            key = yaml.ScalarNode(_TEXT, key.value)
            node.value[place] = (key, value)
        yield key
        yield value
