"""YAML that stands for more than a machine holds, below --config-dir, in recording.yaml and in mappings: one line."""

import os

import pytest

from gpsim.errors import UsageError
from gpsim.recordings import check_bounded, read_yaml


def bomb(levels=9, each=9):
    """Nine lines for 9^9 values."""
    lines = ["a0: &a0 [" + ",".join(["lol"] * each) + "]"]
    lines += [f"a{i}: &a{i} [{','.join([f'*a{i - 1}'] * each)}]" for i in range(1, levels)]
    return "\n".join(lines) + "\n"


BOMBS = {
    "aliases": (bomb(), "aliases .* repeat more than 10000 values|aliases"),
    "keys": ("a: &a {b: 1}\n" + "c: " + "{x: *a, y: *a}\n" + bomb(), "aliases"),
    "itself": ("a: &a [*a]\n", "aliases|contains itself"),
    "deep": ("a: " + "[" * 100_000, "nested too deeply"),
    "deep and closed": ("a: " + "{b: " * 5000 + "1" + "}" * 5000, "nested too deeply"),
}


@pytest.mark.parametrize("name", BOMBS)
@pytest.mark.parametrize("read", [check_bounded, read_yaml])
def test_a_bomb_is_one_line(tmp_path, name, read):
    text, said = BOMBS[name]
    (tmp_path / "mine.yaml").write_text(text)
    with pytest.raises(UsageError, match=said) as refused:
        read(tmp_path / "mine.yaml")
    assert "\n" not in str(refused.value)
    assert len(str(refused.value)) < 500


@pytest.mark.parametrize("read", [check_bounded, read_yaml])
def test_what_is_no_file_or_large_is_not_read(tmp_path, read):
    os.mkfifo(tmp_path / "pipe.yaml")
    with pytest.raises(UsageError, match=r"pipe\.yaml: is not a regular file"):
        read(tmp_path / "pipe.yaml")
    with (tmp_path / "big.yaml").open("wb") as stream:
        stream.truncate(1 << 34)
    with pytest.raises(UsageError, match="the limit is"):
        read(tmp_path / "big.yaml")


@pytest.mark.parametrize(
    "text", ["a: &a {x: 1}\nb: {<<: *a}\n", "n: ${seed}\n", "a: &a [1, 2]\nb: *a\nc: *a\n", "not: [yaml", ""]
)
def test_what_other_parsers_may_read_is_left_to_them(tmp_path, text):
    (tmp_path / "mine.yaml").write_text(text)
    check_bounded(tmp_path / "mine.yaml")


def test_choices_below_config_dir_are_looked_at(tmp_path):
    from gpsim.cli.configuration import resolve

    (tmp_path / "gp").mkdir()
    (tmp_path / "gp" / "mine.yaml").write_text(bomb())
    with pytest.raises(UsageError, match=r"gp/mine\.yaml: line 5: aliases"):
        resolve(["gp=mine"], tmp_path)
    (tmp_path / "gp" / "mine.yaml").write_text("n_train: 7\n")
    assert resolve(["gp=mine"], tmp_path)["gp"]["n_train"] == 7
