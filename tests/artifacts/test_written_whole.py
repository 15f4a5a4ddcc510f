"""Files and folders that are there whole or not at all, and plain JSON."""

import pytest

from gpsim.files import written_whole


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
