"""Markers find an artifact without a look through its shelf."""

import shutil
from pathlib import Path

import pytest

from gpsim.artifacts import Recipe, Store


def numbered(n):
    return Recipe("s", {"n": n}, {}, {})


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
