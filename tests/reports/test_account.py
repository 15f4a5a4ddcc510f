"""The account: what each verdict says, of which figures, and what it keeps to itself."""

from __future__ import annotations

from dataclasses import replace

import pytest
from made_diagnoses import made_diagnosis, made_effect, made_location, made_remainder
from rich_diagnoses import (
    RICH,
    TELL,
    ambiguous,
    friction,
    gain,
    named,
    partial,
    share,
    size,
    unknown,
    viscous,
)

from gpsim.diagnosis import Diagnosis
from gpsim.findings import Combination, Explained, LogFact, Odds, Share
from gpsim.reports.account import account_of
from gpsim.reports.account_lines import account_lines
from gpsim.reports.statistics_text import effects_sheet, statistics

SURE = replace(named(), combinations=())
VAGUE = viscous(parameters={"damping": size(1.0, 0.6, "N s/m")}, form="holds")
HELD = friction(parameters={"force": size(8.7, 0.1, "N", at_bound=True)})


def said(diagnosis, **given):
    return " ".join(" ".join(account_lines(account_of(diagnosis, **given))).split())


@pytest.mark.parametrize(
    ("verdict", "words"),
    [
        ("named", "named: the effects below explain 97 % (95 to 98) of the mismatch; no other"),
        ("ambiguous", "97 % (95 to 98) of the mismatch, but these data cannot tell it apart from another"),
        ("partial", "93 % (88 to 96) of the mismatch, but the law of viscous friction on x holds only approximately"),
        ("unknown", "unknown: something is missing; the best explanation covers 21 % (10 to 34) of it"),
        ("none", "none: nothing is missing that this recording could show"),
    ],
)  # fmt: skip
def test_the_verdict_says_how_much_is_explained(verdict, words):
    assert words in said(RICH[verdict]())


def test_a_partial_account_whose_laws_hold_says_that_the_rest_has_no_name():
    held = replace(partial(), effects=(friction(),))
    assert "Coulomb friction on x explains 93 % (88 to 96) of the mismatch; the rest is unexplained" in said(
        held
    )


@pytest.mark.parametrize(
    ("judged_on", "words"),
    [("cross-fitted rollouts", "cross-fitted"), ("fit windows", "on its own training data")],
)
def test_what_the_share_is_judged_on_is_said_where_it_is_not_held_out(judged_on, words):
    found = Explained(rollout=Share(0.97), judged_on=judged_on)
    assert words in account_of(replace(named(), explained=found)).sentence
    assert words not in account_of(named()).sentence
    assert "97 % of the mismatch" in account_of(replace(named(), explained=found)).sentence  # no interval


def test_headline_effects_stand_by_importance_and_slight_ones_apart():
    account = account_of(named())
    assert [row.effect for row in account.rows] == ["Coulomb friction on x", "viscous friction on x"]
    assert [row.percent for row in account.rows] == ["74 %", "19 %"]
    assert [row.certainty for row in account.rows] == ["sure", "120 to 1"]
    assert (
        account.slight == "small corrections, not claims: actuator gain on force (0.930 ± 0.012 times, 1 %)"
    )
    assert account.slight in said(named())


def test_what_is_no_claim_and_makes_much_of_the_mismatch_is_not_called_small():
    redundant = gain(importance=Share(0.4, 0.2, 0.6))
    slight = account_of(replace(named(), effects=(friction(), redundant))).slight
    assert slight.startswith("not claims, because other effects could replace them: actuator gain on force")


def test_only_the_forms_of_headline_effects_count():
    bent = replace(named(), verdict="partial", effects=(friction(), gain(form="approximate")))
    assert "roughly" not in said(bent)


@pytest.mark.parametrize(
    ("form", "words"), [("holds", "yes"), ("approximate", "roughly"), ("untested", "not tested")]
)
def test_whether_a_law_holds_is_said_in_words(form, words):
    (row,) = account_of(replace(named(), effects=(friction(form=form),))).rows
    assert row.law == words


def test_an_unknown_mismatch_has_no_names():
    """Whatever a file of an earlier version holds: an account that explains too little is not told."""
    found = replace(unknown(), effects=(friction(),))
    account = account_of(found)
    assert (account.rows, account.slight, account.rivals) == ((), "", ())
    told = said(found)
    assert "friction" not in told
    assert (
        "98 % of the mismatch is unexplained, most of it in theta_acc; it changes with theta_dot and force"
        in told
    )
    assert "What" not in told.split()


