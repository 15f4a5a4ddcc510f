"""What the commands share: their options, and making a stage's artifact."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .launching import refuse_launcher, says_where
from .printing import say
from .progress import single_progress, warn

if TYPE_CHECKING:
    from gpsim.stages.stage import Request, Stage

Words = Annotated[
    list[str] | None,
    typer.Argument(metavar="[KEY=VALUE]...", help="Settings, as experiment=cartpole gp.n_train=500."),
]
ConfigDir = Annotated[
    Path | None, typer.Option("--config-dir", help="A folder with your choices, as gp/mine.yaml.")
]
ShowConfig = Annotated[bool, typer.Option("--show-config", help="Print the resolved configuration and stop.")]
DryRun = Annotated[
    bool, typer.Option("--dry-run", help="Say what is there and what would be made, and why; write nothing.")
]
Out = Annotated[
    Path | None, typer.Option("--out", help="Write here instead of runs/<experiment>/<stage>/vNNNN.")
]


def shown_words(words: Sequence[str] | None, config_dir: Path | None) -> tuple[str, ...]:
    """What was typed, for the commands that messages and reports name; where it runs is no part of what is made."""
    kept = (word for word in words or () if not says_where(word))
    return (*kept, *((f"--config-dir={config_dir}",) if config_dir else ()))


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
    from gpsim.stages.stage import Request

    if dry_run:
        show_standing(registry.STAGES[name], Request(config, shown_words(words, config_dir), out=out))
        return
    with single_progress(name) as progress:
        request = Request(config, shown_words(words, config_dir), progress, out)
        artifact, existed = registry.STAGES[name].make(request)
    warn(artifact.path)
    say(f"{name}: {artifact.path}{' (already there)' if existed else ''}")
    for line in registry.STAGES[name].remarks(request) + registry.STAGES[name].notes(artifact):
        say(f"  {line}")


def show_standing(stage: Stage, request: Request) -> None:
    """Print what is there of a stage, or what would be made and why."""
    from gpsim.reports.runs_sheets import dry_run_lines
    from gpsim.stages.status import standing_of

    for line in dry_run_lines(standing_of(stage, request)):
        say(line)
