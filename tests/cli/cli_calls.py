"""`gpsim` called in this process, and the smallest budget of a loop."""

import sys

import pytest
from gpsim.cli.main import main

TINY = (
    "budget=smoke",
    "policy.total_steps=640",
    "policy.n_steps=32",
    "evaluate.episodes=12",
    "evaluate.rollouts=6",
    "certify.width=4",
)


def called(monkeypatch, capfd, *words):
    """Exit code, stdout and stderr of `gpsim WORDS`, whatever wrote them."""
    monkeypatch.setattr(sys, "argv", ["gpsim", *(str(word) for word in words)])
    capfd.readouterr()
    with pytest.raises(SystemExit) as ended:
        main()
    return ended.value.code or 0, *capfd.readouterr()
