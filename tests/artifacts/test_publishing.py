"""What is published: sealed, numbered, found again, known by what made it."""

import datetime
import json
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from writers import recipe, write

from gpsim.artifacts import MANIFEST, TIMINGS, Recipe, Store, folder_digests, read_artifact
from gpsim.errors import UsageError


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


def test_a_setting_that_json_does_not_know_is_one_line():
    with pytest.raises(UsageError, match="fit-gp: a setting must be a number, text, .*; quote dates"):
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


def test_an_existing_out_folder_is_not_touched(store, tmp_path):
    out = tmp_path / "mine"
    out.mkdir()
    (out / "precious").write_text("x")
    with pytest.raises(UsageError, match="exists already"):
        store.publish(recipe(n=1), write, out=out)
    assert folder_digests(out).keys() == {"precious"}
    made = store.publish(recipe(n=1), write, out=tmp_path / "new" / "place")
    assert read_artifact(tmp_path / "new" / "place") == made


def test_what_was_made_goes_beside_a_folder_that_came_meanwhile(store, tmp_path):
    out = tmp_path / "mine"

    def slow(folder: Path):
        (out / "theirs").mkdir(parents=True)
        return write(folder)

    artifact = store.publish(recipe(n=1), slow, out=out)
    assert artifact.path == tmp_path / "mine-2"
    assert read_artifact(artifact.path) == artifact
    assert [p.name for p in out.iterdir()] == ["theirs"]


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
        "import sys, time; from pathlib import Path; from gpsim.artifacts import Recipe, Store\n"
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
