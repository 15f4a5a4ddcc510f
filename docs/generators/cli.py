"""docs/reference/cli.md: every command with its words and options, from the Typer app."""

from typing import Any

import typer
from gpsim.cli.main import app

from . import MADE

HEAD = f"""# Commands

{MADE.format(source="the command line itself")}

Every command accepts `-h` or `--help`, which prints the text of this page. `-q` or `--quiet`, before or after the
command, suppresses progress and notes on stderr. `--trust` allows Python files that are only named in data
([which code runs](../how-to/trust.md)). A setting is a `key=value` word; `--show-config` prints all settings of a
command. Bad input gives one line that names the fault, its place and the remedy."""
EVERYWHERE = ("--help", "--quiet", "--trust")


def cli_page() -> str:
    """All of it; a panel of `gpsim --help` is a part, a command a heading, those of a group below it."""
    root: Any = typer.main.get_command(app)
    parts = [HEAD, _table("Options of `gpsim` itself", _options(root))]
    panels: dict[str, list[tuple[str, Any]]] = {}
    for name, command in root.commands.items():
        panels.setdefault(command.rich_help_panel or "Others", []).append((f"gpsim {name}", command))
    for panel, commands in panels.items():
        parts.append(f"## {panel}")
        for name, command in commands:
            parts += _command(name, command, 3)
    return "\n\n".join(part for part in parts if part) + "\n"


def _command(name: str, command: Any, depth: int) -> list[str]:
    """Heading, usage, what it does, arguments and options; then the commands below it."""
    if command.hidden:
        return []
    parts = [f"{'#' * depth} {name}", f"    {_usage(name, command)}", _text(command.help or "")]
    arguments = [p for p in command.params if p.param_type_name == "argument"]
    parts.append(_table("word", [[f"`{_shown(p)}`", _help(p)] for p in arguments]))
    parts.append(_table("option", _options(command)))
    for below, inner in getattr(command, "commands", {}).items():
        parts += _command(f"{name} {below}", inner, depth + 1)
    return parts


def _usage(name: str, command: Any) -> str:
    arguments = [_shown(p) for p in command.params if p.param_type_name == "argument"]
    group = (
        ["COMMAND" if command.no_args_is_help else "[COMMAND]"] if getattr(command, "commands", {}) else []
    )
    return " ".join([name, "[OPTIONS]", *arguments, *group])


def _shown(argument: Any) -> str:
    name = argument.metavar or argument.name.upper()
    return name if argument.required or name.startswith("[") else f"[{name}]"


def _options(command: Any) -> list[list[str]]:
    options = [p for p in command.params if p.param_type_name == "option" and not p.hidden]
    return [[_spelt(p), _help(p)] for p in options if not set(EVERYWHERE) & set(p.opts)]


def _spelt(option: Any) -> str:
    names = ", ".join(f"`{name}`" for name in [*option.opts, *option.secondary_opts])
    return names if option.is_flag else names[:-1] + f" {option.metavar or option.name.upper()}`"


def _help(parameter: Any) -> str:
    """What it is, and its default where that says something."""
    shown = getattr(parameter, "show_default", None)
    if isinstance(shown, str):  # what it is differs from machine to machine
        return f"{_text(parameter.help or '')} Default: {shown}."
    default = parameter.default
    said = "" if default in (None, False, True, "") or callable(default) else f" Default: `{default}`."
    return _text(parameter.help or "") + said


def _text(text: str) -> str:
    """Help without the terminal's markup; what stands in angle brackets is no tag."""
    plain = " ".join(text.replace("\b", "").split())
    return plain.replace("<", "&lt;").replace("|", "\\|")


def _table(head: str, rows: list[list[str]]) -> str:
    if not rows:
        return ""
    lines = [f"| {head} | what |", "|---|---|", *(f"| {' | '.join(row)} |" for row in rows)]
    return "\n".join(lines)
