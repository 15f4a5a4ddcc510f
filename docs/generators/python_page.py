"""docs/reference/python.md from the docstrings of what `import gpsim` offers."""

from __future__ import annotations

import dataclasses
import inspect
import re
import textwrap
from collections.abc import Iterator
from types import ModuleType
from typing import Any

import gpsim
from gpsim.recordings import Episode

HEAD = """# Python

Made by `python docs/generate.py` from the docstrings; a test holds it current and runs every example.

    import gpsim

loads nothing else: each name comes with what it needs when it is first asked for. What is listed here is public and
keeps its meaning within a major version (semantic versioning); whatever begins with an underscore, or is not listed,
may change with any release. Bad input of any kind raises `gpsim.UsageError` with one line: what, where, what to do.
A walk through all of it is the [tutorial](../tutorial/python.md).

Shapes: B episodes or rows of a batch, T steps, S state channels, A action channels, in the channels' order and units.
"""
GROUPS = {
    "Recordings and simulators": ("read_recording", "recording_from_frame", "Recording", "load_simulator"),
    "Diagnosis": ("diagnose", "Diagnosis", "Settings", "effects"),
    "Corrected simulators": ("CorrectedSimulator", "fit_gp", "evaluate", "Evaluation", "make_env"),
    "The next recording, and later ones": ("plan", "Watcher"),
    "Errors": ("UsageError", "errors"),
}
WIDEST = 100  # columns of a call on one line
CALLED = {"CorrectedSimulator": "corrected"}
"""What an object of a class is called in the calls of its methods; else as the class, in small letters."""
SECTIONS = ("Args", "Attributes", "Returns", "Raises", "Example")
ENVIRONMENTS = """### Environments by name

After `import gpsim`, before or after `import gymnasium`:

| id | what | keywords |
|---|---|---|
"""


def page() -> str:
    """The whole page."""
    lines = [HEAD]
    for title, names in GROUPS.items():
        lines += [f"## {title}", ""]
        for name in names:
            lines += [*_entry(name, getattr(gpsim, name)), ""]
        if "make_env" in names:
            lines += [_environments(), ""]
    return "\n".join(lines).rstrip() + "\n"


def members(cls: type[Any]) -> Iterator[tuple[str, Any]]:
    """Public methods and properties that a class of gpsim declares, in order."""
    for name, value in vars(cls).items():
        if name.startswith("_") or not (callable(value) or isinstance(value, property | classmethod)):
            continue
        if isinstance(value, type):
            continue
        yield name, value


def _entry(name: str, thing: Any) -> list[str]:
    if isinstance(thing, ModuleType):
        return [f"### `gpsim.{name}`", "", *_prose(thing), *(_families() if name == "effects" else [])]
    lines = [f"### `gpsim.{name}`", "", *_signature(f"gpsim.{name}", thing), *_prose(thing)]
    if name == "Recording":
        lines += ["", *(f"- `{f.name}`: `{f.type}`" for f in dataclasses.fields(thing))]
        lines += [
            "",
            "An episode has:",
            "",
            *(f"- `{f.name}`: `{f.type}`" for f in dataclasses.fields(Episode)),
        ]
        lines += ["", *_prose(Episode)]
    if isinstance(thing, type) and name != "Settings":
        for member, value in members(thing):
            lines += ["", *_member(name, member, value)]
    if name == "Settings":
        lines += ["", "Every setting is in [settings.md](settings.md)."]
    return lines


def _families() -> list[str]:
    lines = ["", "`gpsim.effects.FAMILIES` is the catalogue, family: effect:", ""]
    for family, effect in gpsim.effects.FAMILIES.items():
        first = (inspect.getdoc(type(effect)) or "").splitlines()[0]
        lines.append(f"- `{family}`: {first}")
    return lines


def _member(owner: str, name: str, value: Any) -> list[str]:
    lead = owner if isinstance(value, classmethod) else CALLED.get(owner, owner.lower())
    if isinstance(value, property):
        return [f"#### `{owner}.{name}`", "", *_prose(value)]
    function = value.__func__ if isinstance(value, classmethod) else value
    return [
        f"#### `{owner}.{name}`",
        "",
        *_signature(f"{lead}.{name}", function, bound=True),
        *_prose(function),
    ]


class _Written:
    """An annotation as its file has it."""

    def __init__(self, text: str) -> None:
        self.text = text

    def __repr__(self) -> str:
        return self.text


def _signature(name: str, thing: Any, bound: bool = False) -> list[str]:
    """A code block with the call; of a class that nobody makes by hand, none."""
    if isinstance(thing, type):
        return []
    signature = inspect.signature(thing)
    parameters = [
        p.replace(annotation=_Written(p.annotation))
        for p in list(signature.parameters.values())[1 if bound else 0 :]
    ]
    answer = _Written(signature.return_annotation)
    text = f"{name}{signature.replace(parameters=parameters, return_annotation=answer)}"
    if len(text) > WIDEST:
        inner = [f"    {p}," for p in parameters]
        first = next((i for i, p in enumerate(parameters) if p.kind is p.KEYWORD_ONLY), None)
        if first is not None:
            inner.insert(first, "    *,")
        text = "\n".join([f"{name}(", *inner, f") -> {answer}"])
    return ["```python", text, "```", ""]


def _prose(thing: Any) -> list[str]:
    """A docstring: its sections as lists and code."""
    lines: list[str] = []
    for title, body in _sections(inspect.getdoc(thing) or ""):
        if title == "Example":
            code = [line for line in body if line.strip()]
            lines += ["```python", *textwrap.dedent("\n".join(code)).splitlines(), "```"]
        elif title in ("Args", "Attributes"):
            lines += [f"- `{name}`: {text}" for name, text in _items(body)]
        elif title is not None:
            said = " ".join(" ".join(body).split())
            lines.append(
                f"{title}: {said}" if title == "Returns" else f"Raises `{said.replace(':', '`:', 1)}"
            )
        else:
            lines += body
        lines.append("")
    return lines[:-1] if lines else lines


def _sections(text: str) -> Iterator[tuple[str | None, list[str]]]:
    title: str | None = None
    body: list[str] = []
    for line in text.splitlines():
        if line.rstrip(":") in SECTIONS and line.endswith(":"):
            if any(part.strip() for part in body):
                yield title, _trimmed(body)
            title, body = line.rstrip(":"), []
        else:
            body.append(line)
    if any(part.strip() for part in body):
        yield title, _trimmed(body)


def _trimmed(body: list[str]) -> list[str]:
    return "\n".join(body).strip("\n").splitlines()


def _items(body: list[str]) -> list[tuple[str, str]]:
    """Name and text of the entries of a section; what is indented further goes on."""
    found: list[tuple[str, str]] = []
    for line in textwrap.dedent("\n".join(body)).splitlines():
        start = re.match(r"(\w+): (.*)", line)
        if start:
            found.append((start[1], start[2]))
        elif found:
            found[-1] = (found[-1][0], f"{found[-1][1]} {line.strip()}")
    return found


def _environments() -> str:
    from gpsim.api import environment
    from gpsim.api.registration import ENVIRONMENTS as IDS

    rows = []
    for name, entry in IDS.items():
        function = getattr(environment, entry.partition(":")[2])
        told = " ".join((inspect.getdoc(function) or "").partition(":")[2].split())
        what, _, keywords = told.partition(". ") if ". " in told else told.partition("; ")
        rows.append(f"| `{name}` | {what.rstrip('.')} | {keywords} |")
    return ENVIRONMENTS + "\n".join(rows)
