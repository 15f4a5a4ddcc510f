"""What was changed, removed or cannot be read is refused when it is read."""

import errno
import os
import re
import time
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from writers import recipe, write

from gpsim.artifacts import MANIFEST, Store, read_artifact
from gpsim.errors import UsageError


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
        ((os, "open"), MANIFEST),
        ((os, "scandir"), "deep"),
        ((os, "scandir"), "fit-gp"),
    ],
)
def test_what_cannot_be_read_is_one_line_and_not_called_missing(store, monkeypatch, where, name):
    store.publish(recipe(n=1), write)
    monkeypatch.setattr(*where, refusing(getattr(*where), name))
    with pytest.raises(UsageError, match=rf"{re.escape(name)}: cannot be read \(Permission denied\)"):
        store.find(recipe(n=2 if name == "fit-gp" else 1))  # the first is found without a look at the shelf
