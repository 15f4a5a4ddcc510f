"""`gpsim` called in this process, and what `--json` may answer."""

import json
import sys
from importlib.resources import files

import jsonschema
import pytest
from gpsim.cli.main import main

SCHEMA = json.loads((files("gpsim.cli") / "schema.json").read_text(encoding="utf-8"))
ANSWER = jsonschema.Draft202012Validator(
    SCHEMA
)  # made once: `jsonschema.validate` looks at the schema each time


def called(monkeypatch, capfd, *words):
    """Exit code, stdout and stderr of `gpsim WORDS`, whatever wrote them."""
    monkeypatch.setattr(sys, "argv", ["gpsim", *(str(word) for word in words)])
    capfd.readouterr()
    with pytest.raises(SystemExit) as ended:
        main()
    return ended.value.code or 0, *capfd.readouterr()
