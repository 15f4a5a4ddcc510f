"""Every test runs in an empty folder of its own, with a home of its own, and cannot reach the user's runs/."""

import os
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from blank import blank
from hermetic import CHECKOUT, clean_environment, guard_runs, remove

IN_WORKER = "PYTEST_XDIST_WORKER" in os.environ  # which has the environment of the process that started it
HOME = None if IN_WORKER else clean_environment()  # at once: what test modules import reads it
guard_runs()
if IN_WORKER and hasattr(os, "sched_setaffinity"):
    # A core each: what a test starts then takes no more processes than that by itself, and none waits for another's.
    mine = sorted(os.sched_getaffinity(0))
    os.sched_setaffinity(0, {mine[int(os.environ["PYTEST_XDIST_WORKER"].removeprefix("gw")) % len(mine)]})


# Half a minute or more each: begun first, so that no process ends alone with one of them.
LONG = (
    "diagnosis/test_named.py", "cli/test_json.py", "trials/test_outside_kinds.py", "trials/test_blind.py",
    "mjcf/test_whole_robots.py", "api/test_diagnosis.py", "diagnosis/test_form.py", "trials/test_truth.py",
)  # fmt: skip


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    items.sort(key=lambda item: not item.path.as_posix().endswith(LONG))


def pytest_unconfigure() -> None:
    if HOME is not None:
        remove(HOME)


@pytest.fixture(scope="session", autouse=True)
def _elsewhere(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Fixtures of a module or of the session do not work in the checkout either."""
    os.chdir(tmp_path_factory.mktemp("elsewhere"))
    yield
    os.chdir(CHECKOUT)


@pytest.fixture(autouse=True)
def _in_its_own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A relative path, as runs/ is, is one of this test alone."""
    monkeypatch.chdir(tmp_path)


@pytest.fixture(scope="module", autouse=True)
def _sketched(request: pytest.FixtureRequest) -> Iterator[None]:
    """Figures are made and not drawn, but in modules marked `pictures`: that takes longer than a small diagnosis."""
    if any(mark.name == "pictures" for mark in request.node.own_markers):
        yield
        return
    from matplotlib.figure import Figure  # as in `_tree`

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(Figure, "savefig", blank)
        yield


@pytest.fixture
def own_files() -> Iterator[None]:
    """For tests of what lies behind the command line and the public functions, where the user has named the files."""
    from gpsim.trust import trusting  # as in `_tree`

    with trusting():
        yield


def _tree(folder: Path) -> dict[str, str]:
    from gpsim.artifacts import (  # after the number of threads is set
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
