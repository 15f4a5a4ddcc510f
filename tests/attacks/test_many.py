"""Hundreds of hostile files, seeded: whatever they hold, a documented exit code and at most a few lines, no traceback."""

import numpy as np
import pandas as pd
import pytest
from attacking import all_said
from hostile_variants import MAKERS, TEXTS, variants

MANY = range(2, 32)


def check(folder, kinds, numbers):
    calls = [variant.words for kind in kinds for variant in variants(folder, kind, numbers)]
    for said in all_said(calls, folder):
        said.check()
    return len(calls)


@pytest.mark.slow
@pytest.mark.parametrize("kind", [*TEXTS, *MAKERS])
def test_many_of_a_kind(tmp_path, kind):
    if kind == "xml":
        pytest.importorskip("mujoco")
    assert check(tmp_path, [kind], range(2, 92) if kind in TEXTS else MANY) >= 30


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
