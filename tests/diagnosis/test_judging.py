"""What held-out windows may veto."""

from types import SimpleNamespace

import numpy as np
import pytest

from gpsim.diagnosis import judging


@pytest.mark.parametrize(
    ("gain", "worse", "needed"),
    [(219.0, 2.5, True), (20.0, 2.5, False), (20.0, -0.1, True), (219.0, 15.0, False)],
)
def test_a_few_held_out_windows_do_not_veto_what_a_recording_says_plainly(monkeypatch, gain, worse, needed):
    """A delay that gained 219 nats on a sweep was once dropped for 2.5 nats on the nine windows that were held out."""
    question = SimpleNamespace(everything=None, held_out=SimpleNamespace(windows=[0] * 9))
    leader, without = SimpleNamespace(hypothesis="with"), SimpleNamespace(hypothesis="without")
    monkeypatch.setattr(judging, "pays", lambda *fits: True)
    monkeypatch.setattr(judging, "gain", lambda *fits: gain)
    monkeypatch.setattr(judging, "held_out_objective", lambda problem, said: worse if said == "with" else 0.0)
    assert judging._needed(question, leader, without) == needed


@pytest.mark.parametrize(
    ("nats", "p_value", "lacking"), [(10.0, 0.5, False), (10.0, 1e-20, True), (900.0, 0.5, True)]
)
def test_a_law_is_lacking_if_it_is_large_or_if_the_residual_is_not_white(nats, p_value, lacking):
    """A delay and a friction were once named though a rate limit of a thousand nats was left."""
    problem = SimpleNamespace(counts=np.array([1000.0]), observed=np.array([True]))
    leader, null = SimpleNamespace(variance=np.array([1.0])), SimpleNamespace(variance=np.array([101.0]))
    lack = SimpleNamespace(significant=True, nats=nats)
    assert judging._lacking(problem, leader, null, lack, p_value) == lacking
    assert not judging._lacking(problem, leader, null, SimpleNamespace(significant=False), p_value)
