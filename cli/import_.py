"""gpsim import: raw logs to a recording."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated, Any

import typer

from gpsim.errors import UsageError
from gpsim.reports.sheets import printable

from . import completion
from .answers import answer, asked, console, say, warned
from .everywhere import named
from .progress import caution, warn

Sources = Annotated[
    list[str],
    typer.Argument(
        metavar="SOURCE... [KEY=VALUE]...",
        help="Log files or folders, then settings, such as rate=50.",
        autocompletion=completion.import_words,
    ),
]
Out = Annotated[Path | None, typer.Option("--out", help="The folder to make; it must not exist.")]
MappingName = Annotated[
    str | None,
    typer.Option(
        "--mapping",
        help="Name or YAML file of a mapping; not needed if columns are named as channels.",
        autocompletion=completion.mapping_names,
    ),
]
SimulatorName = Annotated[
    str | None,
    typer.Option(
        "--simulator",
        help="The simulator to compare with; the mapping is guessed from the names in the log.",
        autocompletion=completion.simulator_names,
    ),
]
Inspect = Annotated[
    bool,
    typer.Option("--inspect", help="List topics, rates and gaps; a mapping to start from goes to stdout."),
]
WriteMapping = Annotated[
    Path | None,
    typer.Option("--write-mapping", help="With --inspect: write the proposed mapping into this new file."),
]
Salvage = Annotated[
    bool, typer.Option("--salvage", help="Import the readable part of a damaged log, and count the rest.")
]
DryRun = Annotated[
    bool, typer.Option("--dry-run", help="Read the logs and describe the recording; write nothing.")
]


def import_command(
    sources: Sources,
    out: Out = None,
    mapping: MappingName = None,
    simulator: SimulatorName = None,
    inspect: Inspect = False,
    salvage: Salvage = False,
    write_mapping: WriteMapping = None,
    dry_run: DryRun = False,
) -> None:
    """Make a recording from ROS bags, CSV, Parquet or MATLAB logs: episodes on one clock."""
    paths, words = _sorted(sources)
    named(simulator, words)
    if inspect and dry_run:
        raise UsageError("import: --inspect writes nothing; remove --dry-run")
    if inspect:
        _inspect(paths, words, salvage, write_mapping)
        return
    if write_mapping is not None:
        raise UsageError("import: --write-mapping needs --inspect, which proposes the mapping")
    raw = None if mapping is not None else _guessed(paths, simulator, words, salvage, out)
    if out is None:
        raise UsageError("import: --out DIR missing; it names the recording's folder")
    # Imported here: scipy and matplotlib take a second to load, and `--help` should not wait for it.
    from gpsim.reports.import_text import render
    from gpsim.stages.figures import paths_of, recording_figures
    from gpsim.stages.import_log import import_log, mapping_of, read_by, refuse_existing

    if dry_run:
        refuse_existing(out)
        report = read_by(*mapping_of(paths, mapping, words, salvage, raw), paths, salvage, _aside)[1]
        console(highlight=False).print(render(report))
        say(f"import: would write {out}; nothing was written")
        answer(dry_run=True, notes=list(report.notes))
        return
    made = import_log(paths, out, mapping, words, salvage, say=_aside, raw=raw)
    warn(out)
    console(highlight=False).print(render(made.report))
    say(f"import: {out}")
    for line in made.report.warnings:
        warned(line)
    answer(paths_of("import", out), notes=list(made.report.notes), figures=recording_figures(made.recording))


def _sorted(words: list[str]) -> tuple[list[Path], list[str]]:
    """Sources and settings; a word with = is a setting unless a file of that name exists."""
    paths = [Path(word) for word in words if "=" not in word or _exists(word)]
    settings = [word for word in words if "=" in word and not _exists(word)]
    if not paths:
        raise UsageError("import: no SOURCE; name log files or folders")
    return paths, settings


def _exists(word: str) -> bool:
    try:
        return Path(word).exists()
    except OSError:  # longer than any file's name
        return False


def _aside(line: str) -> None:
    """To stderr: stdout is for what other programs read."""
    typer.echo(printable(line), err=True)


def _guessed(
    paths: list[Path], simulator: str | None, words: list[str], salvage: bool, out: Path | None
) -> dict[str, Any] | None:
    """The mapping that the log's names suggest; None where its columns are called as the simulator's channels."""
    from gpsim.stages.raw_logs import RawLog, decide, reads_bare

    if reads_bare(paths, simulator, words):
        return None
    tail = f"--out {'DIR' if out is None else shlex.quote(str(out))}"
    read = decide(RawLog(paths[0], "gpsim import", simulator, tail, None, tuple(words), salvage))
    for line in read.remarks:
        caution(line)
    return read.raw


def _inspect(paths: list[Path], words: list[str], salvage: bool, write_to: Path | None) -> None:
    """The tables to stderr, the proposal for the first source to stdout or into a file."""
    from rich.console import Console

    from gpsim.reports.import_text import render_inspection
    from gpsim.stages.figures import inspection_figures
    from gpsim.stages.import_log import write_mapping
    from gpsim.stages.raw_logs import inspect_source

    if words:
        raise UsageError(f"import --inspect: takes no settings ({', '.join(words)}); use them with an import")
    if write_to is not None and write_to.exists():
        raise UsageError(
            f"--write-mapping {write_to}: exists already; files are never overwritten, choose another name"
        )
    found = [inspect_source(path, salvage) for path in paths]
    for one in found:
        Console(highlight=False, stderr=True).print(render_inspection(one))
    answer({"mapping": write_to}, logs=[inspection_figures(one) for one in found], mapping=found[0].proposal)
    if len(found) > 1:
        _aside(f"the proposed mapping is for {found[0].name}; one mapping imports all sources")
    if write_to is None:
        if not asked():
            typer.echo(found[0].proposal, nl=False)
    else:
        write_mapping(found[0].proposal, write_to)
        log, to = shlex.quote(str(paths[0])), shlex.quote(str(write_to))
        first = "fill in every '?', then: " if found[0].open else ""
        _aside(f"mapping: {write_to}; {first}gpsim import {log} --mapping {to} --out DIR")
