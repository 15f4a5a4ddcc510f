"""Artifacts: immutable, whole or absent, verified when read."""

import datetime
import errno
import json
import os
import re
import shutil
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gpsim.artifacts import keys
from gpsim.artifacts.artifact import MANIFEST, TIMINGS, Recipe, folder_digests, read_artifact
from gpsim.artifacts.store import Store
from gpsim.errors import UsageError
from gpsim.files import disk_errors, plain, written_whole


def write(folder: Path):
    (folder / "a.txt").write_text("alpha")
    (folder / "deep").mkdir()
    (folder / "deep" / "b.bin").write_bytes(bytes(range(256)))
    return {"note": "fast"}


def recipe(**config):
    return Recipe("fit-gp", config, {}, {"seed": 0})


@pytest.fixture
def store(tmp_path):
    return Store(tmp_path / "runs", "cartpole")


def test_a_version_is_sealed_and_found_again(store):
    made = store.publish(recipe(n=1), write)
    assert made.path == store.root / "cartpole" / "fit-gp" / "v0001"
    assert store.find(recipe(n=1)) == made
    assert store.find(recipe(n=2)) is None
    assert store.publish(recipe(n=2), write).path.name == "v0002"
    manifest = json.loads((made.path / MANIFEST).read_text())
    assert set(manifest["files"]) == {"a.txt", "deep/b.bin"}
    assert {"stage", "config", "parents", "seeds", "packages", "git_commit", "files", "sha256"} <= set(
        manifest
    )
    assert json.loads((made.path / TIMINGS).read_text())["note"] == "fast"


def test_same_recipe_same_bytes(store, tmp_path):
    first = store.publish(recipe(n=1), write)
    second = Store(tmp_path / "elsewhere", "cartpole").publish(recipe(n=1), write)
    assert (first.path / MANIFEST).read_bytes() == (second.path / MANIFEST).read_bytes()
    assert first.digest == second.digest


def test_parents_are_part_of_the_key(store):
    parent, other = store.publish(recipe(n=1), write), store.publish(recipe(n=2), write)
    keys = {Recipe("x", {}, {"p": p}, {}).key for p in (parent, other)}
    assert len(keys) == 2


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_any_changed_byte_is_refused(tmp_path, data):
    store = Store(tmp_path / f"runs{time.monotonic_ns()}", "cartpole")
    made = store.publish(recipe(n=1), write)
    name = data.draw(st.sampled_from(["a.txt", "deep/b.bin", MANIFEST]))
    content = bytearray((made.path / name).read_bytes())
    at = data.draw(st.integers(0, len(content) - 1))
    content[at] ^= 1 << data.draw(st.integers(0, 7))
    (made.path / name).write_bytes(bytes(content))
    for read in (read_artifact, lambda _: store.find(recipe(n=1))):
        try:
            again = read(made.path)
        except UsageError as error:
            assert str(made.path) in str(error)
        else:  # white space in the manifest may change without changing what it says
            assert name == MANIFEST
            assert again == made


@pytest.mark.parametrize(
    ("old", "new"), [('"key": "', '"key": "0'), ('"key"', '"kex"'), ("{", "["), ('"sha256"', '"sha257"')]
)
def test_a_manifest_that_no_longer_says_what_it_is_is_not_passed_over(store, old, new):
    made = store.publish(recipe(n=1), write)
    manifest = made.path / MANIFEST
    manifest.write_text(manifest.read_text().replace(old, new, 1))
    for wanted in (recipe(n=1), recipe(n=2)):  # it may have been either
        with pytest.raises(UsageError, match=r"manifest\.json: (damaged|changed)"):
            store.find(wanted)
    manifest.unlink()
    with pytest.raises(UsageError, match="not an artifact"):
        store.find(recipe(n=1))


def test_missing_and_added_files_are_refused(store):
    made = store.publish(recipe(n=1), write)
    (made.path / "extra").write_text("x")
    with pytest.raises(UsageError, match="extra: added after it was written; remove that file$"):
        read_artifact(made.path)
    (made.path / "extra").unlink()
    (made.path / "a.txt").unlink()
    with pytest.raises(UsageError, match=r"a\.txt: missing"):
        store.find(recipe(n=1))
    with pytest.raises(UsageError, match="not an artifact"):
        read_artifact(store.root)


