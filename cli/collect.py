"""gpsim collect: record the target, import logs of it, or write down what a robot is to play."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from gpsim.errors import UsageError

from .answers import answer, asked
from .launching import refuse_launcher
from .options import (
    ConfigDir,
    DryRun,
    Out,
    ShowConfig,
    Words,
    configured,
    run_stage,
    show_standing,
    shown_words,
)
from .printing import say
from .progress import single_progress

Plan = Annotated[
    Path | None,
    typer.Option(
        "--plan",
        help="Play this finished plan of `gpsim plan` on the target; or, of a file that is not there, only write the "
        "sweep's commands to it, for a robot to play.",
    ),
]


def collect_command(
    words: Words = None,
    config_dir: ConfigDir = None,
    show_config: ShowConfig = False,
    out: Out = None,
    plan: Plan = None,
    dry_run: DryRun = False,
) -> None:
    """Record episodes of the target, or import logs of it (collect.source=my.bag)."""
    config = configured(words, config_dir, show_config)
    if plan is None:
        run_stage("collect", config, tuple(words or ()), config_dir, out, dry_run)
        return
    if plan.is_dir():
        _play(plan, config, shown_words(words, config_dir), out, dry_run)
        return
    if dry_run:
        raise UsageError("collect: --dry-run goes with a recording, not with --plan, which makes none")
    # Imported here: rosbags takes a second to load, and `--help` should not wait for it.
    from gpsim.stages.sweep import write_plan

    rows = write_plan(config, plan)
    say(f"collect: {plan}, {rows} commands, one a control step")
    answer({"plan": plan}, rows=rows)


def _play(
    plan: Path, config: dict[str, Any], words: tuple[str, ...], out: Path | None, dry_run: bool
) -> None:
    refuse_launcher("collect", words)
    from gpsim.stages.figures import figures_of, paths_of
    from gpsim.stages.plan import play_stage
    from gpsim.stages.stage import Request

    stage = play_stage(plan)
    if dry_run:
        show_standing(stage, Request(config, words, out=out))
        return
    with single_progress("collect") as progress:
        artifact, existed = stage.make(Request(config, words, progress, out))
    say(f"collect: {artifact.path}{' (already there)' if existed else ''}")
    figures = figures_of(artifact) if asked() else {}
    answer(paths_of("collect", artifact.path), made=not existed, notes=[], figures=figures)
