"""The README's Python, as it stands there."""

import re
import shutil
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


def python_of(page):
    return "\n".join(re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL))


def test_the_readme_needs_five_lines():
    lines = [line for line in python_of(ROOT / "README.md").splitlines() if line.strip()]
    assert len(lines) <= 5


@pytest.mark.slow
def test_the_readme_s_python_runs(tmp_path, monkeypatch, capsys):
    shutil.copytree(ROOT / "data", tmp_path / "data")
    monkeypatch.chdir(tmp_path)
    told: dict = {}
    exec(python_of(ROOT / "README.md"), told)
    assert "Coulomb friction on x" in capsys.readouterr().out
    observation, _ = told["env"].reset(seed=0)
    assert observation.shape == told["env"].observation_space.shape
