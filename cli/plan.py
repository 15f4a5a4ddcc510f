"""gpsim plan: the commands to play next, from finished diagnoses."""

from __future__ import annotations

from typing import Annotated

import typer

from gpsim.errors import UsageError

from . import completion
from .answers import answer
from .cores import CORES
from .diagnose import Cores
from .options import (
    ConfigDir,
    DryRun,
    Out,
    ShowConfig,
    configured,
    refuse_unused,
    show_standing,
    shown_words,
    split_words,
)
from .printing import say
from .progress import single_progress, warn

Words = Annotated[
    list[str] | None,
    typer.Argument(
        metavar="DIAGNOSIS... [KEY=VALUE]...",
        help="Folders of finished diagnoses of one machine, then settings, as 'plan.box={q: [-1, 1]}'.",
        autocompletion=completion.diagnoses,
    ),
]
Minutes = Annotated[float, typer.Option("--minutes", help="How long the plan may take.")]
Anew = Annotated[
    bool,
    typer.Option(
        "--anew", help="Somebody puts the machine back to rest before each piece: it need not return."
    ),
]
USED = ("seed", "plan", "experiment", "runs_dir")


def plan_command(
    words: Words = None,
    minutes: Minutes = 2.0,
    anew: Anew = False,
    out: Out = None,
    cores: Cores = None,
    config_dir: ConfigDir = None,
    show_config: ShowConfig = False,
    dry_run: DryRun = False,
) -> None:
    """Plan the next recording: safe commands under which the explanations that a diagnosis left open differ most."""
    diagnoses, settings = split_words(words or [])
    refuse_unused("plan", settings, USED)
    config = configured(settings, config_dir, show_config)
    if not diagnoses:
        raise UsageError(
            "plan: name the DIAGNOSIS that left something open, as: gpsim plan found --minutes 2"
        )
    # Imported here: scipy and matplotlib take seconds to load, and `--help` should not wait for it.
    from gpsim.reports.plan_page import told
    from gpsim.stages.figures import paths_of
    from gpsim.stages.plan import plan_of, stage_for
    from gpsim.stages.stage import Request

    stage = stage_for(diagnoses, minutes, anew)
    if dry_run:
        show_standing(stage, Request(config, shown_words(settings, config_dir), out=out))
        return
    with single_progress("plan") as progress:
        request = Request(config, shown_words(settings, config_dir), progress, out, cores=cores or CORES)
        artifact, existed = stage.make(request)
    warn(artifact.path)
    facts = plan_of(artifact)
    for line in told(facts):
        say(line)
    say(f"plan: {artifact.path}{' (already there)' if existed else ''}")
    answer(paths_of("plan", artifact.path), made=not existed, plan=dict(facts))
