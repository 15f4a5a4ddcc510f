"""gpsim import: raw logs to a recording."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gpsim.errors import UsageError

from .printing import say

Sources = Annotated[
    list[str],
    typer.Argument(
        metavar="SOURCE... [KEY=VALUE]...", help="Log files or folders, then settings, as rate=50."
    ),
]
Out = Annotated[Path | None, typer.Option("--out", help="The folder to make; it must not exist.")]
MappingName = Annotated[
    str | None,
    typer.Option("--mapping", help="A mapping's name or YAML file; none for columns named as channels."),
]
Inspect = Annotated[
    bool, typer.Option("--inspect", help="List topics, rates and gaps, and propose a mapping.")
]
Salvage = Annotated[
    bool, typer.Option("--salvage", help="Import what is readable of a damaged log, and count it.")
]


def import_command(
    sources: Sources,
    out: Out = None,
    mapping: MappingName = None,
    inspect: Inspect = False,
    salvage: Salvage = False,
) -> None:
    """Make a recording of ROS bags, CSV, Parquet or MATLAB logs: episodes on one clock."""
    paths, words = _sorted(sources)
    if inspect:
        _inspect(paths, salvage)
        return
    if out is None:
        raise UsageError("import: --out DIR missing; it names the recording's folder")
    # Imported here: scipy and matplotlib take a second to load, and `--help` should not wait for it.
    from rich.console import Console

    from gpsim.recordings.import_report import render
    from gpsim.stages.import_log import import_log

    made = import_log(paths, out, mapping, words, salvage)
    Console(highlight=False).print(render(made.report))
    say(f"import: {out}")


def _sorted(words: list[str]) -> tuple[list[Path], list[str]]:
    """Sources and settings; a word with = is a setting unless a file of that name exists."""
    paths = [Path(word) for word in words if "=" not in word or Path(word).exists()]
    settings = [word for word in words if "=" in word and not Path(word).exists()]
    if not paths:
        raise UsageError("import: no SOURCE; name log files or folders")
    return paths, settings


def _inspect(paths: list[Path], salvage: bool) -> None:
    from rich.console import Console

    from gpsim.recordings.inspection import render_inspection
    from gpsim.stages.import_log import inspect_source

    for path in paths:
        found = inspect_source(path, salvage)
        Console(highlight=False).print(render_inspection(found))
        say(found.proposal)
