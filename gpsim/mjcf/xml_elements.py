"""The elements of an XML file one by one, read as leniently as MuJoCo reads them and in bounded time and memory.

MuJoCo's parser takes comments with `--` in them and knows no entities of a document's own; the standard library's
refuses the former and expands the latter. What is counted here must be what MuJoCo will see.
"""

from __future__ import annotations

import html
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

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


class XmlError(Exception):
    """What is no XML that a model may be made of: where, and why."""

    def __init__(self, line: int, reason: str) -> None:
        super().__init__(reason)
        self.line, self.reason = line, reason


@dataclass(frozen=True)
class Element:
    """An element where it begins: its tag, its attributes, the tags around it, the outermost first, and its line."""

    tag: str
    attributes: Mapping[str, str]
    above: tuple[str, ...]
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
            raise XmlError(
                line, "it declares entities, which a model has no use for; write out what they stand for"
            )
        if token["closed"] is not None:
            if not above or above.pop() != token["closed"]:
                return
            yield None
        elif (tag := token["name"]) is not None:
            yield Element(tag, _attributes(token["attributes"]), tuple(above), line, bool(token["empty"]))
            if not token["empty"]:
                above.append(tag)
            if len(above) > DEEPEST:
                raise XmlError(line, f"its elements are nested more than {DEEPEST} deep")
        line += token[0].count("\n")
        position = token.end()


def _attributes(text: str) -> dict[str, str]:
    return {m[1]: html.unescape(m[2] if m[2] is not None else m[3]) for m in _ATTRIBUTES.finditer(text)}
