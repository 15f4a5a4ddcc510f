"""`gpsim runs`: what is in runs/, what rests on what, how two differ, and removing what nothing needs."""

from __future__ import annotations

import sys
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gpsim.errors import UsageError

from .answers import answer, asked, console, say, say_all

if TYPE_CHECKING:
    from gpsim.runs import Removed

runs_app = typer.Typer(
    no_args_is_help=True,
    help="List, show, compare and remove artifacts in runs/. An artifact that another one needs is never removed.",
)
RunsDir = Annotated[
    Path, typer.Option("--runs-dir", help="The folder of the artifacts, as runs_dir= of a stage.")
]
Beside = Annotated[
    list[Path] | None,
    typer.Option(
        "--beside",
        help="Also search this folder for artifacts of `--out`, and keep what they need. May be repeated.",
    ),
]
Name = Annotated[
    str, typer.Argument(metavar="ARTIFACT", help="As cartpole/fit-gp/v0003, fit-gp/v3 or a folder.")
]
Names = Annotated[
    list[str], typer.Argument(metavar="ARTIFACT...", help="As cartpole/fit-gp/v0003, fit-gp/v3 or a folder.")
]
Yes = Annotated[bool, typer.Option("--yes", "-y", help="Do not ask before.")]
DryRun = Annotated[
    bool, typer.Option("--dry-run", help="Show what would be removed and how many bytes; remove nothing.")
]
WIDTH = 160  # of a table where there is no terminal that has one
RUNS = Path("runs")


@runs_app.callback()
def _runs() -> None:
    pass


@runs_app.command("list")
def list_command(
    experiment: Annotated[str | None, typer.Option("--experiment", help="Only of this experiment.")] = None,
    stage: Annotated[str | None, typer.Option("--stage", help="Only of this stage.")] = None,
    verify: Annotated[bool, typer.Option("--verify", help="Check every byte for changes.")] = False,
    runs_dir: RunsDir = RUNS,
) -> None:
    """Every artifact: its result, state (finished, stale, broken), date, seed and size."""
    # Imported here: the stages take seconds to load, and `--help` should not wait for them.
    from gpsim.reports.loop_page import terminal_table
    from gpsim.reports.runs_text import listing_lines, listing_sheet
    from gpsim.stages.runs import list_runs

    found = list_runs(runs_dir, experiment, stage, verify)
    console(width=WIDTH).print(terminal_table(listing_sheet(found), {}))
    say_all(listing_lines(found))
    answer({"runs": runs_dir}, listing=asdict(found) | {"bytes": found.bytes})


@runs_app.command("show")
def show_command(
    name: Name,
    whole: Annotated[
        bool, typer.Option("--all", help="Also show the configuration, package versions and files.")
    ] = False,
    runs_dir: RunsDir = RUNS,
    beside: Beside = None,
) -> None:
    """Show one artifact and verify every byte: its inputs, what was made from it, its figures."""
    from gpsim.reports.runs_text import shown_lines
    from gpsim.stages.runs import show_run

    found = show_run(runs_dir, name, beside or ())
    say_all(shown_lines(found, whole))
    answer({"runs": runs_dir}, artifact=asdict(found))


@runs_app.command("diff")
def diff_command(one: Name, other: Name, runs_dir: RunsDir = RUNS, beside: Beside = None) -> None:
    """Compare two artifacts: configuration key by key, files, seeds, parents, code, packages, figures."""
    from gpsim.reports.runs_text import compared_lines
    from gpsim.stages.runs import compare_runs

    found = compare_runs(runs_dir, one, other, beside or ())
    say_all(compared_lines(found))
    answer({"runs": runs_dir}, compared=asdict(found))


@runs_app.command("rm")
def rm_command(
    names: Names,
    with_dependents: Annotated[
        bool, typer.Option("--with-dependents", help="Also remove everything that needs them.")
    ] = False,
    dry_run: DryRun = False,
    yes: Yes = False,
    runs_dir: RunsDir = RUNS,
    beside: Beside = None,
) -> None:
    """Remove artifacts that nothing else needs; otherwise name what needs them."""
    from gpsim.stages.runs import plan_removal

    planned = plan_removal(runs_dir, names, with_dependents, dry_run, beside or ())
    agreed = _agreed(planned.told, yes)
    if agreed:
        planned.go()
        say("removed")
    answer({"runs": runs_dir}, planned=asdict(planned.told), removed=agreed)


@runs_app.command("gc")
def gc_command(
    keep: Annotated[
        int | None,
        typer.Option(
            "--keep",
            min=0,
            help="Also remove old versions that nothing needs: all but the newest N of a stage.",
        ),
    ] = None,
    dry_run: DryRun = False,
    yes: Yes = False,
    runs_dir: RunsDir = RUNS,
    beside: Beside = None,
) -> None:
    """Remove unfinished artifacts and, with --keep N, old versions that nothing needs."""
    from gpsim.stages.runs import plan_gc

    planned = plan_gc(runs_dir, keep, dry_run, beside or ())
    told = planned.told
    agreed = _agreed(told, yes or not told.artifacts)  # what is left unfinished is nobody's work
    if agreed:
        stayed = len(told.artifacts) - len(planned.go().entries)
        say(f"removed{f'; {stayed} stayed: something is being made of them' if stayed > 0 else ''}")
    answer({"runs": runs_dir}, planned=asdict(told), removed=agreed)


def _agreed(planned: Removed, yes: bool) -> bool:
    """Print what is to go; whether to go on. Where nobody can be asked, `--yes` has to say so."""
    from gpsim.reports.runs_text import removed_lines, removed_sum

    say_all(removed_lines(planned))
    nothing = not planned.artifacts and not planned.beside
    say(f"{removed_sum(planned)}{'; nothing was removed' if planned.dry_run and not nothing else ''}")
    if planned.dry_run or nothing:
        return False
    if yes:
        return True
    if asked() or not sys.stdin.isatty():
        raise UsageError("runs: no terminal to ask; add --yes to remove this, or --dry-run for a preview")
    return typer.confirm("remove?")
