"""The one rule by which one hypothesis is taken over another."""

from types import SimpleNamespace

import numpy as np
import pytest

from gpsim.diagnosis.run import Run
from gpsim.diagnosis.selection import acceptance
from gpsim.diagnosis.selection.acceptance import Rule

from .test_beam import found


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
    monkeypatch.setattr(acceptance, "_of_every_joint", lambda *_: False)
    monkeypatch.setattr(acceptance, "on_its_grid", lambda problem, less, more: less)
    monkeypatch.setattr(acceptance, "_in_one_window", lambda *_: False)
    monkeypatch.setattr(acceptance, "_held", lambda *_: [0.5])
    monkeypatch.setattr(acceptance, "gain", lambda *_: won)
    monkeypatch.setattr(acceptance, "price", lambda *_: 1.0)
    monkeypatch.setattr(acceptance, "mean_squares", lambda problem, residuals: residuals)
    monkeypatch.setattr(acceptance, "whiteness", lambda *_: (0.5, 0.0))
    problem = SimpleNamespace(mismatch=np.array([1.0]), observed=np.array([True]), run=Run())
    assert acceptance.pays(problem, richer, poorer) == paid
    assert [d.taken for d in problem.run.trace.decisions] == [paid]


def weighed(monkeypatch, removed, nats, *, white=0.5, better=False, one_window=False, mismatch=1.0):
    """What is decided of a richer fit that takes so much of a variance of 1 off one channel."""
    richer = (
        found(0.0, "stribeck_friction", numbers=3)
        if better
        else found(0.0, "spring", "quadratic_drag", numbers=1)
    )
    poorer = found(0.0, "coulomb_friction" if better else "spring", numbers=1)
    for fit, left in ((richer, 1.0 - removed), (poorer, 1.0)):
        fit.residuals, fit.variance = np.array([left]), np.array([left])
    monkeypatch.setattr(acceptance, "_of_every_joint", lambda *_: False)
    monkeypatch.setattr(acceptance, "on_its_grid", lambda problem, less, more: less)
    monkeypatch.setattr(acceptance, "_in_one_window", lambda *_: one_window)
    monkeypatch.setattr(acceptance, "gain", lambda *_: nats)
    monkeypatch.setattr(acceptance, "price", lambda *_: 1.0)
    monkeypatch.setattr(acceptance, "mean_squares", lambda problem, residuals: residuals)
    monkeypatch.setattr(acceptance, "whiteness", lambda *_: (white, 0.0))
    problem = SimpleNamespace(mismatch=np.array([mismatch]), observed=np.array([True]), run=Run())
    return acceptance.accepts(problem, richer, poorer), problem.run.trace.decisions


@pytest.mark.parametrize(
    ("how", "rule", "ok", "on_trial"),
    [
        ({"removed": 0.5, "nats": 3.9}, Rule.TOO_FEW_NATS, False, False),
        ({"removed": 0.5, "nats": 99.0, "one_window": True}, Rule.ONE_WINDOW, False, False),
        ({"removed": 0.03, "nats": 4.1, "white": 0.0}, Rule.GOOD_SHARE, True, False),
        ({"removed": 0.03, "nats": 4.1, "mismatch": 1e3}, Rule.TOO_SMALL_A_SHARE, False, False),
        ({"removed": 0.01, "nats": 9.0}, Rule.TOO_SMALL_A_SHARE, False, False),
        ({"removed": 0.01, "nats": 11.0}, Rule.SLIGHT_SHARE, True, False),
        ({"removed": 0.01, "nats": 11.0, "white": 1e-3}, Rule.SLIGHT_SHARE, False, True),
        ({"removed": 0.01, "nats": 6.0, "better": True}, Rule.SLIGHT_SHARE, True, False),
        ({"removed": 0.03, "nats": 51.0, "mismatch": 1e3}, Rule.TOO_SMALL_A_SHARE, False, False),
        ({"removed": 0.03, "nats": 51.0, "better": True, "mismatch": 1e3}, Rule.BETTER_LAW, True, False),
        ({"removed": 0.03, "nats": 51.0, "better": True, "mismatch": 1e3, "white": 0.0}, Rule.BETTER_LAW, False, True),
        ({"removed": 0.03, "nats": 49.0, "better": True, "mismatch": 1e3}, Rule.TOO_SMALL_A_SHARE, False, False),
        ({"removed": 0.6, "nats": 201.0, "better": True, "mismatch": 1e9}, Rule.BETTER_LAW, True, False),
        ({"removed": 0.4, "nats": 201.0, "better": True, "mismatch": 1e9}, Rule.TOO_SMALL_A_SHARE, False, False),
        ({"removed": 0.001, "nats": 500.0}, Rule.TOO_SMALL_A_SHARE, False, False),
    ],
)  # fmt: skip
def test_every_rule_decides_where_its_docstring_says(monkeypatch, how, rule, ok, on_trial):
    decided, trace = weighed(monkeypatch, **how)
    assert (decided.rule, decided.ok, decided.on_trial) == (rule, ok, on_trial)
    assert decided.nats == how["nats"]
    assert decided.share == pytest.approx(how["removed"])
    assert [(d.rule, d.taken, d.gain) for d in trace] == [(rule.value, ok, how["nats"])]


def test_every_rule_is_numbered_in_the_docstring():
    for rule in Rule:
        assert f"`{rule.value}`" in acceptance.__doc__
