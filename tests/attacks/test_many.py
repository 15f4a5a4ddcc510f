"""Hundreds of hostile files, seeded: whatever they hold, a documented exit code and at most a few lines, no traceback."""

import numpy as np
import pandas as pd
import pytest
from attacking import all_said
from hostile_variants import TEXTS, variants


@pytest.mark.slow
@pytest.mark.parametrize("kind", TEXTS)
def test_many_of_a_kind(tmp_path, kind):
    if kind == "xml":
        pytest.importorskip("mujoco")
    for said in all_said([variant.words for variant in variants(tmp_path, kind, range(92))], tmp_path):
        said.check()


@pytest.mark.slow
def test_two_million_rows_are_imported(tmp_path):
    """A table that is merely large is no bomb."""
    t = np.arange(2_000_000) * 0.005
    wave = np.round(np.sin(t), 4)
    columns = {"t": np.round(t, 3), "x": wave, "x_dot": wave, "theta": wave, "theta_dot": wave, "force": wave}
    pd.DataFrame(columns).to_csv(tmp_path / "log.csv", index=False)
    words = ("system=cartpole", "rate=200", "--out", tmp_path / "no", "--dry-run")
    [said] = all_said([("import", tmp_path / "log.csv", *words)], tmp_path)
    said.check()
    assert said.code == 0
    assert "nothing was written" in said.out
