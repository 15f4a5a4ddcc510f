"""Runs commands that it reads as JSON from stdin, one after the other; how each ended is a line of JSON on stdout."""

import io
import json
import sys
from contextlib import redirect_stderr, redirect_stdout, suppress

from attacking import impatient
from gpsim.cli.main import main


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


if __name__ == "__main__":
    for words in json.load(sys.stdin):
        told = json.dumps(run(words))
        with suppress(BrokenPipeError):
            print(told, flush=True)
