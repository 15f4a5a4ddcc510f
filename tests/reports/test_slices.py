"""Slices: on a residual whose jump is known, the slice jumps where and as far as it should."""

from __future__ import annotations

import numpy as np
import pytest

from gpsim.channels import Channels
from gpsim.corrected import Features, GpCorrection
from gpsim.gp import FitSettings, Predictor, fit_outputs
from gpsim.reports.loop_figures import most_telling, residual_slice, residual_slices
from gpsim.residuals import Residuals

CHANNELS = Channels.of({"x": "m", "x_dot": "m/s", "force": "N"})
RATES = Channels.of({"x_acc": "m/s^2", "theta_acc": "rad/s^2"})


@pytest.fixture(scope="module")
def residuals() -> Residuals:
    rng = np.random.default_rng(2)
    inputs = np.column_stack([rng.normal(size=120), rng.normal(size=120), rng.choice([-10.0, 10.0], 120)])
    jump = np.sign(inputs[:, 1])
    values = np.column_stack([-9.0 * jump + 0.05 * inputs[:, 0], 14.0 * jump])
    count = np.arange(120)
    return Residuals(
        CHANNELS, RATES, inputs, values, np.zeros((120, 2)), count * 0.02, count // 30, count < 0, count
    )


def correction(residuals: Residuals, *names: str) -> GpCorrection:
    features = Features.of(names, CHANNELS)
    rng = np.random.default_rng(0)
    gps = fit_outputs(features(residuals.inputs), residuals.values, FitSettings(restarts=0), rng)
    return GpCorrection(Predictor(gps), features, "mean", True)


def test_slice_jumps_at_zero_by_as_much_as_the_truth(residuals: Residuals) -> None:
    cuts = residual_slices(
        residuals, correction(residuals, "x", "x_dot", "force", "sign(x_dot)"), np.arange(120)
    )
    for name, jump in (("x_acc", -18.0), ("theta_acc", 28.0)):
        cut = cuts[name]
        assert cut.channel == "x_dot"
        right = int(np.searchsorted(cut.grid, 0.0))
        assert cut.grid[right] - cut.grid[right - 1] < 1e-6
        assert cut.mean[right] - cut.mean[right - 1] == pytest.approx(jump, abs=0.1)
        assert np.abs(np.diff(cut.mean[:right])).max() < 0.1
        assert np.abs(np.diff(cut.mean[right:])).max() < 0.1
        assert np.abs(cut.point_errors).max() < 0.1


def test_the_slice_is_the_gp_at_medians_that_occur(residuals: Residuals) -> None:
    gp = correction(residuals, "x", "x_dot", "force", "sign(x_dot)")
    cut = residual_slice(residuals, gp, np.arange(120), "theta_acc", channel="x", points=7)
    assert cut.channel == "x"
    assert set(cut.at) == {"x_dot", "force"}
    assert all(value in residuals.inputs[:, CHANNELS.index(name)] for name, value in cut.at.items())
    line = np.array([[value, cut.at["x_dot"], cut.at["force"]] for value in cut.grid])
    mean, variance = gp.predictor.mean_and_variance(gp.features(line))
    np.testing.assert_allclose(cut.mean, mean[:, 1])
    np.testing.assert_allclose(cut.observed_std**2, variance[:, 1] + gp.predictor.noise_variances[1])


def test_most_telling_finds_steps_slopes_and_switches() -> None:
    rng = np.random.default_rng(0)
    inputs = np.column_stack([rng.normal(size=200), rng.choice([-1.0, 1.0], 200), rng.uniform(-3, 1, 200)])
    noise = 0.1 * rng.normal(size=200)
    assert most_telling(inputs, 3.0 * inputs[:, 0] + noise) == 0
    assert most_telling(inputs, 2.0 * inputs[:, 1] + noise) == 1
    assert most_telling(inputs, np.sign(inputs[:, 2]) + noise) == 2
    assert most_telling(inputs, np.zeros(200)) == 0
    assert most_telling(inputs[:1], np.ones(1)) == 0
