"""The command line: `gpsim --help`; cli/entry.py starts it."""

from __future__ import annotations

import os

# One thread a process: the networks and matrices here are too small for more, and policies train side by side.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# Pictures are files: whatever stands there for windows, a name that nobody knows among it, is not looked for.
os.environ["MPLBACKEND"] = "agg"

import sys
from contextlib import suppress
from typing import Any, NoReturn

import typer
from typer.core import TyperGroup
from typer.models import Default

from gpsim import __version__
from gpsim.errors import CODE, NoDiagnosis, Terminated, UsageError
from gpsim.files import FULL, REFUSED
from gpsim.reports.sheets import printable
from gpsim.trust import trusting
from gpsim.workers import ends_when_asked

from . import answers
from .after import deploy_command, plan_command, watch_command
from .answers import INTERRUPTED_CODE, QUIET
from .diagnose import diagnose_command
from .everywhere import add_everywhere
from .export import export_app, view_command
from .import_ import import_command
from .progress import INTERRUPTED
from .prove import prove_app
from .run import add_stages, report_command, run_app, status_command, sweep_command
from .runs import runs_app
from .simulators import effects_app, simulators_app

LONGEST_NAME = 80  # of a file in an error
CRASHED, BAD_INPUT, NO_DIAGNOSIS = 1, 2, 3  # exit codes; docs/reference/exit_codes.md


class Root(TyperGroup):
    """The whole command line; what it refuses is kept for `--json`."""

    def make_context(self, *arguments: Any, **named: Any) -> Any:
        """Its own options are read here."""
        with answers.refusals():
            return super().make_context(*arguments, **named)

    def invoke(self, *arguments: Any, **named: Any) -> Any:
        """The commands' options are read here."""
        with answers.refusals():
            return super().invoke(*arguments, **named)


app = typer.Typer(
    name="gpsim",
    cls=Root,
    help=(
        "Close the gap between a simple simulator and a real robot.\n\n"
        "Stages read and write versioned artifacts below ./runs; each takes settings as key=value words, "
        "for example: gpsim fit-gp experiment=cartpole gp.n_train=500 seed=3"
    ),
    epilog=(
        "Exit codes: 0 done, 1 a bug in gpsim, 2 bad input, 3 a valid recording that allows no diagnosis, 4 an "
        "account that no longer holds (watch), 130 interrupted, 143 terminated."
    ),
    no_args_is_help=True,
    add_completion=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["-h", "--help"]},  # of every command below it, too
)


def _version(value: bool) -> None:
    if value:
        typer.echo(f"gpsim {__version__}")
        raise typer.Exit


@app.callback()
def _root(
    version: bool = typer.Option(
        False, "--version", callback=_version, is_eager=True, help="Print the version."
    ),
) -> None:
    pass


add_stages(app)
app.command("report", rich_help_panel="Stages, in order")(report_command)
ONCE, INOUT, THERE = "Everything at once", "Recordings in and out", "What is there"
PANELS: tuple[tuple[str, str, Any, str | None], ...] = (
    (ONCE, "run", run_app, None),
    (ONCE, "sweep", sweep_command, "Run a stage for every combination of settings."),
    (ONCE, "diagnose", diagnose_command, "Say which physics the simulator lacks."),
    (ONCE, "deploy", deploy_command, "Test a monitor on recorded drives of a policy."),
    (ONCE, "plan", plan_command, "Plan a safe recording that separates the explanations."),
    (ONCE, "watch", watch_command, "Check whether an account still holds for new recordings."),
    (ONCE, "prove", prove_app, "Blind test: hide defects, diagnose, reveal and score."),
    (INOUT, "import", import_command, "Make a recording of raw logs."),
    (INOUT, "export", export_app, "Write a recording or a policy for other programs."),
    (INOUT, "view", view_command, "View real, base and corrected motion side by side."),
    (THERE, "status", status_command, "Show which artifacts exist, which would be made, and why."),
    (THERE, "runs", runs_app, "List, show, compare and remove artifacts in runs/."),
    (THERE, "simulators", simulators_app, "List simulators, show one, check a MuJoCo model."),
    (THERE, "effects", effects_app, "List effects, show one, write your own and check it."),
)
"""Where a command stands in `gpsim --help`, and its line there."""
for panel, name, command, line in PANELS:
    if isinstance(command, typer.Typer):
        app.add_typer(command, name=name, rich_help_panel=panel, short_help=line or Default(None))
    else:
        app.command(name, short_help=line, rich_help_panel=panel)(command)
add_everywhere(app)


def main() -> None:
    """Entry point: a UsageError is one line and exit code 2 (3: no diagnosis is possible), never a traceback."""
    loud, answer = QUIET.set(False), answers.begin(sys.argv[1:])
    try:
        with ends_when_asked(), trusting(False):  # --trust ends with its command
            _called()
    except (Terminated, KeyboardInterrupt) as ended:  # within a command Typer makes an exit code of Ctrl-C
        _say_interrupted()
        _end(CODE if isinstance(ended, Terminated) else INTERRUPTED_CODE, INTERRUPTED)
    except UsageError as error:
        for line in error.table:
            answers.warned(printable(line))
        print(*map(printable, error.table), f"error: {printable(error)}", sep="\n", file=sys.stderr)
        _end(NO_DIAGNOSIS if isinstance(error, NoDiagnosis) else BAD_INPUT, printable(error))
    except BrokenPipeError:
        _drop_output()
    except OSError as error:
        # What no command has a better word for: a name that cannot be, a terminal's log on a full disk.
        if error.errno not in (*FULL, *REFUSED):
            raise
        where = "output" if error.filename is None else str(error.filename)
        short = where if len(where) <= LONGEST_NAME else f"{where[:LONGEST_NAME]}..."
        said = f"{printable(short)}: {error.strerror}"
        with suppress(OSError):
            print(f"error: {said}", file=sys.stderr)
        _end(BAD_INPUT, said)
    except Exception as error:
        answers.finish(CRASHED, f"{type(error).__name__}: {error}")
        raise
    finally:
        answer.release()
        QUIET.reset(loud)


def _called() -> None:
    """The command, and its answer; what Typer refused, or was interrupted, ends here."""
    try:
        app()
    except Terminated:
        raise
    except SystemExit as ended:
        code, message = ended.code if isinstance(ended.code, int) else 0, ""
        if code == INTERRUPTED_CODE:
            message = INTERRUPTED
            _say_interrupted()
        answers.finish(code, message)
        raise


def _say_interrupted() -> None:
    with suppress(OSError):
        print(INTERRUPTED, file=sys.stderr)


def _end(code: int, message: str) -> NoReturn:
    """End with this exit code; an answer that nobody can read changes nothing."""
    try:
        answers.finish(code, message)
    except OSError:
        _drop_output()
    sys.exit(code)


def _drop_output() -> None:
    """What is still buffered has nowhere to go, and must not fail once more when the program ends."""
    with suppress(OSError):  # what stands for the output may be no file
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


if __name__ == "__main__":
    main()
