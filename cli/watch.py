"""gpsim watch: recordings as they come, against an old account."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from . import completion
from .answers import NO_LONGER_HOLDS, answer
from .options import ConfigDir, ShowConfig, configured, refuse_unused
from .printing import say
from .progress import note

What = Annotated[
    Path,
    typer.Argument(
        metavar="LOG|FOLDER",
        help="A recording, a CSV that is being written, or a folder into which recordings come.",
    ),
]
Words = Annotated[
    list[str] | None,
    typer.Argument(
        metavar="[KEY=VALUE]...", help="Settings, as watch.stretch=120.", autocompletion=completion.words
    ),
]
DiagnosisDir = Annotated[
    Path,
    typer.Option("--diagnosis", metavar="DIR", help="The account.", autocompletion=completion.diagnoses),
]
Log = Annotated[
    Path | None,
    typer.Option(
        "--log",
        help="JSON lines, an object a recording; what it holds is not looked at again. Else LOG|FOLDER.watch.jsonl.",
    ),
]
Once = Annotated[bool, typer.Option("--once", help="Look at what is there and end, for a CI job or cron.")]
USED = ("watch", "experiment", "runs_dir")


def watch_command(
    what: What,
    diagnosis: DiagnosisDir,
    words: Words = None,
    log: Log = None,
    once: Once = False,
    config_dir: ConfigDir = None,
    show_config: ShowConfig = False,
) -> None:
    """Say of every new recording whether an old account still holds; exit code 4 where it no longer does."""
    refuse_unused("watch", words or [], USED)
    config = configured(words, config_dir, show_config)
    # Imported here: scipy takes a second to load, and `--help` should not wait for it.
    from gpsim.stages.watch import watch_of, watched

    watch = watch_of(diagnosis, what, log, config["watch"])
    note(f"watch: {watch.log}")
    found = []
    for said in watched(watch, once):
        say(said.line)
        found.append({k: v for k, v in said.to_dict().items() if k != "sums"})
    answer({"log": watch.log, "diagnosis": diagnosis}, holds=watch.holds, recordings=found)
    if not watch.holds:
        say(f"the account no longer holds: diagnose again, and begin a new log ({watch.log})")
        raise typer.Exit(NO_LONGER_HOLDS)