def test_the_wrong_stage_is_refused(store):
    made = store.publish(recipe(n=1), write)
    with pytest.raises(UsageError, match="made by 'fit-gp', expected an artifact of 'collect'"):
        read_artifact(made.path, "collect")


def test_a_failing_writer_leaves_nothing(store):
    def broken(folder):
        write(folder)
        raise RuntimeError("crash")

    with pytest.raises(RuntimeError):
        store.publish(recipe(n=1), broken)
    assert list((store.root / "cartpole" / "fit-gp").iterdir()) == []


def test_a_full_disk_is_one_line(store):
    def full(folder):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with pytest.raises(UsageError, match="no space left"):
        store.publish(recipe(n=1), full)
    assert list((store.root / "cartpole" / "fit-gp").iterdir()) == []


def test_a_tree_that_does_not_fit_is_one_line(tmp_path):
    (tmp_path / "tree").mkdir()
    (tmp_path / "tree" / "leaf").touch()

    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with pytest.raises(UsageError, match="no space left"), disk_errors(tmp_path):
        shutil.copytree(tmp_path / "tree", tmp_path / "copy", copy_function=full)


def test_a_really_full_disk_leaves_finished_artifacts_whole(tmp_path):
    """On a file size limit the kernel itself refuses to write on."""
    code = (
        "import resource, signal, sys; from pathlib import Path\n"
        "from gpsim.artifacts.artifact import Recipe; from gpsim.artifacts.store import Store; from gpsim.errors import UsageError\n"
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


def test_an_existing_out_folder_is_not_touched(store, tmp_path):
    out = tmp_path / "mine"
    out.mkdir()
    (out / "precious").write_text("x")
    with pytest.raises(UsageError, match="exists already"):
        store.publish(recipe(n=1), write, out=out)
    assert folder_digests(out).keys() == {"precious"}
    made = store.publish(recipe(n=1), write, out=tmp_path / "new" / "place")
    assert read_artifact(tmp_path / "new" / "place") == made


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


def test_publishing_side_by_side_never_collides(store):
    with ThreadPoolExecutor(8) as pool:
        made = list(pool.map(lambda n: store.publish(recipe(n=n), write), range(24)))
    assert {a.path.name for a in made} == {f"v{n:04d}" for n in range(1, 25)}
    for artifact in made:
        assert read_artifact(artifact.path) == artifact


def test_reserved_numbers_are_honoured_and_gaps_are_offered(store):
    assert store.publish(recipe(n=1), write, number=2).path.name == "v0002"
    free = store.free_numbers("fit-gp")
    assert [next(free), next(free)] == [1, 3]
    assert store.publish(recipe(n=2), write, number=2).path.name == "v0003"


def half_made(shelf: Path) -> list[str]:
    return sorted(p.name for p in shelf.glob(".tmp-*") if p.is_dir())


def test_what_is_being_made_is_left_alone_and_what_the_dead_left_is_swept(store, monkeypatch):
    """By a lock, not by the number of a process: another container's may be anybody's here."""
    code = (
        "import sys, time; from pathlib import Path; from gpsim.artifacts.artifact import Recipe; from gpsim.artifacts.store import Store\n"
        "def slow(folder):\n    (folder / 'a').write_text('a'); print('begun', flush=True); time.sleep(60)\n"
        "Store(Path(sys.argv[1]), 'cartpole').publish(Recipe('fit-gp', {'n': 9}, {}, {}), slow)\n"
    )
    words = [sys.executable, "-c", code, str(store.root)]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as busy:
        assert busy.stdout is not None
        assert busy.stdout.readline() == "begun\n"
        shelf = store.root / "cartpole" / "fit-gp"
        theirs = shelf / ".tmp-x"  # another program's
        theirs.mkdir()

        def gone(pid, signal):
            raise ProcessLookupError

        monkeypatch.setattr(os, "kill", gone)  # as it is where that process cannot be seen
        store.publish(recipe(n=1), write)
        monkeypatch.undo()
        assert len(half_made(shelf)) == 2
        busy.kill()
    assert len(half_made(shelf)) == 2
    store.publish(recipe(n=2), write)
    assert {p.name for p in shelf.iterdir()} == {"v0001", "v0002", ".tmp-x"}


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


def refusing(real, name: str):
    """`real`, but what is called `name` may not be read."""

    def opened(path, *arguments, **options):
        if Path(path).name == name:
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))
        return real(path, *arguments, **options)

    return opened


