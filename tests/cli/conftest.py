"""A finished loop on the smallest budget, and `gpsim` called in this process."""

import numpy as np
import pandas as pd
import pytest
from cli_calls import called
from shared_loop import finished_loop


@pytest.fixture
def gpsim(monkeypatch, capfd):
    return lambda *words: called(monkeypatch, capfd, *words)


@pytest.fixture(scope="session")
def loop(tmp_path_factory):
    """(folder with runs/, what `run full-loop --seeds 2 --json` wrote to stdout and to stderr)."""
    return finished_loop(tmp_path_factory)


@pytest.fixture
def cartpole_table(tmp_path):
    """A table of 60 rows whose columns are called as the cart-pole's channels."""
    t = np.arange(60) * 0.02
    columns = {"t": t, "x": np.sin(t), "x_dot": np.cos(t), "theta": 0.1 * np.sin(3 * t)}
    columns |= {"theta_dot": 0.3 * np.cos(3 * t), "force": np.random.default_rng(0).normal(size=60)}
    pd.DataFrame(columns).to_csv(tmp_path / "log.csv", index=False)
    return tmp_path / "log.csv"
