"""Nats between explanations are those of a linear regression that is solved directly."""

import numpy as np
import pytest
from made_posteriors import LAG_OR_DELAY, NOISE, made_machine, made_posterior

from gpsim.planning.information import separations, summed
from gpsim.planning.models import model_of


@pytest.fixture(scope="module")
def played():
    machine, rng = made_machine(), np.random.default_rng(0)
    posterior = made_posterior(*LAG_OR_DELAY)
    models = tuple(model_of(machine, e, 2, rng) for e in posterior.explanations)
    commands = rng.uniform(-1, 1, (3, 100, 1))
    said = [m.said(np.zeros((len(m.thetas), 2)), commands, np.zeros(1), 0.0)[0] for m in models]
    return models, said


def test_nats_are_what_is_left_of_the_difference_after_the_best_mimicry(played):
    models, said = played
    noise = np.array(list(NOISE.values()))
    nats = separations(models, summed(models, said, noise))[:, 0]
    for e in range(3):
        ways = []
        for a, b in ((0, 1), (1, 0)):
            gap = ((said[a][0, e] - said[b][0, e]) / noise).ravel()
            size = models[b].size
            moved = [((said[b][1 + j, e] - said[b][0, e]) / noise).ravel() for j in range(size)]
            slopes = np.stack(moved).T / models[b].nudges
            prior = np.diag(1.0 / np.sqrt(np.diag(models[b].explanation.covariance)))
            wanted = np.concatenate([gap, np.zeros(size)])
            left = np.linalg.lstsq(np.vstack([slopes, prior]), wanted, rcond=None)[1]
            ways.append(0.5 * left[0])
        assert nats[e] == pytest.approx(min(ways), rel=1e-5)
