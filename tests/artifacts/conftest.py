import pytest

from gpsim.artifacts.store import Store


@pytest.fixture
def store(tmp_path):
    return Store(tmp_path / "runs", "cartpole")
