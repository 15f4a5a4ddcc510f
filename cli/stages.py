"""The stage commands: parse, call the stage, print where its artifact lies."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from .configuration import as_yaml, resolve
from .printing import say
from .progress import single_progress

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
        "correction=gp|effects|effects+gp says what corrects it, prediction=mean|sample how the Gaussian process does.",
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
    from .collect import collect_command  # it shares this module's options

    for name, (line, more) in STAGES.items():
        app.command(name, help=f"{line}\n\n{more}", short_help=line, rich_help_panel=PANEL)(_command(name))
        if name == "train-source":
            short = "Record episodes of the target, or import logs of it."
            app.command("collect", short_help=short, rich_help_panel=PANEL)(collect_command)


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
    say(f"{name}: {artifact.path}{' (already there)' if existed else ''}")
    for line in registry.STAGES[name].remarks(request) + registry.STAGES[name].notes(artifact):
        say(f"  {line}")
