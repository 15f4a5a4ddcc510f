"""Where compiled code is kept, when it is asked for, and that nobody pays for it before."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from gpsim.effects import Chain
from gpsim.kernels import compiling
from gpsim.simulators import make_simulator

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
