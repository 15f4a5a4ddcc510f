"""Where the jobs of a command run: the words `launcher=...`, which decide no artifact."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from typer.core import TyperGroup

from gpsim.errors import UsageError

from .progress import note

if TYPE_CHECKING:
    from gpsim.launchers import Launcher


def usable_cores() -> int:
    """Cores that this process may run on: fewer than the machine's in a batch job, a container or under taskset."""
    if hasattr(os, "sched_getaffinity"):  # not on macOS and Windows
        return len(os.sched_getaffinity(0)) or 1
    return os.cpu_count() or 1


CORES = usable_cores()


_WORD = re.compile(r"[+~]{0,2}launcher([.@=]|$)")
KEPT = "launcher words"


def says_where(word: str) -> bool:
    """Whether a word is about the launcher."""
    return _WORD.match(word) is not None


def refuse_launcher(command: str, words: Sequence[str]) -> None:
    """Raise UsageError for words that a command would ignore: it is one job, and runs here."""
    for word in filter(says_where, words):
        raise UsageError(
            f"{command}: {word}: one job runs here; run full-loop, sweep, prove and diagnose --each have many"
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
