"""Files and folders that are there whole or not at all, and plain JSON."""

import json

import numpy as np
import pytest

from gpsim.files import plain, written_whole


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
