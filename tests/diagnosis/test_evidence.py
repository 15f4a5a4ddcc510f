"""Whiteness: white residuals pass as often as they should, whatever the number of windows."""

from types import SimpleNamespace

import numpy as np
import pytest

from gpsim.diagnosis.fitting import evidence
from gpsim.diagnosis.run import Run


def p_values(monkeypatch, windows, residuals):
    """Of one channel, start states not fitted."""
    problem = SimpleNamespace(
        windows=Windows(windows, residuals.shape[2]),
        observed=np.array([True]),
        counted=np.ones((windows, residuals.shape[2], 1), dtype=bool),
        counts=np.array([float(windows * residuals.shape[2])]),
        floor=np.array([0.0]),
        run=Run(),
    )
    monkeypatch.setattr(evidence, "_fitted_share", lambda *_: np.zeros((1, 3)))
    fits = (SimpleNamespace(residuals=r[..., None]) for r in residuals)
    return np.array([evidence.whiteness(problem, f)[0] for f in fits])


class Windows:
    """So many, of so many samples."""

    def __init__(self, count, samples):
        self.valid = np.ones((count, samples), dtype=bool)

    def __len__(self):
        return len(self.valid)


@pytest.mark.parametrize("windows", [3, 5, 10, 40])
def test_white_noise_is_not_called_structured(monkeypatch, windows):
    """With a normal distribution for a mean whose scatter is estimated from four windows, 18 % fell below 1e-4."""
    p = p_values(monkeypatch, windows, np.random.default_rng(3).normal(size=(1500, windows, 25)))
    assert (p < 1e-2).mean() < 0.02
    assert (p < 1e-3).mean() < 0.004


def test_structure_shows(monkeypatch):
    noise = np.random.default_rng(4).normal(size=(50, 40, 26))
    p = p_values(monkeypatch, 40, noise[..., 1:] + 0.5 * noise[..., :-1])
    assert (p < 1e-4).mean() > 0.9