@pytest.mark.parametrize(
    ("where", "name"),
    [
        ((Path, "open"), "a.txt"),
        ((Path, "open"), MANIFEST),
        ((os, "scandir"), "deep"),
        ((os, "scandir"), "fit-gp"),
    ],
)
def test_what_cannot_be_read_is_one_line_and_not_called_missing(store, monkeypatch, where, name):
    store.publish(recipe(n=1), write)
    monkeypatch.setattr(*where, refusing(getattr(*where), name))
    with pytest.raises(UsageError, match=rf"{re.escape(name)}: cannot be read \(Permission denied\)"):
        store.find(recipe(n=2 if name == "fit-gp" else 1))  # the first is found without a look at the shelf


def test_a_setting_that_json_does_not_know_is_one_line():
    with pytest.raises(UsageError, match="fit-gp: a setting is neither number, text, .*; quote dates"):
        _ = recipe(day=datetime.date(2026, 1, 31)).key


def test_equal_contents_are_one_parent_whatever_commit_made_them(tmp_path, monkeypatch):
    made = []
    for commit in ("a" * 40, "b" * 40):
        monkeypatch.setattr("gpsim.artifacts.store.git_commit", lambda commit=commit: commit)
        made.append(Store(tmp_path / commit[0], "cartpole").publish(recipe(n=1), write))
    first, second = made
    assert first.manifest["git_commit"] != second.manifest["git_commit"]
    assert first.digest == second.digest == first.manifest["content_sha256"]
    assert len({Recipe("x", {}, {"p": p}, {}).key for p in made}) == 1
    # The commit is guarded all the same.
    manifest = second.path / MANIFEST
    manifest.write_text(manifest.read_text().replace("b" * 40, "c" * 40))
    with pytest.raises(UsageError, match="changed after it was written"):
        read_artifact(second.path)


def test_other_files_settings_or_parents_are_another_parent(store):
    def other(folder: Path):
        write(folder)
        (folder / "a.txt").write_text("omega")

    plain_one = store.publish(recipe(n=1), write)
    recipes = [recipe(n=2), Recipe("fit-gp", {"n": 1}, {"p": plain_one}, {"seed": 0}), recipe(n=1)]
    made = [store.publish(r, w) for r, w in zip(recipes, (write, write, other), strict=True)]
    assert len({a.digest for a in (plain_one, *made)}) == 4


def test_what_was_made_goes_beside_a_folder_that_came_meanwhile(store, tmp_path):
    out = tmp_path / "mine"

    def slow(folder: Path):
        (out / "theirs").mkdir(parents=True)
        return write(folder)

    artifact = store.publish(recipe(n=1), slow, out=out)
    assert artifact.path == tmp_path / "mine-2"
    assert read_artifact(artifact.path) == artifact
    assert [p.name for p in out.iterdir()] == ["theirs"]


def test_what_is_half_written_leaves_what_was_there(tmp_path):
    path = tmp_path / "page.html"
    path.write_text("old")

    def broken(made):
        made.write_text("ne")
        raise RuntimeError

    with pytest.raises(RuntimeError), written_whole(path) as made:
        broken(made)
    assert [p.name for p in tmp_path.iterdir()] == ["page.html"]
    assert path.read_text() == "old"
    with written_whole(path) as made:
        made.write_text("new")
        assert path.read_text() == "old"
    assert path.read_text() == "new"


def test_a_folder_is_written_whole_too_and_a_full_one_is_not_replaced(tmp_path):
    folder = tmp_path / "0001"
    with written_whole(folder) as made:
        made.mkdir()
        (made / "a").write_text("a")
    with pytest.raises(OSError, match="not empty|exists"), written_whole(folder) as made:
        made.mkdir()
    assert [p.name for p in tmp_path.iterdir()] == ["0001"]
    assert (folder / "a").read_text() == "a"