def test_what_all_explanations_share_stands_apart():
    certain, undecided = account_of(ambiguous()).rivals
    assert certain.endswith(": viscous friction on x")
    assert undecided == (
        "either Coulomb friction on x and actuator gain on force (62 %) or actuator dead zone on force (38 %); "
        "the table shows the likeliest"
    )


def test_rivals_that_claim_the_same_are_no_alternatives_to_weigh():
    shown = account_of(replace(named(), alternatives=ambiguous().alternatives))
    assert "differ in small corrections only" in shown.sentence
    assert not list(shown.rivals)


def test_where_much_has_no_name_that_is_said_whatever_the_laws_do():
    short = Explained(rollout=Share(0.66, 0.58, 0.73))
    shown = account_of(replace(partial(), explained=short)).sentence
    assert "the rest is unexplained" in shown
    assert "only approximately" not in shown


def test_what_only_a_statistician_asks_is_no_part_of_the_account():
    for make in RICH.values():
        told = said(make())
        assert " nats" not in told
        assert "e-1" not in told
        assert "p =" not in told
    below = " ".join(statistics(partial()))
    assert "p = 8.7e-154" in below
    assert len(effects_sheet(partial()).rows) == 4


def test_what_is_left_says_how_much_where_and_on_what_it_depends():
    first, *others = account_of(partial()).left
    assert first == "7 % of the mismatch is unexplained, most of it in theta_acc; it changes with theta_dot"
    assert "the log: the clock jitters by 0.4 ms" in others
    assert "one step ahead only 28 % of theta_acc is explained" in others
    first, *_ = account_of(replace(partial(), remainder=made_remainder(structured=True))).left
    assert first == "7 % of the mismatch is unexplained"


def test_facts_of_the_log_and_combinations_are_left_too():
    left = account_of(named()).left
    assert (
        "the log: 3 samples of theta repeat the one before, theta is quantised to 0.001 rad and 12 samples of x leap "
        "and were left out"
    ) in left
    assert "only cart_mass / force gain = 2.50 (2.40 to 2.60) is fixed; both may be scaled alike" in left


@pytest.mark.parametrize(
    ("found", "said"),
    [
        (ambiguous(), TELL),
        (partial(), "record theta_dot over its whole range"),
        (named(), "measure cart_mass or force gain on its own: motion alone fixes only a combination"),
        (SURE, "use it: no further recording would change this account"),
        (replace(SURE, effects=(friction(), VAGUE)), "record more of what viscous friction on x does: its size is known"),
        (replace(SURE, effects=(HELD,)), "record more of what Coulomb friction on x does: its size is at the limit"),
        (replace(SURE, remainder=made_remainder(structured=True)), "use it"),
        (replace(SURE, verdict="partial", remainder=made_remainder(structured=True)), "record slow and fast sweeps of every command"),
    ],
)  # fmt: skip
def test_the_next_recording_is_the_one_that_would_help_most(found, said):
    (line,) = account_of(found).next
    assert line.startswith(said)


@pytest.mark.parametrize(
    ("make", "folder", "simulator", "command"),
    [
        (named, "runs/found", None, "gpsim train-gp-policy diagnosis=runs/found"),
        (named, "runs/found", "unicycle", "gpsim train-gp-policy experiment=limo diagnosis=runs/found"),
        (partial, "runs/found", None, "gpsim train-gp-policy diagnosis=runs/found correction=effects+gp"),
        (named, "runs/found", "slider", "python: gpsim.Diagnosis.load('runs/found').corrected()"),
        (named, "runs/found", "tank()", "python: gpsim.Diagnosis.load('runs/found', simulator).corrected()"),
        (named, "my log", "robots/arm.urdf", "gpsim export model 'my log' --out robot_corrected.xml"),
        (named, "my log", None, "gpsim train-gp-policy 'diagnosis=my log'"),
        (RICH["none"], "runs/found", None, None),
        (lambda: replace(unknown(), remainder=made_remainder(structured=True)), "runs/found", None, None),
    ],
)
def test_the_command_trains_in_what_was_found(make, folder, simulator, command):
    assert account_of(make(), folder, simulator).command == command


