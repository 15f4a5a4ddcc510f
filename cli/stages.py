"""The stage commands: parse, call the stage, print where its artifact lies."""

from __future__ import annotations

import typer

from .collect import collect_command
from .options import ConfigDir, DryRun, Out, ShowConfig, Words, configured, run_stage

PANEL = "Stages, in order"
STAGES = {
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
    for name, (line, more) in STAGES.items():
        app.command(name, help=f"{line}\n\n{more}", short_help=line, rich_help_panel=PANEL)(_command(name))
        if name == "train-source":
            short = "Record episodes of the target, or import logs of it."
            app.command("collect", short_help=short, rich_help_panel=PANEL)(collect_command)


def _command(name: str):  # type: ignore[no-untyped-def]  # Typer reads the signature of the inner function
    def command(
        words: Words = None,
        config_dir: ConfigDir = None,
        show_config: ShowConfig = False,
        out: Out = None,
        dry_run: DryRun = False,
    ) -> None:
        config = configured(words, config_dir, show_config)
        run_stage(name, config, tuple(words or ()), config_dir, out, dry_run)

    return command
