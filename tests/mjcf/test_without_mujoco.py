"""Without MuJoCo, or with an old one, a model is refused in one line; the command line says so with exit code 2."""

import sys
from types import ModuleType

import pytest
from gpsim.cli.main import main
from mjcf_models import PENDULUM, written

from gpsim.errors import UsageError
from gpsim.mjcf import open_simulator, optional


@pytest.fixture
def forgotten():
    optional.mujoco.cache_clear()
    yield
    optional.mujoco.cache_clear()


@pytest.mark.usefixtures("forgotten")
def test_what_to_install_is_said(tmp_path, monkeypatch):
    name = written(tmp_path, PENDULUM, "unseen.xml")
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(UsageError, match=r"a MuJoCo model needs mujoco: pip install 'gpsim\[mujoco\]'"):
        open_simulator(name)


@pytest.mark.usefixtures("forgotten")
def test_an_old_one_is_told(tmp_path, monkeypatch):
    old = ModuleType("mujoco")
    old.__version__ = "3.2.1"
    monkeypatch.setitem(sys.modules, "mujoco", old)
    with pytest.raises(UsageError, match=r"needs mujoco 4 or later, installed is 3.2.1"):
        open_simulator(written(tmp_path, PENDULUM, "unseen.xml"))


def run(monkeypatch, *words):
    monkeypatch.setattr(sys, "argv", ["gpsim", *words])
    with pytest.raises(SystemExit) as ended:
        main()
    return ended.value.code


def test_simulators_are_listed_shown_and_checked(tmp_path, monkeypatch, capsys):
    name = written(tmp_path, PENDULUM)
    assert run(monkeypatch, "simulators", "list") == 0
    assert "cartpole" in capsys.readouterr().out
    assert run(monkeypatch, "simulators", "show", "pendulum") == 0
    assert "theta [N m]" in capsys.readouterr().out
    assert run(monkeypatch, "simulators", "check", name) == 0
    said = capsys.readouterr().out
    assert "own step     0.001 s" in said
    assert "rod.mass = 1.3 kg" in said
    assert run(monkeypatch, "simulators", "check", "pendulum") == 2
    assert "`check` is for MuJoCo models" in capsys.readouterr().err
    assert run(monkeypatch, "simulators", "show", str(tmp_path / "absent.xml")) == 2
    assert "no file" in capsys.readouterr().err
