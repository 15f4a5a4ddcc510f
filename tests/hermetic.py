"""What tests see of the machine: nothing of the user's runs/, home or environment.

A run of the whole loop leaves artifacts below the checkout's runs/, which is where a relative `runs_dir` of a process
in the checkout points: a test that looked there would depend on what its user did before.
"""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
from pathlib import Path
from typing import Any

CHECKOUT = Path(__file__).resolve().parent.parent
RUNS = CHECKOUT / "runs"
KEPT = CHECKOUT / ".pytest_cache"  # what is slow to make, kept from one session of tests to the next
BYTECODE = KEPT / "bytecode"
RECORDINGS = "GPSIM_RECORDINGS"  # the one setting that tests take from outside

CLEARED = (  # what gpsim and the libraries below it read, and would act on
    "GPSIM", "HYDRA_", "MPL", "MATPLOTLIB", "XDG_", "TORCH_", "TYPER_", "_TYPER_", "GIT_", "OMP_", "OPENBLAS_", "MKL_",
    "PYTHONPATH", "PYTHONWARNINGS", "PYTHONSTARTUP", "PYTHONHASHSEED", "SOURCE_DATE_EPOCH",
    "COLUMNS", "LINES", "NO_COLOR", "FORCE_COLOR", "CLICOLOR", "PY_COLORS", "TTY_", "GITHUB_ACTIONS",
)  # fmt: skip


def clean_environment() -> Path:
    """Make this process and all that it starts strangers here; returns the home that they get, to be removed.

    Before gpsim, NumPy or matplotlib is imported: they read the environment then.
    """
    home = Path(tempfile.mkdtemp(prefix="gpsim-tests-home-"))
    keep_bytecode()
    recordings = os.environ.get(RECORDINGS)
    for name in list(os.environ):
        if name.startswith(CLEARED):
            del os.environ[name]
    if recordings is not None:
        os.environ[RECORDINGS] = str(Path(recordings).absolute())  # tests run elsewhere
    os.environ |= {
        "HOME": str(home),
        "OMP_NUM_THREADS": "1",  # one thread a process, as the command line has it
        "OPENBLAS_NUM_THREADS": "1",
        # The list of the machine's fonts takes seconds to make.
        "MPLCONFIGDIR": str(KEPT / "matplotlib"),
        # Without the user's own settings git would not look into a checkout of somebody else, as a container's is.
        "GIT_CONFIG_GLOBAL": os.devnull,
        "GIT_CONFIG_COUNT": "1",
        "GIT_CONFIG_KEY_0": "safe.directory",
        "GIT_CONFIG_VALUE_0": "*",
    }
    return home


def keep_bytecode() -> None:
    """Where Python was told to keep no compiled modules, as in many containers, those of the tests have their own place.

    Else each of the many processes that tests start would compile torch, SciPy and pandas anew: ten seconds each.
    """
    if not sys.dont_write_bytecode:
        return
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    os.environ["PYTHONPYCACHEPREFIX"] = sys.pycache_prefix = str(BYTECODE)
    sys.dont_write_bytecode = False


def remove(home: Path) -> None:
    """The home is no longer needed, nor is what was compiled of temporary files."""
    shutil.rmtree(home, ignore_errors=True)
    shutil.rmtree(BYTECODE / Path(tempfile.gettempdir()).resolve().relative_to("/"), ignore_errors=True)


class TrespassError(AssertionError):
    """A test opened, listed or changed something of the user's."""


TOUCHING = (
    "open",
    "os.listdir",
    "os.scandir",
    "os.mkdir",
    "os.rename",
    "os.remove",
    "os.rmdir",
    "os.link",
    "os.symlink",
)


def guard_runs() -> None:
    """From now on this process cannot open, list or change anything in the checkout's runs/ by its whole path.

    A relative one cannot lead there: no test works in the checkout. What a folder's descriptor makes whole, as it does
    for whoever removes a tree, no hook is told.
    """
    inside = str(RUNS) + os.sep

    def hook(event: str, arguments: tuple[Any, ...]) -> None:
        if event not in TOUCHING:
            return
        for path in arguments[: 1 if event == "open" else 2]:
            if isinstance(path, str | bytes | os.PathLike):
                where = os.path.normpath(os.fsdecode(path))
                if where.startswith(inside) or where == str(RUNS):
                    raise TrespassError(f"a test must not touch the user's runs/: {event} {where}")

    sys.addaudithook(hook)
