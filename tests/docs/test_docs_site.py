"""The site: `mkdocs build --strict` where mkdocs is installed; its order of pages always."""

import importlib
import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def hooks(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "docs"))
    return importlib.import_module("mkdocs_hooks")


def test_every_page_has_a_place_and_no_folder_is_forgotten(hooks):
    placed = [
        name
        for part in hooks.navigation()
        for pages in part.values()
        for name in (pages if isinstance(pages, list) else [pages])
    ]
    there = {path.relative_to(ROOT / "docs").as_posix() for path in (ROOT / "docs").rglob("*.md")}
    assert len(placed) == len(set(placed))
    assert set(placed) == there


def test_a_link_out_of_the_pages_is_plain_text(hooks):
    class File:
        src_uri = "how-to/page.md"

    class Page:
        file = File

    text = "[data](../../data/README.md) [page](report.md#a) ![p](../images/x.png) [code](../examples/a.py) [w](https://a.org)"
    said = hooks.on_page_markdown(text, page=Page)
    assert said == "data [page](report.md#a) ![p](../images/x.png) code [w](https://a.org)"


@pytest.mark.skipif(find_spec("mkdocs") is None or find_spec("material") is None, reason="needs gpsim[docs]")
def test_the_site_builds_strictly(tmp_path):
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(tmp_path / "site")]
    environment = os.environ | {"NO_MKDOCS_2_WARNING": "1"}
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "site" / "tutorial" / "first_diagnosis" / "index.html").exists()
