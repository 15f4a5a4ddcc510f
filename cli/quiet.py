"""`--quiet`, `-q`: an option of every command, before it or behind it, added in one place."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from typing import Annotated, Any, get_type_hints

import typer

from .progress import QUIET

NAME = "quiet"
Quiet = Annotated[
    bool, typer.Option("--quiet", "-q", help="No progress and no notes on stderr: results and errors alone.")
]


def add_quiet(app: typer.Typer) -> None:
    """Give the option to every command and every group of an app, at any depth."""
    if app.registered_callback is not None and app.registered_callback.callback is not None:
        app.registered_callback.callback = _with_quiet(app.registered_callback.callback)
    for command in app.registered_commands:
        if command.callback is not None:
            command.callback = _with_quiet(command.callback)
    for group in app.registered_groups:
        if group.typer_instance is not None:
            add_quiet(group.typer_instance)


def _with_quiet(function: Callable[..., Any]) -> Callable[..., Any]:
    """The same function with one keyword more, which Typer reads from its signature."""

    @functools.wraps(function)
    def heard(*arguments: Any, quiet: bool = False, **named: Any) -> Any:
        if quiet:
            QUIET.set(True)
        return function(*arguments, **named)

    signature = inspect.signature(function)
    option = inspect.Parameter(NAME, inspect.Parameter.KEYWORD_ONLY, default=False, annotation=Quiet)
    hints = get_type_hints(function, include_extras=True)
    known = [p.replace(annotation=hints.get(name, p.annotation)) for name, p in signature.parameters.items()]
    heard.__signature__ = signature.replace(parameters=[*known, option])  # type: ignore[attr-defined]
    heard.__annotations__ = {**hints, NAME: Quiet}
    del heard.__wrapped__  # whoever asks for the signature gets this one
    return heard