def test_errors_stand_before_and_after():
    one, rollout = account_of(named()).fit
    assert [change.said for change in one.changes] == [
        "9.2 → 0.11 m/s² (noise 0.099)",
        "13 → 2.0 rad/s² (noise 1.8)",
    ]
    assert rollout.title == "after 1 s"
    assert rollout.changes[0].said == "0.62 → 0.010 m"
    assert account_of(RICH["none"]()).fit[1].changes[0].said == "0.62 m"
    assert account_of(unknown()).fit[1].changes[0].said == "0.62 → 0.056 m"  # by the Gaussian process
    assert "diverged → diverged" in said(made_diagnosis(verdict="named", effects=(made_effect(),)))


def test_files_of_the_first_version_are_told_as_far_as_they_go():
    """Without shares, roles, forms and curves."""
    new = {"explained", "curves", "combinations", "log_facts"}
    content = {key: part for key, part in named().to_dict().items() if key not in new}
    content["schema"] = "gpsim.diagnosis/1"
    for effect in content["effects"]:
        for key in ("importance", "needed", "role", "form"):
            del effect[key]
    for key in ("share", "rate"):
        del content["remainder"][key]
    told = said(Diagnosis.from_dict(content))
    assert "named: the effects below explain the mismatch; no other explanation does as well." in told
    assert "Coulomb friction on x 8.71 ± 0.06 N – sure not tested" in told
    assert "nan" not in told.lower()
    assert "None" not in told


def test_an_effect_among_others_says_where_it_acts():
    gated = friction(region={"x": (-1.1, -0.4)}, since=63.6)
    alone = account_of(replace(named(), effects=(gated,)))
    assert alone.rows[0].gate == ""  # which `where` says already
    both = account_of(replace(named(), effects=(gated, viscous())))
    assert both.rows[0].gate == "only where x in [-1.1, -0.4], since t = 63.60 s"
    place = made_location(channels={"x_acc": 0.9}, region={"x": (-1.1, -0.4)}, since=63.6)
    assert "only where x in [-1.1, -0.4]; since t = 63.60 s" in said(replace(named(), location=place))


def test_words_that_a_file_holds_are_kept():
    own = replace(
        named(),
        combinations=(
            Combination(of=("cart_mass", "force gain"), fixed="their ratio", open="both scaled alike"),
        ),
        log_facts=("it rained",),
        facts=(LogFact("late", "x", value=0.03, unit="s"),),
    )
    left = account_of(own).left
    assert "the log: it rained" in left
    assert "of cart_mass and force gain only their ratio is fixed; both scaled alike" in left


def test_an_effect_that_the_odds_leave_open_names_what_could_replace_it():
    drag = (("quadratic_drag", "x"),)
    (row,) = account_of(replace(named(), effects=(friction(odds=Odds(0.2, drag)),))).rows
    assert (row.certainty, row.instead) == ("undecided", "cannot be told apart from quadratic drag on x")
    (row,) = account_of(replace(named(), effects=(friction(odds=Odds(4.0, drag)),))).rows
    assert (row.certainty, row.instead) == ("55 to 1", "")


def test_importance_decides_the_order_and_is_no_claim_where_it_is_nothing():
    rows = account_of(replace(named(), effects=(viscous(importance=share(-0.02)), friction()))).rows
    assert [row.percent for row in rows] == ["74 %", "-2 %"]


def test_what_slight_effects_explain_is_not_credited_to_the_one_claim():
    """Cart friction of 66 % was said to explain 99.7 %, a delay of 43 % to explain 85 %."""
    alone = named().effects[0]
    beside = replace(gain(), role="slight")
    assert "the effects below explain" in said(replace(named(), effects=(alone, beside)))
    assert "the effects below explain" not in said(replace(named(), effects=(alone,)))


def test_what_is_slight_is_not_certain_though_all_explanations_share_it():
    found = ambiguous()
    slight = tuple(replace(effect, role="slight") for effect in found.effects[1:])
    rivals = tuple(replace(rival, effects=found.effects) for rival in found.alternatives)
    shared = account_of(replace(found, effects=(found.effects[0], *slight), alternatives=rivals)).rivals
    assert [line for line in shared if line.startswith("in every")] == [
        line
        for line in account_of(replace(found, alternatives=rivals, effects=found.effects[:1])).rivals
        if line.startswith("in every")
    ]
