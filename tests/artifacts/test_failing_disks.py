"""A writer that fails, a full disk or a place that cannot be leave nothing half-written."""

import errno
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from writers import recipe, write

from gpsim.artifacts import Store, read_artifact
from gpsim.errors import UsageError
from gpsim.files import disk_errors


def full(*_):
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def broken(folder):
    write(folder)
    raise RuntimeError("crash")


@pytest.mark.parametrize(
    ("writer", "kind", "said"), [(broken, RuntimeError, "crash"), (full, UsageError, "no space left")]
)
def test_a_writer_that_fails_or_a_full_disk_leaves_nothing(store, writer, kind, said):
    with pytest.raises(kind, match=said):
        store.publish(recipe(n=1), writer)
    assert list((store.root / "cartpole" / "fit-gp").iterdir()) == []


def test_a_tree_that_does_not_fit_is_one_line(tmp_path):
    (tmp_path / "tree").mkdir()
    (tmp_path / "tree" / "leaf").touch()
    with pytest.raises(UsageError, match="no space left"), disk_errors(tmp_path):
        shutil.copytree(tmp_path / "tree", tmp_path / "copy", copy_function=full)


def test_a_really_full_disk_leaves_finished_artifacts_whole(tmp_path):
    """On a file size limit the kernel itself refuses to write on."""
    code = (
        "import resource, signal, sys; from pathlib import Path\n"
        "from gpsim.artifacts import Recipe, Store; from gpsim.errors import UsageError\n"
        "signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
        "store = Store(Path(sys.argv[1]), 'cartpole')\n"
        "store.publish(Recipe('s', {'n': 1}, {}, {}), lambda f: (f / 'a').write_bytes(bytes(5000)) and None)\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (6000, 6000))\n"
        "store.publish(Recipe('s', {'n': 2}, {}, {}), lambda f: (f / 'a').write_bytes(bytes(9000)) and None)\n"
    )
    ended = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path)], capture_output=True, text=True, check=False
    )
    assert "UsageError" in ended.stderr
    assert [p.name for p in (tmp_path / "cartpole" / "s").iterdir()] == ["v0001"]
    read_artifact(tmp_path / "cartpole" / "s" / "v0001")


def test_a_read_only_place_is_one_line(tmp_path):
    (tmp_path / "runs").write_text("a file where a folder should be")
    with pytest.raises(UsageError, match="choose another runs_dir"):
        Store(tmp_path / "runs", "cartpole").publish(recipe(n=1), write)


def test_a_place_that_cannot_be_is_one_line(tmp_path):
    for place in (Path("/proc/nothing"), tmp_path / ("x" * 300)):
        with pytest.raises(UsageError, match="cannot be made .*; choose another runs_dir or --out"):
            Store(place, "cartpole").publish(recipe(n=1), write)
        assert Store(place, "cartpole").find(recipe(n=1)) is None
        with pytest.raises(UsageError, match="cannot be made .*; choose another runs_dir or --out"):
            Store(tmp_path, "cartpole").publish(recipe(n=1), write, out=place / "mine")


def test_a_shelf_that_goes_away_meanwhile_is_one_line(store):
    def robbed(folder: Path):
        shutil.rmtree(store.root)
        return write(folder)

    with pytest.raises(UsageError, match="fit-gp: removed while something was written there; run again"):
        store.publish(recipe(n=1), robbed)

    def faulty(folder: Path):
        (folder / "nowhere" / "a").write_text("a")

    with pytest.raises(FileNotFoundError):  # not the folder's fault
        store.publish(recipe(n=1), faulty)
