"""A room's door: the names that its `__init__` imports `if TYPE_CHECKING` load when they are first asked for."""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any


def opened(room: str) -> Callable[[str], Any]:
    """The `__getattr__` of a room (PEP 562): who takes one name of it waits for no other, nor for what these need."""

    def asked(name: str) -> Any:
        place = places(room).get(name)
        if place is None:
            raise AttributeError(f"module {room!r} has no attribute {name!r}")
        module = import_module(place)
        value = module if place == f"{room}.{name}" else getattr(module, name)
        setattr(sys.modules[room], name, value)
        return value

    return asked


@cache
def places(room: str) -> dict[str, str]:
    """Name -> the module that has it, or is it."""
    import ast  # here: `import gpsim` asks nothing of it

    tree = ast.parse(Path(str(sys.modules[room].__file__)).read_text(encoding="utf-8"))
    imports = [node for block in tree.body if isinstance(block, ast.If) for node in block.body]
    return {
        alias.name: f"{room}.{alias.name}" if node.module == room else str(node.module)
        for node in imports
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
