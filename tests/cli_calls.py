"""`gpsim` called in this process."""

import sys

import pytest
from gpsim.cli.main import main


def called(monkeypatch, capfd, *words):
    """Exit code, stdout and stderr of `gpsim WORDS`, whatever wrote them."""
    monkeypatch.setattr(sys, "argv", ["gpsim", *(str(word) for word in words)])
    capfd.readouterr()
    with pytest.raises(SystemExit) as ended:
        main()
    return ended.value.code or 0, *capfd.readouterr()
