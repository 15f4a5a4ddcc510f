"""`import gpsim`: lazy, listed, documented, and the page and the examples of the docs are what the code does."""

import doctest
import importlib
import importlib.util
import inspect
import subprocess
import sys
from pathlib import Path

import pytest

import gpsim
from gpsim.doors import places

ROOT = Path(__file__).resolve().parents[2]
HEAVY = ("torch", "matplotlib", "hydra", "omegaconf", "typer", "pandas", "scipy", "gymnasium", "numpy")


def run(code):
    return subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    ).stdout.strip()


def test_importing_gpsim_loads_nothing():
    said = run(f"import sys, gpsim; dir(gpsim); print([m for m in {HEAVY} if m in sys.modules])")
    assert said == "[]"


def test_no_name_loads_what_trains_or_reads_configurations():
    """Nor is matplotlib loaded before a diagnosis is drawn."""
    code = (
        "import sys, gpsim; [getattr(gpsim, name) for name in gpsim.__all__];"
        "print([m for m in ('torch', 'matplotlib', 'hydra', 'omegaconf', 'typer') if m in sys.modules])"
    )
    assert run(code) == "[]"


def test_the_command_line_does_not_load_the_api():
    code = "import sys, gpsim.cli.main; print(sorted(m for m in sys.modules if m.startswith('gpsim.api')))"
    assert run(code) == "['gpsim.api', 'gpsim.api.registration']"


def test_names_are_there_and_others_are_not():
    assert set(gpsim.__all__) <= set(dir(gpsim))
    assert sorted(gpsim.__all__) == gpsim.__all__
    for name in gpsim.__all__:
        assert getattr(gpsim, name) is getattr(gpsim, name)
    with pytest.raises(AttributeError, match="module 'gpsim' has no attribute 'diagnoze'"):
        gpsim.diagnoze  # noqa: B018
    assert gpsim.UsageError is gpsim.errors.UsageError
    assert "coulomb_friction" in gpsim.effects.FAMILIES


def test_every_public_name_has_its_place():
    assert set(places("gpsim")) | {"__version__"} == set(gpsim.__all__)


@pytest.mark.parametrize("name", [n for n in gpsim.__all__ if n != "__version__"])
def test_every_name_is_documented(name):
    thing = getattr(gpsim, name)
    assert len(inspect.getdoc(thing) or "") > 30
    if inspect.isfunction(thing):
        check_documented(thing)
    elif inspect.isclass(thing) and thing.__module__.startswith("gpsim.api"):
        for member, value in vars(thing).items():
            if not member.startswith("_") and (callable(value) or isinstance(value, property | classmethod)):
                assert inspect.getdoc(value), member
                if not isinstance(value, property):
                    check_documented(
                        value.__func__ if isinstance(value, classmethod) else value, example=False
                    )


def check_documented(function, example=True):
    """A line for each argument, where there are several, what is returned and raised, and an example."""
    text = inspect.getdoc(function)
    names = [n for n in inspect.signature(function).parameters if n not in ("self", "cls")]
    signature = inspect.signature(function)
    assert signature.return_annotation is not signature.empty
    for name in names:
        assert signature.parameters[name].annotation is not signature.empty, name
        if "Args:" in text:
            assert f"    {name}: " in text, name
    if example:
        assert all(part in text for part in ("Args:", "Returns:", "Raises:", "Example:"))


def test_the_page_is_current():
    spec = importlib.util.spec_from_file_location(
        "python_page", ROOT / "docs" / "generators" / "python_page.py"
    )
    page = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(page)
    assert (ROOT / "docs/reference/python.md").read_text(encoding="utf-8") == page.page()
    grouped = [name for names in page.GROUPS.values() for name in names]
    assert sorted([*grouped, "__version__"]) == gpsim.__all__


@pytest.mark.parametrize("module", sorted(set(places("gpsim").values())))
@pytest.mark.filterwarnings("ignore::UserWarning")
def test_the_examples_do_what_they_say(module, here):
    results = doctest.testmod(importlib.import_module(module), raise_on_error=False)
    assert results.failed == 0
    if module.startswith("gpsim.api"):
        assert results.attempted
