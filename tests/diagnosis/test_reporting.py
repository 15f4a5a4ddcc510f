"""What the report states beside the effects: what was held out, what is left over, what a term is worth."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from gpsim.diagnosis import diagnosis
from gpsim.diagnosis.attribution import less
from gpsim.diagnosis.attribution.less import _without
from gpsim.diagnosis.fitting.hypothesis import Hypothesis
from gpsim.diagnosis.fitting.multiple_shooting import fit
from gpsim.diagnosis.judgement import judgement as judgement_module
from gpsim.diagnosis.report import OverBefore, Ratio, StepErrors
from gpsim.diagnosis.run import Run
from gpsim.diagnosis.setup.prepare import prepare
from gpsim.effects import Gate, Term
from gpsim.recordings import Episode, HeldOut
from gpsim.reports import diagnosis_page
from gpsim.residuals.split import held_out_names
from gpsim.simulators import make_simulator

from .worlds import World, record


@pytest.fixture(scope="module")
def recording():
    return record(World("slider"), episodes=12, steps=60)


def test_every_held_out_episode_is_listed_in_the_order_of_its_number(recording):
    late = replace(recording, held_out=HeldOut(episodes_from=8))
    assert held_out_names(late) == ["8", "9", "10", "11"]
    assert held_out_names(replace(recording, held_out=None)) == ["10", "11"]
    whole = recording.episodes[0]
    brief = Episode("brief", whole.t[:3], whole.states[:3], whole.actions[:2])
    short = replace(late, episodes=(*late.episodes, brief))  # too short for a window, not for a single step
    assert held_out_names(short) == ["8", "9", "10", "11", "brief"]
    last = replace(recording, episodes=recording.episodes[:2], held_out=None)
    assert held_out_names(last) == ["1"]


@pytest.mark.parametrize(
    ("terms", "p_value", "significant", "structured"),
    [
        ((), 5e-3, False, False),  # below what makes a residual white, not below what is something by itself
        ((), 0.5, True, True),
        ((), 1e-6, False, True),
        (("a term",), 0.5, False, False),
        (("a term",), 5e-3, False, True),
        (("a term",), 0.5, True, True),
    ],
)
def test_what_is_left_over_is_structured_or_chance(terms, p_value, significant, structured, monkeypatch):
    leader = SimpleNamespace(hypothesis=SimpleNamespace(terms=terms))
    lack = SimpleNamespace(significant=significant)
    monkeypatch.setattr(judgement_module, "whiteness", lambda *_: (p_value, 0.0))
    monkeypatch.setattr(judgement_module, "lack_of_fit", lambda *_: lack)
    monkeypatch.setattr(judgement_module, "lack_of_memory", lambda *_: None)
    problem = SimpleNamespace(run=Run(), simulator=make_simulator("slider"))
    assert judgement_module._left_over(problem, leader) == (p_value, lack, structured)


def test_a_term_in_a_region_is_compared_on_the_grid_that_it_makes_finer(recording, monkeypatch):
    simulator = make_simulator("slider")
    question = prepare(recording, simulator, simulator.defaults(recording.parameters))
    problem, starts = question.everything, question.everything.windows.measured[:, 0]
    null = fit(problem, Hypothesis(), starts, iterations=1)
    plain = Term("constant_force", "q", {"force": 0.1})
    regional = replace(plain, gate=Gate(region={"q": (-1.0, 1.0)}))
    asked = []

    def noted(grid, hypothesis, *given, **named):
        asked.append((grid.substeps, len(hypothesis.terms)))
        return null

    monkeypatch.setattr(less, "fit", noted)

    def without(*terms, scheme="fine"):
        asked.clear()
        hypothesis = Hypothesis(terms, ((),) * len(terms), scheme)
        found = replace(null, hypothesis=hypothesis, starts=np.array(starts))
        return _without(problem, found, null, 0)

    assert without(plain) is null  # fitted already
    assert asked == []
    without(regional)
    assert asked == [(2 * problem.substeps, 0)]
    without(regional, plain)
    assert asked == [(2 * problem.substeps, 1)]
    without(plain, regional)  # which makes it finer with and without the first one
    assert asked == [(problem.substeps, 1)]
    without(plain, scheme="euler")  # the null was fitted finely
    assert asked == [(problem.substeps, 0)]


@pytest.mark.parametrize(
    ("left", "said"),
    [
        (Ratio(0.5, 0.41, 0.6), "50 (41 to 60)"),
        (Ratio(0.5, None, None), "50"),
        (Ratio(None, None, None), ""),
    ],
)
def test_the_page_gives_every_models_share_of_the_bases_error(left, said):
    errors = StepErrors(before=1.0, after=0.5, unit="m", over_before=OverBefore(left, left, left, left))
    assert diagnosis_page._share(errors, "gp") == said
    assert diagnosis_page._share(errors, "noise_floor") == ""
    assert diagnosis_page._share(replace(errors, over_before=None), "gp") == ""


def test_progress_never_stands_still_nor_goes_back():
    told, run = [], Run()
    budget = run.budget
    steps = diagnosis._Steps(run, lambda done, total, text: told.append(done))
    tell = steps.by_budget(40, 90)
    for spent in (0.0, 3e7, 1e8, 4e8, 1e12):
        budget.spent = spent
        tell("")
    assert told[0] == 40
    assert told[-1] == 90
    assert told == sorted(set(told))
