import os
from pathlib import Path

import pytest
from by_hand import cartpole_table


@pytest.fixture(scope="session")
def real():
    """The folder of the real recordings; tests skip where it is absent."""
    beside = Path(__file__).resolve().parents[3] / "shared" / "recordings"
    folder = Path(os.environ.get("GPSIM_RECORDINGS", beside))
    if not folder.is_dir():
        pytest.skip(
            "the real recordings are not here (set GPSIM_RECORDINGS; data/README.md says where they are from)"
        )
    return folder


@pytest.fixture
def cartpole_log(tmp_path):
    """A table of 200 rows whose columns are called as the cart-pole's channels."""
    return cartpole_table(tmp_path / "log.csv")
