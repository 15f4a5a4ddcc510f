"""What the commands share: their options, and making a stage's artifact."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gpsim.errors import UsageError

from . import completion
from .answers import answer, asked, warned
from .launching import refuse_launcher, says_where
from .printing import say
from .progress import single_progress, warn

if TYPE_CHECKING:
    from gpsim.stages.stage import Request, Stage

Words = Annotated[
    list[str] | None,
    typer.Argument(
        metavar="[KEY=VALUE]...",
        help="Settings, such as experiment=cartpole gp.n_train=500.",
        autocompletion=completion.words,
    ),
]
ConfigDir = Annotated[
    Path | None, typer.Option("--config-dir", help="A folder with your own choices, such as gp/mine.yaml.")
]
ShowConfig = Annotated[bool, typer.Option("--show-config", help="Print the resolved configuration and stop.")]
DryRun = Annotated[
    bool, typer.Option("--dry-run", help="Show what exists and what would be made, and why; write nothing.")
]
Jobs = Annotated[int, typer.Option("--jobs", min=1, help="Number of processes.", show_default="cores")]
Out = Annotated[
    Path | None, typer.Option("--out", help="Write here instead of runs/<experiment>/<stage>/vNNNN.")
]


def shown_words(words: Sequence[str] | None, config_dir: Path | None) -> tuple[str, ...]:
    """What was typed, for the commands that messages and reports name; where it runs is no part of what is made."""
    kept = (word for word in words or () if not says_where(word))
    return (*kept, *((f"--config-dir={config_dir}",) if config_dir else ()))


def split_words(words: Sequence[str]) -> tuple[list[Path], list[str]]:
    """Paths and settings; a word with = or a leading ~ is a setting, unless something of that name exists."""
    paths = [word for word in words if not ("=" in word or word.startswith("~")) or Path(word).exists()]
    return [Path(word) for word in paths], [word for word in words if word not in paths]


def refuse_unused(command: str, settings: Sequence[str], used: Sequence[str]) -> None:
    """Raise UsageError for settings that a command would ignore."""
    refuse_launcher(command, settings)
    for word in settings:
        if re.split(r"[.@/=]", word.lstrip("+~"))[0] not in used:
            raise UsageError(f"{command}: {word}: not used here; settings that count: {', '.join(used)}")


def configured(
    words: Sequence[str] | None, config_dir: Path | None, show_config: bool = False
) -> dict[str, Any]:
    """The resolved configuration; with --show-config it is printed, and the command ends there."""
    from .configuration import as_yaml, plain, resolve  # Hydra is no part of `--help`

    config = resolve(words or [], config_dir)
    if not show_config:
        return config
    answer(config=plain(config))
    if not asked():
        typer.echo(as_yaml(config), nl=False)
    raise typer.Exit


def told(lines: Iterable[str]) -> list[str]:
    """The lines that are no warnings, for `--json`; the others are warned of."""
    kept = []
    for line in lines:
        if line.startswith(WARNING):
            warned(line.removeprefix(WARNING))
        else:
            kept.append(line)
    return kept


WARNING = "warning: "  # begins a note that is one


def run_stage(
    name: str,
    config: dict[str, object],
    words: tuple[str, ...],
    config_dir: Path | None,
    out: Path | None,
    dry_run: bool = False,
) -> None:
    """Make a stage's artifact and print where it lies; of a dry run only how it stands with it."""
    # Imported here: torch takes seconds to load, and `--help` should not wait for it.
    refuse_launcher(name, words)
    from gpsim.stages import registry
    from gpsim.stages.figures import figures_of, paths_of
    from gpsim.stages.stage import Request

    if dry_run:
        show_standing(registry.STAGES[name], Request(config, shown_words(words, config_dir), out=out))
        return
    with single_progress(name) as progress:
        request = Request(config, shown_words(words, config_dir), progress, out)
        artifact, existed = registry.STAGES[name].make(request)
    warn(artifact.path)
    say(f"{name}: {artifact.path}{' (already there)' if existed else ''}")
    notes = registry.STAGES[name].remarks(request) + registry.STAGES[name].notes(artifact)
    for line in notes:
        say(f"  {line}")
    figures = figures_of(artifact) if asked() else {}
    answer(paths_of(name, artifact.path), made=not existed, notes=told(notes), figures=figures)


def show_standing(stage: Stage, request: Request) -> None:
    """Print what is there of a stage, or what would be made and why."""
    from gpsim.reports.runs_sheets import dry_run_lines
    from gpsim.stages.runs import standing_of

    standing = standing_of(stage, request)
    for line in dry_run_lines(standing):
        say(line)
    answer(dry_run=True, standing=asdict(standing))
