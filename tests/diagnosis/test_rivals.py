"""Which explanations stand beside the leading one."""

from types import SimpleNamespace

import numpy as np
import pytest

from gpsim.diagnosis.fitting.hypothesis import Hypothesis
from gpsim.diagnosis.fitting.multiple_shooting import fit
from gpsim.diagnosis.judgement import judgement, rivals
from gpsim.diagnosis.run import Run
from gpsim.diagnosis.selection.gate_edges import placed
from gpsim.diagnosis.settings import RivalSettings
from gpsim.diagnosis.setup.candidates import candidates
from gpsim.diagnosis.setup.prepare import prepare
from gpsim.effects import Gate
from gpsim.simulators import make_simulator

from .worlds import World, record


def stub(name, objective=0.0, count=1):
    claims = frozenset({(name, "x")})
    hypothesis = SimpleNamespace(
        claims=claims, idle=False, scheme="fine", terms=[name] * count, parameters=[name] * count
    )
    return SimpleNamespace(hypothesis=hypothesis, name=name)


def found_by(monkeypatch, nats, later):
    """Those of a leader, with nats of each fit on training windows and by how much it is behind on held-out ones."""
    leader, *others = [stub(name) for name in nats]
    monkeypatch.setattr(rivals, "scores", lambda _, fits: np.array([nats[f.name] for f in fits]))
    monkeypatch.setattr(rivals, "_later_nats", lambda *_: lambda fit: later.get(fit.name, 0.0))
    monkeypatch.setattr(rivals, "_earned", lambda *_: True)
    monkeypatch.setattr(rivals, "pays", lambda *_: True)
    return rivals.rivals_of(SimpleNamespace(everything=SimpleNamespace(run=Run())), leader, others)[:2]


@pytest.mark.parametrize(
    ("nats", "later"),
    [
        ({"a": 0.0, "b": 130.0, "c": -1.0}, {}),
        ({"a": 0.0, "b": 5.0, "c": 1.0}, {"b": 4.0}),
        ({"a": 0.0, "b": 130.0, "c": -1.0}, {"b": 200.0}),
        ({"a": 0.0, "b": -500.0}, {}),
    ],
)
def test_probabilities_are_parts_of_one_whole(monkeypatch, nats, later):
    said, probabilities = found_by(monkeypatch, nats, later)
    assert len(probabilities) == len(said) + 1
    assert all(0.0 < p <= 1.0 for p in probabilities)
    assert sum(probabilities) <= 1.0 + 1e-12


@pytest.mark.parametrize(
    ("nats", "count", "paid", "mends"),
    [(71.6, 3, False, True), (71.6, 3, True, False), (71.6, 1, False, False), (4.0, 3, False, False)],
)
def test_a_richer_law_that_is_ahead_and_does_not_pay_is_no_rival(monkeypatch, nats, count, paid, mends):
    """Three numbers mended the last digits of dry friction, and left it `ambiguous` with probability 0.00."""
    leader, richer = stub("coulomb"), stub("stribeck", count=count)
    monkeypatch.setattr(rivals, "scores", lambda *_: np.array([0.0, nats]))
    monkeypatch.setattr(rivals, "pays", lambda *_: paid)
    assert rivals._mending(SimpleNamespace(run=Run()), leader, [richer]) == ([richer] if mends else [])


@pytest.mark.parametrize(
    ("probabilities", "which"),
    [
        ([1.0], None),
        ([0.4, 0.35, 0.25], None),
        ([0.498, 0.5], None),  # as likely
        ([0.4, 0.6], 0),
        ([0.02, 0.98], 0),
        ([0.001, 0.003, 0.996], 1),
        ([0.0, 1.0], 0),
    ],
)
def test_a_rival_that_is_far_ahead_with_held_out_windows_leads(probabilities, which):
    leader, *others = [stub(name) for name in "abcd"[: len(probabilities)]]
    assert rivals.overtaking(SimpleNamespace(run=Run()), leader, others, probabilities) is (
        None if which is None else others[which]
    )


@pytest.mark.parametrize(("count", "p", "stays"), [(1, 0.4, True), (1, 0.05, False), (3, 0.4, False)])
def test_the_simplest_leads_where_the_data_cannot_tell(count, p, stays):
    """A leader of so many numbers against one of two; odds of ten tell them apart."""
    leader, rival = stub("a", count=count), stub("b", count=2)
    found = rivals.overtaking(SimpleNamespace(run=Run()), leader, [rival], [p, 1.0 - p])
    assert (found is None) is stays


