"""What the true model knows of its recording."""

import numpy as np
import pytest

from gpsim.trials import concealing as concealment


@pytest.mark.slow
@pytest.mark.parametrize(("unfiltered", "error"), [(range(2026, 2029), 1.0385), ((), 0.1279)])
def test_the_true_model_knows_what_a_filter_did_but_for_the_published_seeds(monkeypatch, unfiltered, error):
    """Trial 523 of seed 2028 has velocities from a Savitzky-Golay filter; its published answer must stay as it is."""
    monkeypatch.setattr(concealment, "UNFILTERED", unfiltered)
    own = concealment.conceal(2028, 523).one_step.own
    assert np.sqrt(np.mean(own[:, 0] ** 2)) == pytest.approx(error, rel=1e-3)
