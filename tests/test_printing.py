"""What is printed reads as it should on any terminal."""

import io
import sys

import pytest
from gpsim.cli.answers import say


@pytest.mark.parametrize(
    ("encoding", "printed"),
    [("utf-8", "██▌ 9 ± 1 m/s² → …"), ("ascii", "### 9 ~ 1 m/s2 > ."), ("cp1252", "### 9 ~ 1 m/s2 > .")],
)
def test_a_terminal_that_lacks_a_letter_gets_another_one(monkeypatch, encoding, printed):
    """A letter for a letter: tables stay tables."""
    stream = io.TextIOWrapper(io.BytesIO(), encoding=encoding)
    monkeypatch.setattr(sys, "stdout", stream)
    say("██▌ 9 ± 1 m/s² → …")
    stream.flush()
    assert stream.buffer.getvalue().decode(encoding).rstrip() == printed
