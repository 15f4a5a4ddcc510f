"""What held-out windows may veto."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from gpsim.diagnosis.fitting.hypothesis import Hypothesis
from gpsim.diagnosis.judgement import verdict as judging
from gpsim.diagnosis.run import Run
from gpsim.effects import EffectParameter, Gate, Term


@pytest.mark.parametrize(
    ("gain", "worse", "needed"),
    [(219.0, 2.5, True), (20.0, 2.5, False), (20.0, -0.1, True), (219.0, 15.0, False)],
)
def test_a_few_held_out_windows_do_not_veto_what_a_recording_says_plainly(monkeypatch, gain, worse, needed):
    """A delay that gained 219 nats on a sweep was once dropped for 2.5 nats on the nine windows that were held out."""
    held_out = SimpleNamespace(windows=[0] * 9, as_finely=lambda *_: held_out)
    question = SimpleNamespace(everything=SimpleNamespace(run=Run()), held_out=held_out)
    leader, without = SimpleNamespace(hypothesis="with"), SimpleNamespace(hypothesis="without")
    monkeypatch.setattr(judging, "pays", lambda *fits: True)
    monkeypatch.setattr(judging, "on_its_grid", lambda problem, less, leader: less)
    monkeypatch.setattr(judging, "gain", lambda *fits: gain)
    monkeypatch.setattr(judging, "held_out_objective", lambda problem, said: worse if said == "with" else 0.0)
    assert judging._needed(question, leader, [without]) == [needed]


@pytest.mark.parametrize(
    ("nats", "p_value", "lacking"),
    [(10.0, 0.5, False), (10.0, 1e-8, True), (900.0, 0.5, True), (0.2, 1e-20, False)],
)
def test_a_law_is_lacking_if_it_is_large_or_if_the_residual_is_not_white(nats, p_value, lacking):
    """A delay and a friction were once named though a rate limit of a thousand nats was left."""
    problem = SimpleNamespace(counts=np.array([1000.0]), observed=np.array([True]))
    leader, null = SimpleNamespace(variance=np.array([1.0])), SimpleNamespace(variance=np.array([101.0]))
    lack = SimpleNamespace(significant=True, nats=nats)
    assert judging._lacking(problem, leader, null, lack, p_value) == lacking
    assert not judging._lacking(problem, leader, null, SimpleNamespace(significant=False), p_value)


def test_terms_that_do_nothing_do_not_keep_a_hypothesis_from_leading():
    """A lag beside a gain of exactly 1 was dropped for nothing at all, 25 000 nats behind."""
    gain = EffectParameter("gain", "1", -5.0, 5.0, (0.9,), 0.2, none=1.0)
    time = EffectParameter("time_constant", "s", 0.0, 1.0, (0.1,), 0.1)
    idle, lag = (
        Term("actuator_gain", "force", {"gain": 1.0}),
        Term("actuator_lag", "force", {"time_constant": 0.06}),
    )
    both, alone = Hypothesis((lag, idle), ((time,), (gain,))), Hypothesis((lag,), ((time,),))
    assert both.idle
    assert both.working == alone
    assert alone.working is alone
    assert judging._working([both, alone, Hypothesis((idle,), ((gain,),))]) == [alone]
    assert judging._working([alone, both]) == [alone]
    late = Hypothesis((replace(lag, gate=Gate(since=2.0)), idle), ((time,), (gain,)))
    assert [len(h.terms) for h in judging._working([alone, late])] == [
        1,
        1,
    ]  # it begins later: another answer
