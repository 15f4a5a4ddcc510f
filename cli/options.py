"""What the commands share: their options, and making a stage's artifact."""

from __future__ import annotations

import dataclasses
import inspect
import os
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import typer
from typer.core import TyperGroup

from gpsim.errors import UsageError

from . import completion
from .answers import answer, asked, say, say_all, warned
from .progress import EVEN, Shares, note, saying_once, single_progress, warn

if TYPE_CHECKING:
    from gpsim.artifacts import Artifact
    from gpsim.launchers import Launcher
    from gpsim.stages.stage import Request, Stage


CORES = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
"""Cores that this process may run on: fewer than the machine's in a batch job, a container or under taskset."""
KEPT = "launcher words"


def top_key(word: str) -> str:
    """The setting that a word changes, or one within it."""
    return re.split(r"[.@/=]", word.lstrip("+~"))[0]


def says_where(word: str) -> bool:
    """Whether a word is about the launcher."""
    return re.split(r"[.@=]", word.lstrip("+~"))[0] == "launcher"  # a path is none


def refuse_launcher(command: str, words: Sequence[str]) -> None:
    """Raise UsageError for words that a command would ignore: it is one job, and runs here."""
    for word in filter(says_where, words):
        raise UsageError(
            f"{command}: {word}: only run full-loop, sweep, prove and diagnose --each use a launcher"
        )


def launcher_of(config: Mapping[str, Any], processes: int) -> Launcher:
    """The launcher of a resolved configuration; raises UsageError."""
    from gpsim.launchers import launcher_from  # it takes a moment that `--help` has no use for

    return launcher_from(config["launcher"], processes, note)


def launcher_from_words(words: Sequence[str], processes: int) -> Launcher:
    """The launcher that words alone select, for commands that have no other settings; raises UsageError."""
    from .configuration import resolve  # Hydra is no part of `--help`

    return launcher_of(resolve(words, None), processes)


class LauncherWords(TyperGroup):
    """A group of commands that takes words about the launcher anywhere, and keeps them for its commands."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Take the words out; what is left is parsed as ever."""
        ctx.meta[KEPT] = [arg for arg in args if says_where(arg)]
        return super().parse_args(ctx, [arg for arg in args if not says_where(arg)])


Words = Annotated[
    list[str] | None,
    typer.Argument(
        metavar="[KEY=VALUE]...",
        help="Settings, such as experiment=cartpole gp.n_train=500.",
        autocompletion=completion.words,
    ),
]
ConfigDir = Annotated[
    Path | None, typer.Option("--config-dir", help="A folder with your own choices, such as gp/mine.yaml.")
]
ShowConfig = Annotated[bool, typer.Option("--show-config", help="Print the resolved configuration and stop.")]
DryRun = Annotated[
    bool, typer.Option("--dry-run", help="Show what exists, what would be made, and why; write nothing.")
]
Jobs = Annotated[int, typer.Option("--jobs", min=1, help="Number of processes.", show_default="cores")]
Out = Annotated[
    Path | None, typer.Option("--out", help="Write here instead of runs/<experiment>/<stage>/vNNNN.")
]


def shown_words(words: Sequence[str] | None, config_dir: Path | None) -> tuple[str, ...]:
    """What was typed, for the commands that messages and reports name; where it runs is no part of what is made."""
    kept = (word for word in words or () if not says_where(word))
    return (*kept, *((f"--config-dir={config_dir}",) if config_dir else ()))


def split_words(words: Sequence[str]) -> tuple[list[Path], list[str]]:
    """Paths and settings; a word with = or a leading ~ is a setting, unless something of that name exists."""
    paths = [word for word in words if not ("=" in word or word.startswith("~")) or Path(word).exists()]
    return [Path(word) for word in paths], [word for word in words if word not in paths]


def refuse_unused(command: str, settings: Sequence[str], used: Sequence[str]) -> None:
    """Raise UsageError for settings that a command would ignore."""
    refuse_launcher(command, settings)
    for word in settings:
        if top_key(word) not in used:
            raise UsageError(f"{command}: {word}: not used here; valid settings: {', '.join(used)}")


SHOWN = "shown as"


def option(default: Any, *names: str, **more: Any) -> Any:
    """A field of a dataclass of options; more: as typer.Option takes it."""
    return dataclasses.field(default=default, metadata={SHOWN: typer.Option(*names, **more)})


def words_of(metavar: str, help: str, completed: Callable[..., list[str]]) -> Any:
    """The field of what stands behind a command; completed: what may follow."""
    shown = typer.Argument(metavar=metavar, help=help, autocompletion=completed)
    return dataclasses.field(default=None, metadata={SHOWN: shown})


