"""What the commands print, letter by letter, and `--json`: one object on stdout, of every command."""

from __future__ import annotations

import json
import os
import re
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, TextIO

import typer
from rich.console import Console

from gpsim.errors import near
from gpsim.files import plain
from gpsim.reports.sheets import printable

from .everywhere import QUIET, Flag
from .everywhere import Path as CommandPath

SCHEMA = "gpsim.cli/1"
NAME = "as_json"
OPTION = "--json"
AsJson = Annotated[
    bool,
    typer.Option(OPTION, help="One JSON object on stdout: paths, verdict, figures; the rest on stderr."),
]
NO_LONGER_HOLDS = 4  # exit code of a watch, which has a result then
KINDS = {
    1: "internal",
    2: "bad_input",
    3: "no_diagnosis",
    NO_LONGER_HOLDS: "no_longer_holds",
    130: "interrupted",
    143: "terminated",
}
"""What went wrong, by exit code."""
INTERRUPTED_CODE = 130
STDOUT = 1  # its file descriptor


@dataclass
class Answer:
    """What will be printed. typed: `--json` is among the words; asked: it was heard; begun: a command runs."""

    typed: bool = False
    asked: bool = False
    begun: bool = False
    command: CommandPath = ()
    content: dict[str, Any] = field(default_factory=dict)
    paths: dict[str, str] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)
    refused: str = ""
    _kept: tuple[TextIO, int | None] | None = None

    def reserve(self) -> None:
        """Keep stdout for the object: whatever is printed from now on, by whomever, goes to stderr."""
        if self._kept is not None:
            return
        copy: int | None = None
        with suppress(OSError, ValueError):  # a test's stdout is no file
            sys.stdout.flush()
            if sys.stdout.fileno() == STDOUT:
                copy = os.dup(STDOUT)
                os.dup2(sys.stderr.fileno(), STDOUT)  # workers, and a user's own code in them, write there
        self._kept, sys.stdout = (sys.stdout, copy), sys.stderr

    def release(self) -> None:
        """Give stdout back."""
        if self._kept is None:
            return
        (sys.stdout, copy), self._kept = self._kept, None
        if copy is not None:
            with suppress(OSError):
                os.dup2(copy, STDOUT)
                os.close(copy)

    def object(self, code: int, message: str) -> dict[str, Any]:
        """The answer as it is printed."""
        head: dict[str, Any] = {"schema": SCHEMA, "command": " ".join(self.command), "exit_code": code}
        if code:
            error = {"kind": KINDS.get(code, "failed"), "message": message or self.refused}
            made = {"paths": self.paths} if self.paths else {}
            said = self.content if code == NO_LONGER_HOLDS else {}
            return head | {"error": error} | made | said | {"warnings": self.warnings}
        return head | {"paths": self.paths, **self.content, "warnings": self.warnings}


ANSWER: ContextVar[Answer | None] = ContextVar("answer", default=None)


def _heard(path: CommandPath) -> None:
    if (now := ANSWER.get()) is not None:
        now.asked = True


def _begins(path: CommandPath) -> None:
    if (now := ANSWER.get()) is None or not path:
        return
    now.command = path
    if now.asked:
        now.begun = True
        now.reserve()


FLAG = Flag(NAME, AsJson, _heard, _begins)


def answer(paths: Mapping[str, Path | str | None] | None = None, **content: Any) -> None:
    """Say a command's result, once or in parts. paths: what was made, by what it is; content: JSON's own types."""
    if (now := ANSWER.get()) is None:
        return
    now.paths |= {
        name: str(Path(path).absolute()) for name, path in (paths or {}).items() if path is not None
    }
    now.content |= content


def warned(line: str) -> None:
    """A line that a reader of the result has to know."""
    if (now := ANSWER.get()) is not None and line not in now.warnings:
        now.warnings.append(line)


def asked() -> bool:
    """Whether the result is wanted as JSON."""
    now = ANSWER.get()
    return now is not None and now.asked


FEW = 10  # commands of a group that are named where none is meant


@contextmanager
def refusals() -> Iterator[None]:
    """Around the reading of the command line: what Typer refuses is one line, not a frame of five."""
    try:
        yield
    except Exception as error:
        if not hasattr(error, "format_message") or type(error).__name__ == "NoArgsIsHelpError":
            raise
        line = _refusal(error)
        if (now := ANSWER.get()) is not None:
            now.refused = line
        print(f"error: {line}", file=sys.stderr)
        raise SystemExit(error.exit_code if hasattr(error, "exit_code") else 2) from None


def _refusal(error: Any) -> str:
    """What is wrong, what was meant, and where one reads on."""
    said = " ".join(str(error.format_message()).split())
    said = re.sub(r"[.;]? *(\(?Possible options:|\(?Did you mean).*$", "", said).removesuffix(".")
    context = getattr(error, "ctx", None)
    if context is None:
        return f"{said[:1].lower()}{said[1:]}"
    where = f"gpsim{context.command_path.removeprefix(context.find_root().info_name or '')}"
    command = context.command
    commands = sorted(getattr(command, "commands", {}))
    meant, more = "", f"{where} -h lists its options"
    if option := getattr(error, "option_name", None):
        known = [o[2:] for p in command.get_params(context) for o in p.opts if o.startswith("--")]
        meant = near(option.lstrip("-"), known).replace("'", "'--", 1)
    elif found := re.match("No such command '(.*)'$", said):
        meant = near(found[1], commands)
        more = f"there are: {', '.join(commands)}" if len(commands) <= FEW else f"{where} -h lists them"
    return f"{where}: {said[:1].lower()}{said[1:]}{meant}; {more}"


def begin(words: Sequence[str]) -> Answer:
    """The answer to a command line."""
    before = words[: words.index("--")] if "--" in words else words
    made = Answer(typed=OPTION in before)
    ANSWER.set(made)
    return made


def finish(code: int, message: str = "") -> None:
    """Print the object, if it is wanted: that of a finished command, or of an error."""
    now = ANSWER.get()
    if now is None or not (now.begun or (now.typed and code)):
        return
    now.release()
    ANSWER.set(None)
    print(json.dumps(plain(now.object(code, message)), allow_nan=False), flush=True)


PLAIN = str.maketrans(
    dict.fromkeys("█▉▊▋▌", "#") | dict.fromkeys("▍▎▏", ".") | dict(zip("–…·²³→±", "-.-23>~", strict=True))
)
"""For a terminal that has ASCII alone: a letter for a letter, so that tables stay tables."""


def say(line: object = "") -> None:
    """Print one line, or several, without control characters: with --json to stderr, and then not if --quiet."""
    if _nobody_reads():
        return
    text = printable(line)
    encoding = getattr(sys.stdout, "encoding", None) or "utf-8"
    try:
        text.encode(encoding)
    except UnicodeEncodeError:
        text = text.translate(PLAIN).encode(encoding, "replace").decode(encoding)
    typer.echo(text)


def say_all(lines: Iterable[object], indent: str = "") -> None:
    """Print lines, each for itself."""
    for line in lines:
        say(f"{indent}{line}")


def console(width: int | None = None, *, highlight: bool = True) -> Console:
    """Where tables are printed, as `say` prints lines."""
    return Console(width=width, highlight=highlight, quiet=_nobody_reads())


def _nobody_reads() -> bool:
    return asked() and QUIET.get()