def test_plain_json_has_no_numpy_and_nothing_infinite():
    content = {
        "a": np.float64(1.5),
        2: (np.int64(3), np.bool_(True), float("inf")),
        "b": [np.float32("nan"), None, "c"],
    }
    assert plain(content) == {"a": 1.5, "2": [3, True, None], "b": [None, None, "c"]}
    assert json.loads(json.dumps(plain(content))) == plain(content)


def test_a_manifest_is_read_once_and_another_version_in_its_place_is_seen(tmp_path, monkeypatch):
    store = Store(tmp_path, "x")

    def made(n):
        return store.publish(Recipe("s", {"n": n}, {}, {}), lambda f: (f / "a").write_text(str(n)) and None)

    paths = [made(n).path for n in range(4)]
    assert store.find(Recipe("s", {"n": 8}, {}, {})) is None
    read = []
    whole = keys.read_manifest
    monkeypatch.setattr(keys, "read_manifest", lambda path: read.append(path) or whole(path))
    assert store.find(Recipe("s", {"n": 0}, {}, {})).path == paths[0]
    assert store.find(Recipe("s", {"n": 9}, {}, {})) is None
    assert read == []
    shutil.rmtree(paths[3])
    assert store.find(Recipe("s", {"n": 3}, {}, {})) is None
    assert made(9).path == paths[3]
    assert store.find(Recipe("s", {"n": 9}, {}, {})).path == paths[3]
    assert store.find(Recipe("s", {"n": 3}, {}, {})) is None


def numbered(n):
    return Recipe("s", {"n": n}, {}, {})


def test_what_has_a_marker_is_found_without_a_look_through_the_shelf(tmp_path, monkeypatch):
    store = Store(tmp_path, "x")
    first = store.publish(numbered(1), lambda f: None)
    moved = Store(tmp_path / "elsewhere", "x").publish(numbered(2), lambda f: None)
    adopted = store.adopt(moved.path, moved)
    assert store.all_marked("s")
    monkeypatch.setattr(
        "gpsim.artifacts.store.of_key", lambda *_: pytest.fail("the shelf was looked through")
    )
    assert [store.find(numbered(n)).path for n in (1, 2)] == [first.path, adopted.path]
    assert store.find(numbered(3), looked=True) is None


def test_a_marker_is_a_hint(tmp_path):
    """It may point to nothing, to another version, or be missing, as of what older releases made."""
    store = Store(tmp_path, "x")
    made = [store.publish(numbered(n), lambda f: None).path for n in range(3)]
    folder = tmp_path / ".keys/x/s"
    (folder / numbered(0).key).write_text("v0009")
    (folder / numbered(1).key).write_text("v0003")
    (folder / numbered(2).key).write_text("../s/v0001")
    assert [store.find(numbered(n)).path for n in range(3)] == made
    assert [store.find(numbered(n), looked=True) for n in range(3)] == [None] * 3
    assert not store.all_marked("s")
    shutil.rmtree(folder)
    assert not store.all_marked("s")
    assert [store.find(numbered(n)).path for n in range(3)] == made
    shutil.rmtree(made[2])
    assert store.find(numbered(2)) is None


def test_what_is_finished_has_its_marker_before(tmp_path, monkeypatch):
    """A process that is killed behind the renaming has left a version that is found."""
    store, rename = Store(tmp_path, "x"), Path.rename

    def killed(path, target):
        rename(path, target)
        raise KeyboardInterrupt

    monkeypatch.setattr(Path, "rename", killed)
    with pytest.raises(KeyboardInterrupt):
        store.publish(numbered(1), lambda f: None)
    assert store.find(numbered(1), looked=True) is not None


def test_a_checkout_tells_its_commit(monkeypatch, tmp_path):
    """Looked for where the code lies, whatever folder a command runs in; nothing outside a checkout of gpsim."""
    from gpsim.artifacts import git_commit, provenance

    root = Path(provenance.__file__).resolve().parents[2]
    known = subprocess.run(
        ["git", "-C", str(root), "rev-parse", "HEAD"], capture_output=True, text=True, check=False
    )
    expected = known.stdout.strip() if (root / ".git").exists() and known.returncode == 0 else None
    assert git_commit() == expected
    assert (root / "pyproject.toml").exists() or expected is None
    monkeypatch.setattr(provenance, "__file__", str(tmp_path / "gpsim/artifacts/provenance.py"))
    assert git_commit.__wrapped__() is None  # it is asked once a process