def spread(function: Callable[..., None]) -> Callable[..., None]:
    """A command of which a parameter may be a dataclass of options: Typer is shown its fields, each as an option."""
    hints = get_type_hints(function, include_extras=True)
    kinds: dict[str, Any] = {name: kind for name, kind in hints.items() if dataclasses.is_dataclass(kind)}
    shown: list[inspect.Parameter] = []
    for parameter in inspect.signature(function).parameters.values():
        if (kind := kinds.get(parameter.name)) is None:
            shown.append(parameter.replace(annotation=hints[parameter.name]))
            continue
        own = get_type_hints(kind, include_extras=True)
        for f in dataclasses.fields(kind):
            hint = Annotated[own[f.name], f.metadata[SHOWN]] if SHOWN in f.metadata else own[f.name]
            shown.append(inspect.Parameter(f.name, parameter.kind, default=f.default, annotation=hint))

    def command(**given: Any) -> None:
        for name, kind in kinds.items():
            given[name] = kind(**{f.name: given.pop(f.name) for f in dataclasses.fields(kind)})
        function(**given)

    command.__doc__, command.__name__ = function.__doc__, function.__name__
    command.__signature__ = inspect.Signature(shown)  # type: ignore[attr-defined]
    command.__annotations__ = {parameter.name: parameter.annotation for parameter in shown}
    return command


@dataclasses.dataclass
class Setup:
    """What a command is told of the configuration."""

    words: Words = None
    config_dir: ConfigDir = None
    show_config: ShowConfig = False

    @cached_property
    def config(self) -> dict[str, Any]:
        """The resolved configuration; with --show-config it is printed, and the command ends there."""
        from .configuration import as_yaml, plain, resolve  # Hydra is no part of `--help`

        config = resolve(self.words or [], self.config_dir)
        if not self.show_config:
            return config
        answer(config=plain(config))
        if not asked():
            typer.echo(as_yaml(config), nl=False)
        raise typer.Exit

    def request(self, **more: Any) -> Request:
        """What a stage is asked for; more: what else it is told."""
        from gpsim.stages.stage import Request

        return Request(self.config, shown_words(self.words, self.config_dir), **more)

    def make(
        self,
        stage: Stage,
        out: Path | None = None,
        dry_run: bool = False,
        shares: Shares = EVEN,
        once: str | None = None,
        **more: Any,
    ) -> tuple[Artifact, bool] | None:
        """A stage's artifact, and whether it existed; of a dry run None, and how it stands with it is printed.

        once: a line that is said when something is done.
        """
        if dry_run:
            show_standing(stage, self.request(out=out))
            return None
        with single_progress(stage.name, shares) as progress:
            told = saying_once(progress, once) if once else progress
            artifact, existed = stage.make(self.request(progress=told, out=out, **more))
        warn(artifact.path)
        return artifact, existed


def say_made(artifact: Artifact, existed: bool) -> None:
    """Where it lies."""
    say(f"{artifact.stage}: {artifact.path}{' (already there)' if existed else ''}")


def told(lines: Iterable[str]) -> list[str]:
    """The lines that are no warnings, for `--json`; the others are warned of."""
    kept = []
    for line in lines:
        if line.startswith(WARNING):
            warned(line.removeprefix(WARNING))
        else:
            kept.append(line)
    return kept


WARNING = "warning: "  # begins a note that is one


def run_stage(stage: Stage, setup: Setup, out: Path | None, dry_run: bool = False) -> None:
    """Make a stage's artifact and print where it lies; of a dry run only how it stands with it."""
    request = setup.request()  # first of all: --show-config ends here
    refuse_launcher(stage.name, setup.words or ())
    from gpsim.stages.figures import figures_of, paths_of

    if (made := setup.make(stage, out, dry_run)) is None:
        return
    artifact, existed = made
    say_made(artifact, existed)
    notes = stage.remarks(request) + stage.notes(artifact)
    say_all(notes, "  ")
    figures = figures_of(artifact) if asked() else {}
    answer(paths_of(stage.name, artifact.path), made=not existed, notes=told(notes), figures=figures)


def show_standing(stage: Stage, request: Request) -> None:
    """Print what is there of a stage, or what would be made and why."""
    from gpsim.reports.runs_text import dry_run_lines
    from gpsim.stages.runs import standing_of

    standing = standing_of(stage, request)
    say_all(dry_run_lines(standing))
    answer(dry_run=True, standing=dataclasses.asdict(standing))
