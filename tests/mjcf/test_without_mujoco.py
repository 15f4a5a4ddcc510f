"""Without MuJoCo, or with an old one, a model is refused in one line."""

import sys
from types import ModuleType

import pytest
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
