"""One thread per process in the tests too, as the command line does it."""

import os
from collections.abc import Callable
from pathlib import Path

import pytest

os.environ.setdefault("OMP_NUM_THREADS", "1")


def _tree(folder: Path) -> dict[str, str]:
    from gpsim.artifacts.artifact import (  # after the number of threads is set
        MANIFEST,
        TIMINGS,
        folder_digests,
    )

    found = folder_digests(folder / "runs")
    manifests = {
        p.relative_to(folder).as_posix(): p.read_text() for p in folder.glob(f"runs/*/*/v*/{MANIFEST}")
    }
    return {k: v for k, v in found.items() if not k.endswith(TIMINGS)} | manifests


@pytest.fixture(scope="session")
def tree() -> Callable[[Path], dict[str, str]]:
    """Every artifact's files below a folder's runs by path, without the wall-clock facts."""
    return _tree
