"""Which hypotheses the search goes on with."""

from dataclasses import replace
from types import SimpleNamespace

import pytest

from gpsim.diagnosis.fitting.hypothesis import Hypothesis
from gpsim.diagnosis.run import Run
from gpsim.diagnosis.selection import beam as search
from gpsim.diagnosis.settings import read_settings
from gpsim.effects import EffectParameter, Gate, Term

PROBLEM = SimpleNamespace(run=Run())


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
    monkeypatch.setattr(search, "ranked", lambda problem, fits: sorted(fits, key=lambda f: f.objective))


def test_the_beam_holds_different_claims_and_one_gate():
    gated = found(-9.0, "spring", region=True)
    same = found(-8.0, "spring")
    another_gate = found(-7.0, "viscous_friction", region=True)
    plain = found(-6.0, "coulomb_friction")
    coarse = found(-5.0, "coulomb_friction", scheme="euler")
    last = found(-4.0, "quadratic_drag")
    beam = search._beam(PROBLEM, [last, coarse, plain, another_gate, same, gated], 3)
    assert [f.objective for f in beam] == [-9.0, -6.0, -4.0]


def test_a_narrower_beam_holds_fewer():
    best, other = found(-9.0, "spring"), found(-6.0, "coulomb_friction")
    assert search._beam(PROBLEM, [other, best], 1) == [best]


def test_a_search_that_goes_deeper_fits_as_many_terms_as_at_the_last_depth_that_is_named():
    settings = read_settings({"search": {"depth": 4, "fitted_per_depth": [9, 5]}})
    assert search._fitted_per_depth(settings.search) == [9, 5, 5, 5]
    assert search._fitted_per_depth(read_settings({"search": {"depth": 2}}).search) == [18, 9]


def test_the_best_in_coarse_steps_are_tried_finely(monkeypatch):
    """Delay and rate limit were met in Euler steps only, where they did worse than a wrong law in fine ones."""
    orders = []
    monkeypatch.setattr(search, "fit_all", lambda problem, given: orders.extend(given) or given)
    fine = found(-20.0, "viscous_friction")
    coarse = [found(-1.0 * i, "spring", "quadratic_drag", scheme="euler") for i in range(6)]
    search._fine_twins(PROBLEM, [fine, *coarse])
    assert len(orders) == search.FINE_TWINS
    assert {o.hypothesis.scheme for o in orders} == {"fine"}
    assert all(o.hypothesis.claims == coarse[0].hypothesis.claims for o in orders)
    assert search._fine_twins(PROBLEM, [fine]) == []
