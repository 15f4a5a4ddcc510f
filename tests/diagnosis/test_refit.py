"""Which hypotheses of the search lead on all training windows, and what held-out windows may veto."""

from dataclasses import replace
from importlib import import_module
from types import SimpleNamespace

import numpy as np
import pytest

from gpsim.diagnosis.fitting.hypothesis import Hypothesis
from gpsim.diagnosis.run import Run
from gpsim.diagnosis.selection import held_out as held_out_room
from gpsim.diagnosis.selection import pruning
from gpsim.effects import EffectParameter, Gate, Term

refit = import_module(
    "gpsim.diagnosis.selection.refit"
)  # the function of its name stands before it in the room


EVENLY, PUSHED = (2.0, 1.0, 1.5, 2.0, 2.5, 1.0, 2.0, 1.5, 1.5), (16.0, *[-0.125] * 8)


@pytest.mark.parametrize(
    ("gain", "losses", "needed"),
    [
        (219.0, (2.5,), True),
        (20.0, (2.5,), False),
        (20.0, (-0.1,), True),
        (219.0, EVENLY, False),
        (219.0, PUSHED, True),  # by hand, in one window: it contradicts no law
        (20.0, PUSHED, False),
    ],
)
def test_a_few_held_out_windows_do_not_veto_what_a_recording_says_plainly(monkeypatch, gain, losses, needed):
    """A delay that gained 219 nats on a sweep was once dropped for 2.5 nats on the nine windows that were held out."""
    held_out = SimpleNamespace(windows=losses, as_finely=lambda *_: held_out, run=Run())
    question = SimpleNamespace(everything=SimpleNamespace(run=Run()), held_out=held_out)
    leader, without = (
        SimpleNamespace(hypothesis=SimpleNamespace(label=said, names=(said,))) for said in ("with", "without")
    )
    monkeypatch.setattr(pruning, "pays", lambda *fits: True)
    monkeypatch.setattr(pruning, "on_its_grid", lambda problem, less, leader: less)
    monkeypatch.setattr(pruning, "gain", lambda *fits: gain)
    monkeypatch.setattr(pruning, "start_slopes", lambda *about: None)
    lost = {"with": np.array(losses), "without": np.zeros(len(losses))}
    monkeypatch.setattr(
        pruning,
        "held_out_fit",
        lambda problem, said, known: SimpleNamespace(objective=lost[said.label].sum(), said=said.label),
    )
    monkeypatch.setattr(held_out_room, "_losses", lambda problem, richer, poorer: lost[richer.said])
    assert pruning._needed(question, leader, [without]) == [needed]


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
    assert refit._working([both, alone, Hypothesis((idle,), ((gain,),))]) == [alone]
    assert refit._working([alone, both]) == [alone]
    late = Hypothesis((replace(lag, gate=Gate(since=2.0)), idle), ((time,), (gain,)))
    assert [len(h.terms) for h in refit._working([alone, late])] == [
        1,
        1,
    ]  # it begins later: another answer
