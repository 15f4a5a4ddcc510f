"""Options that every command has, before it or behind it: --quiet, --json and --trust; and what the user names."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Iterable
from typing import Annotated, Any, get_type_hints

import typer

from gpsim.trust import consent, trust_data

from . import answers
from .answers import QUIET, CommandPath

FLAGS: dict[str, Any] = {
    "quiet": Annotated[
        bool,
        typer.Option("--quiet", "-q", help="No progress and no notes on stderr, only results and errors."),
    ],
    "as_json": Annotated[
        bool,
        typer.Option(
            answers.OPTION, help="One JSON object on stdout: paths, verdict, figures; the rest on stderr."
        ),
    ],
    "trust": Annotated[
        bool,
        typer.Option(
            "--trust", help="Allow the Python files and modules named in recordings, mappings and diagnoses."
        ),
    ],
}
NAMING = ("system", "model")
"""Words about a raw log that name a simulator."""


def add_everywhere(app: typer.Typer, path: CommandPath = ()) -> None:
    """Give the flags to every command and every group of an app, at any depth."""
    callback = app.registered_callback
    if callback is not None and callback.callback is not None:
        callback.callback = _with(callback.callback, path)
    for command in app.registered_commands:
        if command.callback is not None:
            command.callback = _with(command.callback, (*path, str(command.name)))
    for group in app.registered_groups:
        if group.typer_instance is not None:
            add_everywhere(group.typer_instance, (*path, str(group.name)))


def _with(function: Callable[..., Any], path: CommandPath) -> Callable[..., Any]:
    """The same function with a keyword more a flag, which Typer reads from its signature."""

    @functools.wraps(function)
    def heard(*arguments: Any, **named: Any) -> Any:
        quiet, as_json, trust = (named.pop(name, False) for name in FLAGS)
        if quiet:
            QUIET.set(True)
        if trust:
            trust_data()
        answers.heard(path, as_json)
        return function(*arguments, **named)

    hints = get_type_hints(function, include_extras=True) | FLAGS
    signature = inspect.signature(function)
    known = [p.replace(annotation=hints.get(name, p.annotation)) for name, p in signature.parameters.items()]
    kind = inspect.Parameter.KEYWORD_ONLY
    more = [inspect.Parameter(name, kind, default=False, annotation=flag) for name, flag in FLAGS.items()]
    heard.__signature__ = signature.replace(parameters=[*known, *more])  # type: ignore[attr-defined]
    heard.__annotations__ = hints
    del heard.__wrapped__  # whoever asks for the signature gets this one
    return heard


def named(simulator: str | None, words: Iterable[str] = ()) -> None:
    """The user names this simulator, and those that the words about a raw log name."""
    consent(simulator)
    for word in words:
        key, _, value = word.partition("=")
        if key in NAMING:
            consent(value)


def named_effects(references: Iterable[str] | None) -> tuple[str, ...]:
    """The user names these files of effects."""
    given = tuple(references or ())
    if given:
        from gpsim.effects import consent_to  # it loads NumPy, which `--help` does not wait for

        for reference in given:
            consent_to(reference)
    return given
