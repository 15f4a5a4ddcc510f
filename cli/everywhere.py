"""Options that every command has, before it or behind it: added in one place; --quiet and --trust are two."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Iterable, Sequence
from contextvars import ContextVar
from dataclasses import dataclass
from typing import Annotated, Any, get_type_hints

import typer

from gpsim.trust import consent, trust_data

Path = tuple[str, ...]
"""Where a command stands: ("run", "full-loop"); () is gpsim itself."""


@dataclass(frozen=True)
class Flag:
    """A flag of every command. annotation: as Typer reads it; heard(path): called where it was given.

    begins(path): called when a command, or a group above it, begins, whether the flag was given or not.
    """

    name: str
    annotation: Any
    heard: Callable[[Path], None]
    begins: Callable[[Path], None] = lambda path: None


QUIET: ContextVar[bool] = ContextVar("quiet", default=False)
"""Whether `--quiet` was given: progress and notes are left out, results and errors are not."""


def add_everywhere(app: typer.Typer, flags: Sequence[Flag], path: Path = ()) -> None:
    """Give the flags to every command and every group of an app, at any depth."""
    if app.registered_callback is not None and app.registered_callback.callback is not None:
        app.registered_callback.callback = _with(app.registered_callback.callback, flags, path)
    for command in app.registered_commands:
        if command.callback is not None:
            command.callback = _with(command.callback, flags, (*path, str(command.name)))
    for group in app.registered_groups:
        if group.typer_instance is not None:
            add_everywhere(group.typer_instance, flags, (*path, str(group.name)))


def _with(function: Callable[..., Any], flags: Sequence[Flag], path: Path) -> Callable[..., Any]:
    """The same function with a keyword more a flag, which Typer reads from its signature."""

    @functools.wraps(function)
    def heard(*arguments: Any, **named: Any) -> Any:
        for flag in flags:
            if named.pop(flag.name, False):
                flag.heard(path)
            flag.begins(path)
        return function(*arguments, **named)

    hints = get_type_hints(function, include_extras=True) | {flag.name: flag.annotation for flag in flags}
    signature = inspect.signature(function)
    known = [p.replace(annotation=hints.get(name, p.annotation)) for name, p in signature.parameters.items()]
    kind = inspect.Parameter.KEYWORD_ONLY
    more = [inspect.Parameter(flag.name, kind, default=False, annotation=flag.annotation) for flag in flags]
    heard.__signature__ = signature.replace(parameters=[*known, *more])  # type: ignore[attr-defined]
    heard.__annotations__ = hints
    del heard.__wrapped__  # whoever asks for the signature gets this one
    return heard


QUIET_NAME = "quiet"
Quiet = Annotated[
    bool, typer.Option("--quiet", "-q", help="No progress and no notes on stderr, only results and errors.")
]


def _hush(path: Path) -> None:
    QUIET.set(True)


QUIETLY = Flag(QUIET_NAME, Quiet, _hush)


Trust = Annotated[
    bool,
    typer.Option(
        "--trust", help="Allow the Python files and modules named in recordings, mappings and diagnoses."
    ),
]
NAMING = ("system", "model")
"""Words about a raw log that name a simulator."""


TRUSTINGLY = Flag("trust", Trust, lambda path: trust_data())


def named(simulator: str | None, words: Iterable[str] = ()) -> None:
    """The user names this simulator, and those that the words about a raw log name."""
    consent(simulator)
    for word in words:
        key, _, value = word.partition("=")
        if key in NAMING:
            consent(value)


def named_effects(references: Iterable[str] | None) -> tuple[str, ...]:
    """The user names these files of effects."""
    if not references:
        return ()
    from gpsim.effects import consent_to  # it loads NumPy, which `--help` does not wait for

    given = tuple(references or ())
    for reference in given:
        consent_to(reference)
    return given
