"""Which hypotheses the search goes on with."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from gpsim.diagnosis.fitting.hypothesis import Hypothesis
from gpsim.diagnosis.selection import beam as search
from gpsim.effects import EffectParameter, Gate, Term


def found(objective, *families, scheme="fine", region=False, numbers=0, on="q"):
    gate = Gate(region={"q": (0.0, 1.0)}) if region else Gate()
    terms = tuple(
        Term(family, on, {}, gate=gate if i == 0 else Gate(), variant="") for i, family in enumerate(families)
    )
    declared = (EffectParameter("p", "1", 0.0, 9.0, (1.0,), 1.0),) * numbers
    terms = tuple(replace(term, values={"p": 1.0} if numbers else {}) for term in terms)
    hypothesis = Hypothesis(terms, tuple(declared for _ in terms), scheme)
    return SimpleNamespace(hypothesis=hypothesis, objective=objective, starts=None)


@pytest.fixture(autouse=True)
def ranked_by_objective(monkeypatch):
    monkeypatch.setattr(search, "_ranked", lambda problem, fits: sorted(fits, key=lambda f: f.objective))


def test_the_beam_holds_different_claims_and_one_gate():
    gated = found(-9.0, "spring", region=True)
    same = found(-8.0, "spring")
    another_gate = found(-7.0, "viscous_friction", region=True)
    plain = found(-6.0, "coulomb_friction")
    coarse = found(-5.0, "coulomb_friction", scheme="euler")
    last = found(-4.0, "quadratic_drag")
    beam = search._beam(None, [last, coarse, plain, another_gate, same, gated])
    assert [f.objective for f in beam] == [-9.0, -6.0, -4.0]


def test_the_best_in_coarse_steps_are_tried_finely(monkeypatch):
    """Delay and rate limit were met in Euler steps only, where they did worse than a wrong law in fine ones."""
    orders = []
    monkeypatch.setattr(search, "fit_all", lambda problem, given: orders.extend(given) or given)
    fine = found(-20.0, "viscous_friction")
    coarse = [found(-1.0 * i, "spring", "quadratic_drag", scheme="euler") for i in range(6)]
    search._fine_twins(None, [fine, *coarse])
    assert len(orders) == search.TWINS
    assert {o.hypothesis.scheme for o in orders} == {"fine"}
    assert all(o.hypothesis.claims == coarse[0].hypothesis.claims for o in orders)
    assert search._fine_twins(None, [fine]) == []


@pytest.mark.parametrize(
    ("richer", "poorer", "won", "paid"),
    [
        (found(0.0, "stribeck_friction", numbers=3), found(0.0, "coulomb_friction"), 7.0, True),
        (found(0.0, "stribeck_friction", numbers=3), found(0.0, "coulomb_friction"), 4.5, False),
        (found(0.0, "stribeck_friction", numbers=3, on="x"), found(0.0, "coulomb_friction"), 7.0, False),
        (found(0.0, "viscous_friction"), found(0.0, "coulomb_friction"), 7.0, False),
        (found(0.0, "coulomb_friction", "spring"), found(0.0, "coulomb_friction"), 7.0, False),
        (found(0.0, "coulomb_friction", region=True), found(0.0, "coulomb_friction"), 7.0, False),
        (found(0.0, "coulomb_friction", "spring"), found(0.0, "coulomb_friction"), 11.0, True),
    ],
)
def test_a_richer_law_needs_less_than_one_more_term_where_noise_is_heavy(
    monkeypatch, richer, poorer, won, paid
):
    """Stribeck friction was once called Coulomb's, `probability 0.0001`, though it was a thousand times likelier."""
    for fit, left in ((richer, 0.99), (poorer, 1.0)):
        fit.residuals, fit.variance = np.array([left]), np.array([left])
    monkeypatch.setattr(search, "on_its_grid", lambda problem, less, more: less)
    monkeypatch.setattr(search, "_in_one_window", lambda *_: False)
    monkeypatch.setattr(search, "gain", lambda *_: won)
    monkeypatch.setattr(search, "mean_squares", lambda problem, residuals: residuals)
    monkeypatch.setattr(search, "whiteness", lambda *_: (0.5, 0.0))
    problem = SimpleNamespace(mismatch=np.array([1.0]), observed=np.array([True]))
    assert search.pays(problem, richer, poorer) == paid
