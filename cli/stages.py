"""The stage commands: parse, call the stage, print where its artifact lies."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

from gpsim.errors import UsageError

from .answers import answer, say
from .options import DryRun, Out, Setup, run_stage, spread

Plan = Annotated[
    Path | None,
    typer.Option(
        "--plan",
        help="Play this finished plan of `gpsim plan` on the target; or, of a file that is not there, only write the "
        "sweep's commands to it, for a robot to play.",
    ),
]


@spread
def collect_command(*, setup: Setup, out: Out = None, plan: Plan = None, dry_run: DryRun = False) -> None:
    """Record episodes of the target, or import logs of it (collect.source=my.bag)."""
    config = setup.config
    # Imported here: rosbags takes a second to load, and `--help` should not wait for it.
    if plan is None:
        from gpsim.stages.registry import STAGES

        run_stage(STAGES["collect"], setup, out, dry_run)
    elif plan.is_dir():
        from gpsim.stages.plan import play_stage

        run_stage(play_stage(plan), setup, out, dry_run)
    elif dry_run:
        raise UsageError("collect: --dry-run goes with a recording, not with --plan, which makes none")
    else:
        from gpsim.stages.collect import write_plan

        rows = write_plan(config, plan)
        say(f"collect: {plan}, {rows} commands, one a control step")
        answer({"plan": plan}, rows=rows)


PANEL = "Stages, in order"
LOOP = {
    "train-source": (
        "Train a policy in the base simulator.",
        "variant=source|randomised|target: the base simulator, the same with its parameters randomised, the target.",
    ),
    "build-residuals": (
        "Subtract the prediction from the recording, rate by rate.",
        "recording=DIR takes another recording than the one that `collect` made.",
    ),
    "fit-gp": ("Fit one Gaussian process per rate to the residuals.", ""),
    "train-gp-policy": (
        "Train a policy in the corrected simulator.",
        "correction=gp|effects|effects+gp says what corrects it, prediction=mean|sample how the Gaussian process does; "
        "robustness=posterior draws each episode from what a diagnosis leaves open.",
    ),
    "certify": ("Search which starts of the evaluation can be solved.", ""),
    "evaluate": (
        "Compare policies and simulators on the target.",
        "One step, rollouts and returns; deployed=BAG scores recorded deployments instead.",
    ),
}
"""A line for `gpsim --help`, and what the command's own help adds."""


def add_stages(app: typer.Typer) -> None:
    """One command a stage, in the order of the loop."""
    for name, (line, more) in LOOP.items():
        app.command(name, help=f"{line}\n\n{more}", short_help=line, rich_help_panel=PANEL)(_command(name))
        if name == "train-source":
            short = "Record episodes of the target, or import logs of it."
            app.command("collect", short_help=short, rich_help_panel=PANEL)(collect_command)


def _command(name: str) -> Callable[..., None]:
    @spread
    def command(*, setup: Setup, out: Out = None, dry_run: DryRun = False) -> None:
        setup.request()  # before torch is loaded, which takes seconds: --show-config and bad words end here
        from gpsim.stages.registry import STAGES

        run_stage(STAGES[name], setup, out, dry_run)

    return command
