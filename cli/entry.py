"""The command `gpsim`: it runs in a child process, and this one says how it ended, should nobody else.

A user's simulator, MuJoCo and other compiled code run inside a command. One of them may crash the process, or end it
by os._exit, of which no handler of Python's is told. Whoever waits for the process is told always: so one process waits
and does nothing else, not even import what the command needs. It passes on the signals that ask the command to end.
"""

from __future__ import annotations

import faulthandler
import os
import re
import signal
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import NoReturn

from gpsim import supervision
from gpsim.errors import CODE

PASSED_ON = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
CRASHED, BAD_INPUT, INTERRUPTED = 1, 2, 130  # exit codes; docs/reference/exit_codes.md
NOTHING_YET = "interrupted: nothing was begun yet"
SHOW_CURSOR = "\r\x1b[K\x1b[?25h"  # a bar that was cut off hid it
LAST_WORDS = (
    10.0  # s after its end in which a command may close what it opened; threads of a user's may never end
)


def main() -> NoReturn:
    """Entry point."""
    reading, writing = os.pipe()
    os.set_blocking(writing, False)  # a process that crashes must not wait for a reader
    signal.pthread_sigmask(signal.SIG_BLOCK, PASSED_ON)
    parent, child = os.getpid(), os.fork()
    if child == 0:
        os.close(reading)
        _command(parent, writing)
    os.close(writing)
    for number in PASSED_ON:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _passed_to(child))
    signal.pthread_sigmask(signal.SIG_UNBLOCK, PASSED_ON)
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    sys.exit(_told(code, _heard(reading)))


def _passed_to(child: int) -> Callable[[int, object], None]:
    def pass_on(number: int, frame: object) -> None:
        with suppress(ProcessLookupError):
            os.kill(child, number)

    return pass_on


def _command(parent: int, writing: int) -> NoReturn:
    """The child: the command, and a line that it has ended by itself, with its exit code."""
    for number in PASSED_ON:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _leave)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, PASSED_ON)
    supervision.listen(writing)
    if not faulthandler.is_enabled():  # who asked for it reads it
        faulthandler.enable(writing)
    code = CRASHED
    try:
        from gpsim.workers import asked_once, leave_with

        from .main import main as command

        leave_with(parent, signal.SIGTERM)
        asked_once()
        command()
        code = 0
    except SystemExit as ended:
        code = ended.code if isinstance(ended.code, int) else 0 if ended.code is None else CRASHED
        raise
    finally:
        supervision.note(supervision.ENDED, str(code))
        last = threading.Timer(LAST_WORDS, os._exit, [code])
        last.daemon = True
        last.start()
    sys.exit(0)


def _leave(number: int, frame: object) -> NoReturn:
    """Asked to end while the command is being loaded: an import cannot be interrupted without a traceback, but left."""
    for later in PASSED_ON:
        signal.signal(later, signal.SIG_IGN)
    code = INTERRUPTED if number == signal.SIGINT else CODE
    with suppress(OSError):
        os.write(2, f"{NOTHING_YET}\n".encode())
    supervision.note(supervision.ENDED, str(code))
    os._exit(code)


def _heard(reading: int) -> str:
    """All that the child said. What it started may hold the pipe yet: nobody waits for that."""
    os.set_blocking(reading, False)
    said = b""
    with suppress(BlockingIOError):
        while part := os.read(reading, 65536):
            said += part
    return said.decode(errors="replace")


def _told(code: int, said: str) -> int:
    """The exit code of a command that ended by itself; else an error line, and the code of that."""
    if ended := re.search(rf"^{supervision.ENDED} (\d+)$", said, re.MULTILINE):
        return (
            code if code >= 0 else int(ended[1])
        )  # what crashes while the interpreter closes changes nothing
    from gpsim.reports.sheets import printable

    from .answers import begin, finish

    files = re.findall(rf"^{supervision.FILE} (.*)$", said, re.MULTILINE)
    message = printable(_what_happened(code, files[-1] if files else None, said))
    with suppress(OSError):
        if sys.stderr.isatty():
            sys.stderr.write(SHOW_CURSOR)
        print(f"error: {message}", file=sys.stderr)
    code = BAD_INPUT if files or code == -signal.SIGKILL else CRASHED
    begin(sys.argv[1:])
    with suppress(OSError):
        finish(code, message)
    return code


def _what_happened(code: int, file: str | None, said: str) -> str:
    if code == -signal.SIGKILL:  # what Linux does to whoever takes too much
        return "killed (out of memory?); finished artifacts are complete; run the same command to continue"
    if code == -signal.SIGVTALRM:
        return f"{file or 'a model'}: a call did not return; correct it, or set GPSIM_LONGEST_CALL=600 (s)"
    if code >= 0:
        how = f"ended the program (exit code {code}) during a call"
        return (
            f"{how}; run the same command to continue"
            if file is None
            else f"{file}: {how}; a simulator must only return: remove exit() from it"
        )
    how = f"crashed Python ({signal.Signals(-code).name})"
    if file is None:
        return f"{how}: a bug in gpsim or in a library; run again with PYTHONFAULTHANDLER=1 to see where"
    place = re.search(rf'File "{re.escape(file)}", line (\d+) in (\S+)', said)
    where = f" at line {place[1]}, in {place[2]}" if place else ", most likely in the code of this file"
    return f"{file}: {how}{where}; fix it, then run again"


if __name__ == "__main__":
    main()
