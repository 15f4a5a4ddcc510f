"""gpsim collect: record the target, import logs of it, or write down what a robot is to play."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gpsim.errors import UsageError

from .answers import answer
from .options import ConfigDir, DryRun, Out, ShowConfig, Words, run_stage, show
from .printing import say

Plan = Annotated[
    Path | None,
    typer.Option("--plan", help="Only write the sweep's commands to this CSV file, for a robot to play."),
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
    from .configuration import resolve  # Hydra is no part of `--help`

    config = resolve(words or [], config_dir)
    if show_config:
        show(config)
        return
    if plan is None:
        run_stage("collect", config, tuple(words or ()), config_dir, out, dry_run)
        return
    if dry_run:
        raise UsageError("collect: --dry-run goes with a recording, not with --plan, which makes none")
    # Imported here: rosbags takes a second to load, and `--help` should not wait for it.
    from gpsim.stages.sweep import write_plan

    rows = write_plan(config, plan)
    say(f"collect: {plan}, {rows} commands, one a control step")
    answer({"plan": plan}, rows=rows)
