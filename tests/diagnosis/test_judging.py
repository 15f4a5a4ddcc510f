"""What held-out windows may veto."""

from types import SimpleNamespace

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
