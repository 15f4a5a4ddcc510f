"""Which state of gpsim's own code makes an artifact: a part of its key, so that no upgrade keeps old answers.

Every stage has a number, its `format`, to be raised when the same settings may give other content. Beside it:

RELEASE      for what is cheap to make: anew with every release, whether somebody thought of the number or not.
IN_NUMBERS   for trained policies, which take minutes to hours: the number alone.
SOURCES      for the diagnosis, whose search changes all the time: anew with every change of the library's code.

What is made anew to the same bytes is the same artifact to those that rest on it (`Artifact.digest`): they are kept.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import gpsim
from gpsim.errors import Terminated, UsageError
from gpsim.files import file_digest
from gpsim.simulators import source_file
from gpsim.workers import WorkerDiedError

APART = ("cli", "conf", "face", "launchers", "trials")
"""Folders that no diagnosis rests on."""


def sources_digest(root: Path) -> str:
    """sha256 over the path and content of every module below `root`, those in the folders of APART left out."""
    paths = {path.relative_to(root).as_posix(): path for path in root.rglob("*.py")}
    lines = [
        f"{name} {file_digest(path)}\n"
        for name, path in sorted(paths.items())
        if name.split("/")[0] not in APART
    ]
    return hashlib.sha256("".join(lines).encode()).hexdigest()


RELEASE = f"gpsim {gpsim.__version__}"
IN_NUMBERS = ""
SOURCES = sources_digest(Path(gpsim.__file__).parent)
"""Taken when the process starts, as the code that it runs is: files that change meanwhile change neither."""


def code_here() -> str:
    """Which gpsim this process runs: its release and the state of its sources."""
    return f"{gpsim.__version__} {SOURCES}"


def check_same_code(code: str) -> None:
    """Raise UsageError where this process, on another machine say, runs another gpsim than `code` names."""
    if code != code_here():
        release = code.split(" ", 1)[0]
        what = f"gpsim {gpsim.__version__}" if release != gpsim.__version__ else "another state of its code"
        raise UsageError(
            f"the worker runs {what}, the command gpsim {release}: install the same on both, and start the workers anew"
        )


@contextmanager
def blamed(simulator: object) -> Iterator[None]:
    """Within it what ends this process or crashes a worker is one line that names the file of a user's simulator."""
    file = source_file(simulator) if isinstance(simulator, str) else None
    try:
        yield
    except Terminated:
        raise
    except SystemExit as error:
        if file is None:
            raise
        raise UsageError(
            f"{file}: ended the program (exit code {error.code}); a simulator only returns: take exit() out of it"
        ) from error
    except WorkerDiedError as error:
        if file is None or error.killed:
            raise
        raise UsageError(
            f"{file}: a worker process {error.how}, most likely in the code of this file; fix it, then run again"
        ) from error
