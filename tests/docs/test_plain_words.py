"""Pages and messages use the field's own words, in sentences that can be read once."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "docs"))

from plain_words import LONGEST, findings, prose, spoken  # noqa: E402


def test_no_page_and_no_message_breaks_a_rule():
    done = subprocess.run(
        [sys.executable, ROOT / "docs" / "plain_words.py"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout


@pytest.mark.parametrize(
    "text",
    [
        "beyond noise lies 99 % of it",
        "a black box foresees more",
        "the rest has no name yet",
        "word " * (LONGEST + 1) + ".",
    ],
)
def test_a_riddle_is_found(text):
    assert list(findings(text))


def test_code_tables_and_short_sentences_are_left_alone():
    page = "Plain.\n\n    has no name in code\n\n| foresees | in a table |\n\n`mends` [x](foresees.md)\n"
    assert not list(findings(prose(page)))


def test_docstrings_are_no_messages(tmp_path):
    path = tmp_path / "a.py"
    path.write_text('"""A docstring."""\nSAID = "a message"\n')
    assert [text for _, text in spoken(path)] == ["a message"]
