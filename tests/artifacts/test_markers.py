"""Markers find an artifact without a look through its shelf."""

import shutil
from pathlib import Path

import pytest

from gpsim.artifacts import Recipe, Store
from gpsim.artifacts import store as keeping


def test_a_manifest_is_read_once_and_another_version_in_its_place_is_seen(tmp_path, monkeypatch):
    store = Store(tmp_path, "x")

    def made(n):
        return store.publish(Recipe("s", {"n": n}, {}, {}), lambda f: (f / "a").write_text(str(n)) and None)

    paths = [made(n).path for n in range(4)]
    assert store.find(Recipe("s", {"n": 8}, {}, {})) is None
    read = []
    whole = keeping.read_manifest
    monkeypatch.setattr(keeping, "read_manifest", lambda path: read.append(path) or whole(path))
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
    second = store.publish(numbered(2), lambda f: None)
    assert store.all_marked("s")
    monkeypatch.setattr(
        "gpsim.artifacts.store.of_key", lambda *_: pytest.fail("the shelf was looked through")
    )
    assert [store.find(numbered(n)).path for n in (1, 2)] == [first.path, second.path]
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
