"""What a stage is, and how one is made: found when it exists, run when it does not."""

from __future__ import annotations

import hashlib
import os
import shlex
import zlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

import gpsim
from gpsim.artifacts import Artifact, Recipe, Store
from gpsim.errors import Terminated, UsageError
from gpsim.files import Json, written_whole
from gpsim.mjcf import files_digest
from gpsim.settings import whole
from gpsim.simulators import source_file
from gpsim.workers import WorkerDiedError

APART = ("cli", "conf", "api", "launchers", "trials")
"""Folders that no diagnosis rests on."""


def sources_digest(root: Path) -> str:
    """sha256 over the path and content of every module below `root`, those in the folders of APART left out."""
    found = [
        f"{folder}/{name}" for folder, _, names in os.walk(root) for name in names if name.endswith(".py")
    ]
    names = sorted(path.removeprefix(f"{root}/") for path in found)
    lines = [
        f"{name} {hashlib.sha256((root / name).read_bytes()).hexdigest()}\n"
        for name in names
        if name.split("/")[0] not in APART
    ]
    return hashlib.sha256("".join(lines).encode()).hexdigest()


RELEASE = f"gpsim {gpsim.__version__}"
IN_NUMBERS = ""
SOURCES = sources_digest(Path(gpsim.__file__).parent)
"""Which state of the code makes an artifact, beside its stage's format: a part of its key, so that no upgrade keeps
old answers.

RELEASE: for what is cheap to make, anew with every release. IN_NUMBERS: for trained policies, which take minutes to
hours, the format alone. SOURCES: for the diagnosis, anew with every change of the library's code; taken when the
process starts, as the code that it runs is. What is made anew to the same bytes is the same artifact to those that rest
on it (`Artifact.digest`): they are kept.
"""


def code_here() -> str:
    """Which gpsim this process runs: its release and the state of its sources."""
    return f"{gpsim.__version__} {SOURCES}"


def check_same_code(code: str) -> None:
    """Raise UsageError where this process, on another machine say, runs another gpsim than `code` names."""
    if code != code_here():
        release = code.split(" ", 1)[0]
        what = f"gpsim {gpsim.__version__}" if release != gpsim.__version__ else "another state of its code"
        raise UsageError(
            f"the worker runs {what}, the command gpsim {release}: install the same on both and restart the workers"
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
            f"{file}: ended the program (exit code {error.code}); a simulator must only return: remove exit() from it"
        ) from error
    except WorkerDiedError as error:
        if file is None or error.killed:
            raise
        raise UsageError(
            f"{file}: a worker process {error.how}, most likely in the code of this file; fix it, then run again"
        ) from error


Progress = Callable[[int, int, str], None]
"""progress(done, total, note); of no total: the note alone, which is said at once"""

LATER: Mapping[str, Mapping[str, Any]] = {
    "gp": {"noise_floor": 1e-3},
    "collect": {"transitions": None, "noise": 0.0, "missing": 0.0},
}
"""Settings that came after artifacts were made, at the value that these have: so they are still found."""


NOT_MADE = ""
"""Key and digest of what stands in for an artifact that is not made yet."""


class NotMadeError(UsageError):
    """What something rests on is not made yet; stage: which stage makes it, command: the command line that does."""

    def __init__(self, message: str, stage: str = "", command: str = "") -> None:
        super().__init__(message)
        self.stage, self.command = stage, command


def silent(done: int, total: int, note: str) -> None:
    """A progress that says nothing."""


@dataclass(frozen=True)
class Request:
    """A resolved configuration and where artifacts live.

    words: the overrides as the user typed them, for messages; number: the version to take if it is free; cores:
    processes that one stage may use; planned: parents that are not made yet are stood in for, to see what else
    differs: nothing can be made of such a recipe; looked: the shelf was looked through before, only what was made since
    counts.
    """

    config: Mapping[str, Any]
    words: tuple[str, ...] = ()
    progress: Progress = silent
    out: Path | None = None
    number: int | None = None
    cores: int = 1
    planned: bool = False
    looked: bool = False

    @property
    def store(self) -> Store:
        """The experiment's artifacts."""
        return Store(Path(str(self.config["runs_dir"])), str(self.config["experiment"]))

    @property
    def seed(self) -> int:
        """The seed of the loop."""
        return whole(self.config["seed"], "seed")

    @property
    def start_seed(self) -> int:
        """What draws the evaluation's starts and data, whatever the loop's seed."""
        return whole(self.config["evaluate"]["start_seed"], "evaluate.start_seed")

    def having(self, **values: Any) -> Request:
        """The same request with some top-level settings changed, in the words too."""
        kept = tuple(word for word in self.words if word.split("=", 1)[0] not in values)
        words = kept + tuple(f"{key}={value}" for key, value in values.items())
        return replace(
            self, config={**self.config, **values}, words=words, out=None, number=None, looked=False
        )

    def section(self, *keys: str) -> Json:
        """The named parts of the configuration: what decides a stage's bytes; of a user's simulator its file, too."""
        parts = {key: self.config[key] for key in keys}
        for key, later in LATER.items():
            if key in parts:
                parts[key] = {k: v for k, v in parts[key].items() if k not in later or v != later[k]}
        if "simulator" in parts:
            name = str(parts["simulator"]["name"])
            source = source_file(name)
            if source is not None and not source.is_file():
                raise UsageError(f"simulator.name: no file {source}; give FILE.py:ClassName")
            if (digest := files_digest(name)) is not None:
                parts["simulator"] = {**parts["simulator"], "file": digest}
        return parts


