"""Which executor, as the settings `launcher.*` say."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from gpsim.errors import UsageError
from gpsim.settings import build, choice

Announce = Callable[[str], None]
"""announce(line): of where it runs, as the dashboard's link"""


def _silent(line: str) -> None:
    """Say nothing."""


@dataclass(frozen=True)
class Local:
    """Processes of this machine."""

    processes: int


@dataclass(frozen=True)
class Dask:
    """A Dask scheduler.

    address: of one that runs, as tcp://HOST:8786; None: one is started here. workers: how many processes then; None: as
    many as `--jobs` says; dashboard: the address that its dashboard listens on. shared: whether its workers see this
    folder under the same path.
    """

    address: str | None = None
    workers: int | None = None
    dashboard: str = "127.0.0.1"
    shared: bool = True
    announce: Announce = field(default=_silent, compare=False)

    def __post_init__(self) -> None:
        if self.workers is not None and self.workers < 1:
            raise ValueError("workers: expected at least 1")


@dataclass(frozen=True)
class Slurm:
    """Workers as SLURM jobs: as many as there is work for, from `minimum` to `maximum`.

    conf/launcher/slurm.yaml says what each setting is.
    """

    queue: str | None
    account: str | None
    walltime: str
    memory: str
    cores: int
    setup: tuple[str, ...]
    directives: tuple[str, ...]
    skip: tuple[str, ...]
    minimum: int
    maximum: int
    interface: str | None
    python: str | None
    logs: str
    dashboard: str = "127.0.0.1"
    shared: bool = True
    announce: Announce = field(default=_silent, compare=False)

    def __post_init__(self) -> None:
        if self.cores < 1:
            raise ValueError("cores: expected at least 1")
        if not 0 <= self.minimum <= self.maximum or self.maximum < 1:
            raise ValueError("expected 0 <= minimum <= maximum, and a maximum of at least 1")


Launcher = Local | Dask | Slurm
NAMES = ("local", "dask", "slurm")


def launcher_from(section: Mapping[str, Any], processes: int, announce: Announce) -> Launcher:
    """The launcher that a configuration's `launcher` describes; raises UsageError.

    processes: of this machine, where it is that.
    """
    name = choice(section.get("name"), NAMES, "launcher.name")
    if name == "local":
        return build(Local, section, "launcher", processes=processes)
    needed = ("distributed", "dask_jobqueue", "cryptography")
    if missing := [package for package in needed if importlib.util.find_spec(package) is None]:
        raise UsageError(
            f"launcher={name} needs {' and '.join(missing)}; install with: pip install 'gpsim[cluster]'"
        )
    if name == "slurm":
        return build(Slurm, section, "launcher", announce=announce)
    found = build(Dask, section, "launcher", announce=announce)
    return found if found.workers is not None else replace(found, workers=processes)
