"""A user's code is met in a process of its own first: one that exits or crashes takes nobody with it."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable
from functools import lru_cache
from tempfile import TemporaryFile
from typing import Any

import numpy as np

from gpsim.errors import UsageError
from gpsim.simulators.calls import NoAnswerError, no_answer
from gpsim.simulators.simulator import Simulator
from gpsim.workers import leave_with

BATCHES = (1, 2, 64)  # rows that it is asked for at once
CHILD = (
    "import json, sys; given = json.load(sys.stdin); sys.path[:] = given['path']; "
    "from gpsim.simulators.first_contact import answer; from gpsim.simulators.user import load_source; "
    "answer(given, load_source)"
)


@lru_cache(maxsize=8)
def try_apart(reference: str, source: str) -> None:
    """Load and ask FILE.py:ClassName, whose file holds `source`, in another process; raises UsageError.

    It takes the start of an interpreter, and what the file itself takes to be loaded.
    """
    with TemporaryFile() as given, TemporaryFile() as said, TemporaryFile() as answered:
        content = {"reference": reference, "source": source, "path": sys.path, "parent": os.getpid()}
        given.write(json.dumps(content | {"answer": answered.fileno()}).encode())
        given.seek(0)
        code = subprocess.run(
            [sys.executable, "-I", "-X", "faulthandler", "-c", CHILD],
            stdin=given,
            stdout=subprocess.DEVNULL,
            stderr=said,
            pass_fds=(answered.fileno(),),
            check=False,
        ).returncode
        answered.seek(0)
        told: list[str] | None = json.loads(answered.read() or b"null")
        said.seek(0)
        words = said.read().decode(errors="replace")
    if told is None:
        raise UsageError(_what_happened(reference, code, words))
    if told:
        raise UsageError(told[0])


def _what_happened(reference: str, code: int, words: str) -> str:
    file = reference.rpartition(":")[0]
    if code >= 0:
        return (
            f"{file}: ended the program (exit code {code}) when it was loaded and called; a simulator must only "
            "return: remove exit() from it"
        )
    if code == -signal.SIGVTALRM:
        return no_answer(f"{file}: loaded and asked for rates, it")
    place = re.search(rf'File "{re.escape(file)}", line (\d+) in (\S+)', words)
    where = f" at line {place[1]}, in {place[2]}" if place else ""
    return (
        f"{file}: crashed Python ({signal.Signals(-code).name}){where} when it was loaded and called; correct the "
        "code that it calls"
    )


def answer(given: dict[str, Any], load: Callable[[str, str], Simulator]) -> None:
    """In the other process: load, ask, and write what was wrong, if anything, to the file that is given."""
    leave_with(given["parent"])
    wrong: list[str] = []
    try:
        _ask(load(given["reference"], given["source"]))
    except UsageError as error:
        wrong = [str(error)]
    os.write(given["answer"], json.dumps(wrong).encode())
    os._exit(0)  # what the user's code left behind, threads say, is of no interest


def _ask(simulator: Simulator) -> None:
    """Its rates at states and actions about zero; what it refuses there is no matter yet."""
    rng = np.random.default_rng(0)
    for rows in BATCHES:
        state, action = (
            rng.normal(size=(rows, len(channels))) for channels in (simulator.state, simulator.action)
        )
        with np.errstate(all="ignore"):
            try:
                simulator.rates(state, action, simulator.defaults())
            except NoAnswerError:
                raise
            except UsageError:
                continue
