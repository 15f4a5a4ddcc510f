"""The verdict: how much is explained decides, not whether something is left."""

from types import SimpleNamespace

import pytest

from gpsim.diagnosis.fitting import Hypothesis
from gpsim.diagnosis.judgement.verdict import beats_the_base, verdict_of
from gpsim.diagnosis.report import Explained, Ratio, Share, StepErrors
from gpsim.diagnosis.settings import Settings
from gpsim.effects import EffectParameter, Term


def attribution(share, counts=True, roles=("headline",)):
    return SimpleNamespace(share=share, explained=Explained(rollout=share, counts=counts), roles=roles)


def hypothesis(names, gains=None):
    """Actuator gains of 0.8, or what is said, each on the place of its name; `a` also says where it acts."""
    gains = gains or {}
    terms = tuple(Term("gain", n, {"gain": gains.get(n, 0.8), "place": gains.get(n, 0.8)}) for n in names)
    declared = (
        EffectParameter("gain", "1", -5.0, 5.0, (0.9,), 0.2, none=1.0),
        EffectParameter("place", "m", -5.0, 5.0, (0.0,), 1.0, place=True),
    )
    return Hypothesis(terms=terms, declared=(declared,) * len(terms))


def judgement(terms=("a",), rivals=(), structured=True):
    """rivals: each the names of its terms, or these with their gains."""
    others = [hypothesis(names, names if isinstance(names, dict) else None) for names in rivals]
    return SimpleNamespace(
        leader=SimpleNamespace(hypothesis=hypothesis(terms)),
        rivals=[SimpleNamespace(hypothesis=other) for other in others],
        structured=structured,
    )


@pytest.mark.parametrize(
    ("share", "form", "rivals", "verdict"),
    [
        (Share(0.97, 0.95, 0.98), "holds", (), "named"),  # whatever trace is left
        (Share(0.97, 0.95, 0.98), "untested", (), "named"),
        (Share(0.97, 0.95, 0.98), "approximate", (), "partial"),
        (Share(0.97, 0.95, 0.98), "holds", [("another",)], "ambiguous"),
        (Share(0.80, 0.70, 0.89), "holds", [("another",)], "partial"),
        (Share(0.80, 0.70, 0.91), "holds", (), "named"),  # not surely less than nearly all
        (Share(0.80), "holds", (), "partial"),
        (Share(0.40, 0.30, 0.49), "holds", [("another",)], "unknown"),
        (Share(0.40, 0.30, 0.51), "holds", (), "partial"),
    ],
)
def test_the_explained_share_decides(share, form, rivals, verdict):
    assert verdict_of(judgement(rivals=rivals), attribution(share), (form,), Settings()) == verdict


def test_the_form_of_a_slight_effect_never_counts():
    worth = attribution(Share(0.97, 0.95, 0.98), roles=("headline", "slight"))
    assert verdict_of(judgement(("a", "b")), worth, ("holds", "approximate"), Settings()) == "named"


@pytest.mark.parametrize(
    ("rivals", "verdict"),
    [
        ([("a", "c")], "named"),  # it says something else of what is slight
        ([("a", "c"), ("a", "b", "d")], "named"),
        ([("a", "c"), ("c", "b")], "ambiguous"),
        ([{"a": 0.83, "c": 0.9}], "named"),  # a gain of 0.8 takes a fifth off: 0.17 is as much
        ([{"a": 0.9, "c": 0.9}], "ambiguous"),
    ],
)
def test_rivals_that_share_every_headline_effect_contest_nothing(rivals, verdict):
    worth = attribution(Share(0.97, 0.95, 0.98), roles=("headline", "slight"))
    assert verdict_of(judgement(("a", "b"), rivals), worth, ("holds", "untested"), Settings()) == verdict


def test_where_nothing_leads_every_rival_counts():
    worth = attribution(Share(0.97, 0.95, 0.98), roles=("slight",))
    assert verdict_of(judgement(("a",), [("b",)]), worth, ("untested",), Settings()) == "ambiguous"


@pytest.mark.parametrize(("structured", "counts"), [(True, False), (False, True), (True, True)])
def test_a_share_is_missed_where_there_is_something_to_explain(structured, counts):
    """A sensor 10 ms late, of its exact size: no rollout shows it, and 0.80 of the windows' noise is explained."""
    low = attribution(Share(0.80, 0.73, 0.87), counts)
    assert verdict_of(judgement(structured=structured), low, ("untested",), Settings()) == "partial"
    nothing = attribution(Share(0.80, 0.73, 0.87), counts=False)
    assert verdict_of(judgement(structured=False), nothing, ("untested",), Settings()) == "named"


@pytest.mark.parametrize(
    ("structured", "counts", "verdict"),
    [(False, True, "none"), (True, False, "none"), (True, True, "unknown"), (False, False, "none")],
)
def test_without_an_effect_something_must_be_left_that_shows(structured, counts, verdict):
    bare = judgement(terms=(), structured=structured)
    assert verdict_of(bare, attribution(Share(0.0, 0.0, 0.0), counts), (), Settings()) == verdict


def step(after, ratio, floor=0.01):
    return StepErrors(before=1.0, after=after, noise_floor=floor, unit="m/s^2", after_over_before=ratio)


@pytest.mark.parametrize(
    ("share", "errors", "told"),
    [
        (Share(0.9, 0.8, 0.95), step(0.1, Ratio(0.1, 0.08, 0.12)), True),
        (Share(0.9, 0.8, 0.95), step(2.02, Ratio(2.02, 1.8, 2.2)), False),  # every name was wrong
        (Share(0.9, 0.8, 0.95), step(1.25, Ratio(1.25, 1.1, 1.4)), True),  # perhaps not worse
        (Share(0.9, 0.8, 0.95), step(2.02, Ratio(2.02, 1.8, 2.2), floor=2.0), True),  # noise
        (Share(0.1, -0.1, 0.3), step(0.9, None), False),
        (Share(0.0), step(0.9, None), False),
    ],
)
def test_an_account_that_does_not_beat_the_base_is_not_told(share, errors, told):
    assert beats_the_base(attribution(share), [errors], Settings()) is told
