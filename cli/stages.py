"""The stage commands: parse, call the stage, print where its artifact lies."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .configuration import as_yaml, resolve
from .progress import single_progress

Words = Annotated[
    list[str] | None,
    typer.Argument(metavar="[KEY=VALUE]...", help="Settings, as experiment=cartpole gp.n_train=500."),
]
ConfigDir = Annotated[Path | None, typer.Option("--config-dir", help="A folder with your own configs.")]
ShowConfig = Annotated[bool, typer.Option("--show-config", help="Print the resolved configuration and stop.")]
Out = Annotated[
    Path | None, typer.Option("--out", help="Write here instead of runs/<experiment>/<stage>/vNNNN.")
]
PANEL = "Stages, in order"
STAGES = {
    "train-source": "Train a policy in the base simulator (variant=source|randomised|target).",
    "build-residuals": "Subtract the simulator's prediction from the recording, rate by rate.",
    "fit-gp": "Fit one Gaussian process per rate to the residuals.",
    "train-gp-policy": "Train a policy in the corrected simulator "
    "(correction=gp|effects|effects+gp, prediction=mean|sample).",
    "certify": "Search which of the evaluation's starts can be solved at all.",
    "evaluate": "Compare policies, simulators and target: one step, rollouts, returns.",
}


def add_stages(app: typer.Typer) -> None:
    """One command a stage, in the order of the loop."""
    from .collect import collect_command  # it shares this module's options

    for name, text in STAGES.items():
        app.command(name, help=text, rich_help_panel=PANEL)(_command(name))
        if name == "train-source":
            app.command("collect", rich_help_panel=PANEL)(collect_command)


def _command(name: str):  # type: ignore[no-untyped-def]  # Typer reads the signature of the inner function
    def command(
        words: Words = None, config_dir: ConfigDir = None, show_config: ShowConfig = False, out: Out = None
    ) -> None:
        config = resolve(words or [], config_dir)
        if show_config:
            typer.echo(as_yaml(config), nl=False)
            return
        run_stage(name, config, tuple(words or ()), config_dir, out)

    return command


def run_stage(
    name: str, config: dict[str, object], words: tuple[str, ...], config_dir: Path | None, out: Path | None
) -> None:
    """Make a stage's artifact and print where it lies."""
    # Imported here: torch takes seconds to load, and `--help` should not wait for it.
    from gpsim.stages import registry
    from gpsim.stages.stage import Request

    shown = words + ((f"--config-dir={config_dir}",) if config_dir else ())
    with single_progress(name) as progress:
        artifact, existed = registry.STAGES[name].make(Request(config, shown, progress, out))
    typer.echo(f"{name}: {artifact.path}{' (already there)' if existed else ''}")
    for line in registry.STAGES[name].notes(artifact):
        typer.echo(f"  {line}")
