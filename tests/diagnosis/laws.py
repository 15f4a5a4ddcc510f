"""Explanations that were fitted without a search, and how much a curve explains more on held-out data."""

from __future__ import annotations

import numpy as np

from gpsim.channels import difference
from gpsim.diagnosis.data import cut, held_out_mask
from gpsim.diagnosis.fitting import Hypothesis, fit, predicted, starts_of
from gpsim.diagnosis.report import Share
from gpsim.diagnosis.setup import prepare
from gpsim.diagnosis.setup.offers import candidates
from gpsim.simulators import make_simulator

from .worlds import record

HORIZON = 50  # samples of a rollout
DRAWS = 300  # of a bootstrap


def explained_by(world, *laws, gates=(), **how):
    """The question that a recording of the world asks, and these laws (family, on) fitted to it one after another."""
    recording = record(world, **{"seed": 8, "episodes": 20, "steps": 155, **how})
    simulator = make_simulator(world.system)
    parameters = simulator.defaults(recording.parameters)
    question = prepare(recording, simulator, parameters)
    offers = candidates(recording, simulator, parameters)
    problem = question.everything
    at = fit(problem, Hypothesis(), problem.windows.measured[:, 0])
    for i, law in enumerate(laws):
        offer = next(c for c in offers if c.identity == law)
        hypotheses = [at.hypothesis.plus(offer.term(start), offer.declared) for start in starts_of(offer)]
        if gates and gates[i]:
            hypotheses = [h.gated(i, gates[i]) for h in hypotheses]
        at = min((fit(problem, h, at.starts) for h in hypotheses), key=lambda f: f.objective)
    return question, at


def explained(question, hypothesis):
    """The share of the mismatch that a hypothesis takes off on held-out rollouts."""
    return float(_shares(question, hypothesis)(slice(None)))


def gain(question, laws, curve):
    """How much more of it a curve takes off than the laws, with a bootstrap over the rollouts."""
    shares = [_shares(question, h.hypothesis) for h in (laws, curve)]
    rng, every = np.random.default_rng(0), np.arange(len(_squares(question, Hypothesis())))
    drawn = [every, *(rng.choice(every, len(every)) for _ in range(DRAWS))]
    share, *draws = (shares[1](rows) - shares[0](rows) for rows in drawn)
    return Share(float(share), *(float(x) for x in np.quantile(draws, [0.05, 0.95])))


def _shares(question, hypothesis):
    """What a hypothesis explains of the rollouts in such rows."""
    base = Hypothesis(scheme=question.recording.integrator)
    errors = [_squares(question, h) for h in (base, hypothesis)]
    noise = question.everything.floor[question.everything.observed] ** 2

    def of(rows):
        before, after = (np.maximum(e[rows].mean(axis=0) - noise, 0.0) for e in errors)
        return np.clip(1.0 - after / np.maximum(before, 1e-300), 0.0, 1.0).mean()

    return of


def _squares(question, hypothesis):
    """(W, S) mean square error of every held-out rollout, from measured starts."""
    problem, recording = question.held_out, question.recording
    windows = cut(recording, problem.run.settings.windows, HORIZON)
    windows = windows.take(held_out_mask(recording, windows))
    windows = windows.take(windows.valid[:, -1])
    said = predicted(problem, windows, hypothesis)
    error = difference(windows.measured, said, problem.simulator.state)
    return (error**2).mean(axis=1)[:, problem.observed]
