"""Where compiled code is kept, when it is asked for, and that nobody pays for it before."""

import os
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from drawn_chains import windows_of

from gpsim.diagnosis.fitting import Hypothesis
from gpsim.diagnosis.run import Run
from gpsim.diagnosis.settings import read_settings
from gpsim.effects import Chain
from gpsim.kernels import compiling, marching
from gpsim.simulators import make_simulator

simulating = import_module("gpsim.diagnosis.fitting.simulate")  # the package has a function of that name
SLIDER = make_simulator("slider")
CHAIN = Chain(SLIDER, SLIDER.defaults(), (), "fine", 0.02)


def test_it_is_kept_in_the_package(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    assert compiling.folder().parent == Path(compiling.__file__).parent / "__pycache__"


def test_where_the_package_may_not_be_written_to_it_is_kept_in_the_users_cache(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    closed(monkeypatch, tmp_path)
    assert compiling.folder().parent == tmp_path / "cache" / "gpsim"


def closed(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """The package may not be written to."""
    (tmp_path / "__pycache__").write_text("a file, not a folder")
    monkeypatch.setattr(compiling, "ROOM", tmp_path)


@pytest.fixture
def temporary(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """A temporary folder of all users', the only place that may be written to."""
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    closed(monkeypatch, tmp_path)
    (tmp_path / "cache").write_text("a file, not a folder")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    made = tmp_path / "tmp"
    made.mkdir()
    made.chmod(0o1777)
    monkeypatch.setattr(compiling.tempfile, "gettempdir", lambda: str(made))
    compiling._say_once.cache_clear()
    return made


def test_else_it_is_kept_in_a_temporary_folder_of_ones_own(temporary: Path) -> None:
    found = compiling.folder()
    assert found is not None
    assert found.parent == temporary / f"gpsim-{os.getuid()}"
    assert [path.stat().st_mode & 0o777 for path in (found, found.parent)] == [0o700, 0o700]
    assert compiling.folder() == found


@pytest.mark.parametrize("what", ["open", "link", "another's", "not sticky"])
def test_what_others_can_write_to_is_not_run(
    temporary: Path, monkeypatch: pytest.MonkeyPatch, what: str
) -> None:
    """Whoever makes the folder first would choose what runs."""
    taken = temporary / f"gpsim-{os.getuid()}"
    if what == "link":
        taken.symlink_to(temporary)
    elif what == "not sticky":
        temporary.chmod(0o777)
    else:
        taken.mkdir()
        taken.chmod(0o777 if what == "open" else 0o755)
    if what == "another's":
        uid = os.getuid()
        monkeypatch.setattr(os, "getuid", lambda: uid + 1)
        taken.rename(temporary / f"gpsim-{uid + 1}")
    with pytest.warns(UserWarning, match=r"cannot be stored.*NUMBA_CACHE_DIR"):
        assert compiling.folder() is None
    assert compiling.folder() is None  # said once: a second warning would be an error


def test_what_is_kept_nowhere_is_compiled_all_the_same(
    temporary: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    temporary.chmod(0o777)
    with pytest.warns(UserWarning, match="cannot be stored"):
        twice = compiling.entry("float64(float64)")(lambda x: 2.0 * x)
    assert twice(3.0) == 6.0
    assert not list(temporary.iterdir())


def test_a_law_that_changes_is_compiled_anew(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    (tmp_path / "laws.py").write_text("1")
    monkeypatch.setattr(compiling, "ROOM", tmp_path)
    before = compiling.folder()
    (tmp_path / "laws.py").write_text("2")
    assert compiling.folder() != before
    assert before.parent == tmp_path


def test_nobody_pays_for_it_who_simulates_nothing() -> None:
    code = "import sys, gpsim.diagnosis, gpsim.kernels; sys.exit('numba' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def compiles(monkeypatch: pytest.MonkeyPatch, run: Run) -> bool:
    """Whether a simulation of windows asks compiled code."""
    asked, simulated = [], simulating.by_compiled_code
    monkeypatch.setattr(simulating, "by_compiled_code", lambda *given: asked.append(1) or simulated(*given))
    windows, what = windows_of(SLIDER, np.random.default_rng(0)), np.empty((1, 0))
    simulating.simulate(run, CHAIN, windows, windows.measured[None, :, 0], Hypothesis().spread, what, 1)
    return bool(asked)


def test_a_setting_turns_it_off(monkeypatch: pytest.MonkeyPatch) -> None:
    assert compiles(monkeypatch, Run())
    assert not compiles(monkeypatch, Run(read_settings({"windows": {"compiled": False}})))


def test_without_numba_it_is_numpy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(marching, "find_spec", lambda name: None)
    marching.can_compile.cache_clear()
    try:
        assert not compiles(monkeypatch, Run())
    finally:
        marching.can_compile.cache_clear()


@pytest.mark.parametrize("at", [0.3, -2.0, 1e3, -7.7e5])
def test_sine_and_cosine_are_good_to_the_last_bits(at: float) -> None:
    from gpsim.kernels.lanes import ANGLE, COS, LANES, SIN, SIZE
    from gpsim.kernels.systems import sine_and_cosine

    b = np.zeros(SIZE)
    angles = at + np.linspace(0.0, 4 * np.pi, LANES)
    b[ANGLE : ANGLE + LANES] = angles
    sine_and_cosine.py_func(b, LANES)
    np.testing.assert_allclose(b[SIN : SIN + LANES], np.sin(angles), rtol=0, atol=5e-16)
    np.testing.assert_allclose(b[COS : COS + LANES], np.cos(angles), rtol=0, atol=5e-16)