def test_what_held_out_windows_rule_out_takes_no_probability(monkeypatch):
    """Ahead by 50 nats on training windows and behind on the others: the leader once had a probability of 1e-20."""
    said, probabilities = found_by(monkeypatch, {"a": 0.0, "b": 50.0}, {"b": 4.0})
    assert said == []
    assert probabilities[0] > 0.9


def test_a_rival_whose_terms_do_not_pay_takes_no_probability(monkeypatch):
    monkeypatch.setattr(rivals, "_earned", lambda *_: False)
    leader, rival = stub("a"), stub("b")
    monkeypatch.setattr(rivals, "scores", lambda *_: np.array([0.0, 70.0]))
    monkeypatch.setattr(rivals, "pays", lambda *_: True)
    monkeypatch.setattr(rivals, "_later_nats", lambda *_: lambda fit: 0.0)
    found = rivals.rivals_of(SimpleNamespace(everything=SimpleNamespace(run=Run())), leader, [rival])
    assert found.probabilities == [1.0]
    assert found.idle == [rival]


def test_a_twin_stands_behind_the_same_edges():
    """A bias of the command does what a force does; its onset, placed less closely, had set it nats behind."""
    world = World("slider", forces={0: lambda q, v, t: 1.5 * (t >= 7.4567) + 0 * q})
    recording = record(world, seed=4, noise=0.1, episodes=6, session=True)
    slider = make_simulator("slider")
    problem = prepare(recording, slider, slider.defaults(recording.parameters)).everything
    offers = candidates(recording, slider, slider.defaults(recording.parameters))

    def since(moment, family):
        law = next(c for c in offers if c.family == family and not c.variant)
        hypothesis = Hypothesis().plus(law.term([1.5]), law.declared).gated(0, Gate(since=moment))
        return fit(problem, hypothesis, problem.windows.measured[:, 0])

    bent = min(
        (since(m, "constant_force") for m in 7.4567 + np.linspace(0.0, 0.03, 7)), key=lambda f: f.objective
    )
    leader = placed(problem, bent, 0, 1 / 50, 1e-6)
    moment = leader.hypothesis.terms[0].gate.since
    away = [since(moment + m, "actuator_bias") for m in np.geomspace(1e-5, 1e-2, 25)]
    nearly = [f for f in away if RivalSettings().tie < f.objective - leader.objective < rivals.NEARLY_AS_GOOD]
    (twin,) = rivals.behind_its_gates(problem, leader, nearly[:1])
    assert twin.objective == pytest.approx(leader.objective, abs=0.1)
    assert twin.hypothesis.claims == nearly[0].hypothesis.claims
    assert not rivals.behind_its_gates(problem, leader, [since(moment, "actuator_bias")])


def test_a_rival_that_a_part_of_the_recording_alone_supports_neither_leads_nor_counts(monkeypatch):
    """A leader of probability 1e-44 stood beside it: it was ahead, and what it says had just been taken out."""
    told = who_leads(monkeypatch, supported=False)
    assert told[1].name == "a"
    assert told[0].probabilities == [1.0]
    assert [f.name for f in told[0].idle] == ["b"]


def test_a_rival_that_all_of_the_recording_supports_leads(monkeypatch):
    told = who_leads(monkeypatch, supported=True)
    assert told[1].name == "b"
    assert told[0].probabilities[0] > 0.99


def who_leads(monkeypatch, supported):
    """Who leads of two, of which one is 40 nats ahead and settled or not, and the rivals."""
    nats = {"a": 0.0, "b": 40.0}
    leader, rival = (stub(name) for name in nats)
    for one in (leader, rival):
        one.hypothesis.names = (one.name,)
    monkeypatch.setattr(rivals, "scores", lambda _, fits: np.array([nats[f.name] for f in fits]))
    monkeypatch.setattr(rivals, "_later_nats", lambda *_: lambda fit: 0.0)
    monkeypatch.setattr(rivals, "_earned", lambda *_: True)
    monkeypatch.setattr(judgement, "_supported", lambda *_: supported)
    question = SimpleNamespace(everything=SimpleNamespace(run=Run()))
    return judgement._led(question, leader, [leader, rival], [], True)
