import pytest

from gpsim.artifacts import Store


@pytest.fixture
def store(tmp_path):
    return Store(tmp_path / "runs", "cartpole")
