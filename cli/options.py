"""What the commands share: their options, and making a stage's artifact."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from .printing import say
from .progress import single_progress, warn

Words = Annotated[
    list[str] | None,
    typer.Argument(metavar="[KEY=VALUE]...", help="Settings, as experiment=cartpole gp.n_train=500."),
]
ConfigDir = Annotated[
    Path | None, typer.Option("--config-dir", help="A folder with your choices, as gp/mine.yaml.")
]
ShowConfig = Annotated[bool, typer.Option("--show-config", help="Print the resolved configuration and stop.")]
Out = Annotated[
    Path | None, typer.Option("--out", help="Write here instead of runs/<experiment>/<stage>/vNNNN.")
]


def shown_words(words: Sequence[str] | None, config_dir: Path | None) -> tuple[str, ...]:
    """What was typed, for the commands that messages and reports name."""
    return (*(words or ()), *((f"--config-dir={config_dir}",) if config_dir else ()))


def run_stage(
    name: str, config: dict[str, object], words: tuple[str, ...], config_dir: Path | None, out: Path | None
) -> None:
    """Make a stage's artifact and print where it lies."""
    # Imported here: torch takes seconds to load, and `--help` should not wait for it.
    from gpsim.stages import registry
    from gpsim.stages.stage import Request

    with single_progress(name) as progress:
        request = Request(config, shown_words(words, config_dir), progress, out)
        artifact, existed = registry.STAGES[name].make(request)
    warn(artifact.path)
    say(f"{name}: {artifact.path}{' (already there)' if existed else ''}")
    for line in registry.STAGES[name].remarks(request) + registry.STAGES[name].notes(artifact):
        say(f"  {line}")
