from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pandas as pd
import pytest


@pytest.fixture(scope="session")
def real() -> Path:
    """The folder of the real recordings; tests skip where it is absent."""
    beside = Path(__file__).resolve().parents[3] / "shared" / "recordings"
    folder = Path(os.environ.get("GPSIM_RECORDINGS", beside))
    if not folder.is_dir():
        pytest.skip(
            "the real recordings are not here (set GPSIM_RECORDINGS; data/README.md says where they are from)"
        )
    return folder


@pytest.fixture
def cartpole_log(tmp_path: Path) -> Path:
    """A table of 200 rows whose columns are called as the cart-pole's channels."""
    t = np.arange(200) * 0.02
    columns = {"t": t, "x": np.sin(t), "x_dot": np.cos(t), "theta": 0.1 * np.sin(3 * t)}
    columns |= {"theta_dot": 0.3 * np.cos(3 * t), "force": np.random.default_rng(0).normal(size=200)}
    pd.DataFrame(columns).to_csv(tmp_path / "log.csv", index=False)
    return tmp_path / "log.csv"
