"""Hostile files against the command line: in this process, or hundreds of them in a child of little memory."""

import io
import json
import resource
import signal
import subprocess
import sys
from contextlib import contextmanager, redirect_stderr, redirect_stdout, suppress
from dataclasses import dataclass
from pathlib import Path

import pytest
from gpsim.cli.main import main

sys.path.append(
    str(Path(__file__).resolve().parents[1] / "recordings" / "readers")
)  # bags, mcap_writer, mutations

CODES = (0, 2, 3)  # docs/reference/exit_codes.md, of a command that nobody interrupts
LINES = 6  # of a refusal on stderr, its notes with it
PATIENCE = 60  # s of one file, on a machine that is busy; behind it a command is taken to hang
MEMORY = 6 << 30  # bytes of address space; of these the libraries take two


@dataclass(frozen=True)
class Said:
    """How a command ended. left: files that are there and were not."""

    words: tuple[str, ...]
    code: int
    out: str
    err: str
    left: tuple[str, ...] = ()

    def check(self):
        """What holds of every file, however hostile."""
        about = f"{' '.join(self.words)}\n{self.code}\n{self.err[-2000:]}"
        assert self.code in CODES, about
        assert "Traceback" not in self.out + self.err, about
        if self.code:
            assert len(self.err.splitlines()) <= LINES, about
            assert self.err.splitlines()[-1].startswith("error: "), about
            assert len(self.err) < 4000, about
        assert "\x1b" not in self.out + self.err, about
        assert not self.left, about


class Late(BaseException):
    """Not an Exception, so that nothing swallows it."""


@contextmanager
def impatient():
    def ring(*_):
        raise Late

    before = signal.signal(signal.SIGALRM, ring)
    signal.alarm(PATIENCE)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


@pytest.fixture
def gpsim(monkeypatch, capfd, tmp_path):
    """`gpsim WORDS` in this process and a folder of its own: checked as every hostile file is."""

    def run(*words):
        said = tuple(str(word) for word in words)
        monkeypatch.setattr(sys, "argv", ["gpsim", *said])
        capfd.readouterr()
        there = names(tmp_path)
        with impatient(), pytest.raises(SystemExit) as ended:
            main()
        made = Said(said, ended.value.code or 0, *capfd.readouterr(), tuple(names(tmp_path) - there))
        made.check()
        return made

    return run


def names(folder):
    """What lies in a folder, by name."""
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*")}


def all_said(calls, folder):
    """How each of many commands ended (lists of words), in children of MEMORY bytes; one that dies is its file's fault."""
    calls, ended = [tuple(map(str, call)) for call in calls], []
    there = names(folder)
    while len(ended) < len(calls):
        told = subprocess.run(
            [sys.executable, __file__],
            input=json.dumps(calls[len(ended) :]),
            capture_output=True,
            text=True,
            check=False,
            cwd=folder,
            timeout=PATIENCE * len(calls),
            preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY)),
        )
        lines = [json.loads(line) for line in told.stdout.splitlines()]
        ended += [Said(call, *line) for call, line in zip(calls[len(ended) :], lines, strict=False)]
        if len(ended) < len(calls):  # the child is gone: killed, or out of memory beyond repair
            ended.append(Said(calls[len(ended)], told.returncode, "", told.stderr[-2000:]))
    left = names(folder) - there
    assert not left, left
    return ended


def run(words):
    """[exit code, stdout, stderr] of `gpsim WORDS`."""
    out, err, code = io.StringIO(), io.StringIO(), 0
    sys.argv = ["gpsim", *words]
    try:
        with redirect_stdout(out), redirect_stderr(err), impatient():
            main()
    except SystemExit as ended:
        code = ended.code if isinstance(ended.code, int) else int(ended.code is not None)
    except BaseException as error:  # one that nothing caught is what is looked for
        code = -1
        err.write(f"{type(error).__name__}: {error}")
    return [code, out.getvalue()[-20_000:], err.getvalue()[-20_000:]]


if (
    __name__ == "__main__"
):  # the child: commands as JSON from stdin, how each ended is a line of JSON on stdout
    for words in json.load(sys.stdin):
        told = json.dumps(run(words))
        with suppress(BrokenPipeError):
            print(told, flush=True)