@dataclass(frozen=True)
class Stage:
    """One command. recipe(request) says what the artifact is made from; write(request, recipe, folder) makes it.

    notes(artifact) are lines for the terminal: what a person wants to know at once; remarks(request) others: what of
    the request was settled otherwise than it reads. format: to be raised when the same settings may give other content,
    so that what older code has made is not kept; code: RELEASE, IN_NUMBERS or SOURCES.
    """

    name: str
    recipe: Callable[[Request], Recipe]
    write: Callable[[Request, Recipe, Path], Json | None]
    notes: Callable[[Artifact], list[str]] = field(default=lambda artifact: [])
    remarks: Callable[[Request], list[str]] = field(default=lambda request: [], kw_only=True)
    format: int = field(kw_only=True)
    code: str = field(default=RELEASE, kw_only=True)

    def keyed(self, request: Request) -> Recipe:
        """The recipe with the state of the code that makes it: the one that artifacts are found by."""
        return replace(self.recipe(request), format=self.format, code=self.code)

    def command(self, request: Request) -> str:
        """The command line that makes this artifact."""
        return " ".join(["gpsim", self.name, *map(shlex.quote, request.words)])

    def need(self, request: Request) -> Artifact:
        """The finished artifact; a UsageError names the command that makes it."""
        found = request.store.find(self.keyed(request))
        if found is not None:
            return found
        shelf, command = request.store.shelf(self.name), self.command(request)
        if request.planned:
            return Artifact(shelf, {"stage": self.name, "key": NOT_MADE, "config": {}}, NOT_MADE)
        raise NotMadeError(
            f"{shelf}: nothing with this configuration; make it with: {command}", self.name, command
        )

    def make(self, request: Request) -> tuple[Artifact, bool]:
        """The artifact, and whether it existed already."""
        recipe, store = self.keyed(request), request.store
        if request.out is not None:
            return self._publish(request, recipe), False
        found = store.find(recipe, looked=request.looked)
        if found is not None:
            return found, True
        with store.claimed(
            recipe,
            lambda who: request.progress(0, 0, f"waiting for {who}, which is making it"),
        ):
            found = store.find(recipe, looked=request.looked)  # another process may have made it meanwhile
            return (found, True) if found is not None else (self._publish(request, recipe), False)

    def _publish(self, request: Request, recipe: Recipe) -> Artifact:
        with blamed(request.config.get("simulator", {}).get("name")):
            return request.store.publish(
                recipe,
                lambda folder: self.write(request, recipe, folder),
                out=request.out,
                number=request.number,
            )


def stage_about(
    name: str, recipe: Callable[..., Recipe], write: Callable[..., Json | None], *about: Any, **more: Any
) -> Stage:
    """A stage about something that no configuration holds: recipe(request, *about), write(request, folder, *about)."""
    return Stage(
        name,
        lambda request: recipe(request, *about),
        lambda request, recipe, folder: write(request, folder, *about),
        **more,
    )


def new_place(out: Path) -> None:
    """Raise UsageError where nothing can be made at `out`: something is there, or no folder to make it in."""
    if out.exists():
        raise UsageError(f"{out}: exists already; choose another --out")
    if not out.parent.is_dir():
        raise UsageError(f"{out.parent}: no such folder; make it first")


@contextmanager
def written_new(out: Path, ending: str = "") -> Iterator[Path]:
    """A name to write at, which becomes the new `out`; raises UsageError where that is there, or cannot be written."""
    new_place(out)
    try:
        with written_whole(out, ending) as made:
            yield made
    except OSError as error:
        raise UsageError(f"{out}: cannot be written: {error.strerror or error}") from error


def derived_seed(seed: int, purpose: str) -> int:
    """A seed of its own for every purpose, so that no two draws share a stream."""
    return int(np.random.SeedSequence([seed, zlib.crc32(purpose.encode())]).generate_state(1)[0])


def generator(seed: int, purpose: str) -> np.random.Generator:
    """A random generator of its own for every purpose."""
    return np.random.default_rng(derived_seed(seed, purpose))
