"""The account: what each verdict says, of which figures, and what it keeps to itself; and as a piece of a notebook."""

from __future__ import annotations

from dataclasses import replace

import pytest
from made_diagnoses import made_diagnosis, made_effect, made_location, made_remainder
from pages import check_fragment
from rich_diagnoses import (
    RICH,
    TELL,
    ambiguous,
    friction,
    gain,
    measured,
    named,
    partial,
    share,
    size,
    unknown,
    viscous,
)

from gpsim.diagnosis import Diagnosis
from gpsim.findings import Combination, Explained, LogFact, MeasuredCurve, Odds, Share
from gpsim.reports.account import account_of
from gpsim.reports.account_lines import account_lines
from gpsim.reports.diagnosis_figures import Picture
from gpsim.reports.diagnosis_page import account_fragment, page

SURE = replace(named(), combinations=())
VAGUE = viscous(parameters={"damping": size(1.0, 0.6, "N s/m")}, form="holds")
HELD = friction(parameters={"force": size(8.7, 0.1, "N", at_bound=True)})
DRAG = (("quadratic_drag", "x"),)
GATED = friction(region={"x": (-1.1, -0.4)}, since=63.6)
OWN = replace(
    named(),
    combinations=(
        Combination(of=("cart_mass", "force gain"), fixed="their ratio", open="both scaled alike"),
    ),
    log_facts=("it rained",),
    facts=(LogFact("late", "x", value=0.03, unit="s"),),
)
JOINTS = [f"joint_with_a_long_name_{i}" for i in (10, 2, 1, 3, 4, 5)]
EVIL = "</style><script>alert(1)</script><img src=x onerror=alert(1)>\"'&"


def said(diagnosis, **given):
    return " ".join(" ".join(account_lines(account_of(diagnosis, **given))).split())


def judged(on):
    return replace(named(), explained=Explained(rollout=Share(0.97), judged_on=on))


@pytest.mark.parametrize(
    ("found", "words"),
    [
        (named(), "named: the effects below explain 97 % (95 to 98) of the mismatch; no other explanation does as well."),
        (ambiguous(), "97 % (95 to 98) of the mismatch, but these data cannot separate it from another explanation."),
        (partial(), "93 % (88 to 96) of the mismatch, but the law of viscous friction on x holds only approximately"),
        (unknown(), "something is missing; the best explanation covers 21 % (10 to 34) of it, too little to name it."),
        (RICH["none"](), "the recording shows no missing physics"),
        (replace(partial(), effects=(friction(),)), "Coulomb friction on x explains 93 % (88 to 96) of the mismatch; the rest is"),
        (replace(partial(), explained=Explained(rollout=Share(0.66, 0.58, 0.73))), "the rest is unexplained"),
        (replace(named(), alternatives=ambiguous().alternatives), "differ only in small corrections"),
        (judged("cross-fitted rollouts"), "97 % of the mismatch (cross-fitted"),
        (judged("fit windows"), "97 % of the mismatch (on its own training data"),
        (judged("held-out rollouts"), "97 % of the mismatch;"),
    ],
)  # fmt: skip
def test_the_verdict_says_how_much_is_explained_and_what_keeps_it_from_being_named(found, words):
    assert words in account_of(found).sentence or words in said(found)


@pytest.mark.parametrize(
    ("found", "words"),
    [
        (ambiguous(), "; viscous friction on x"),
        (unknown(), "98 % of the mismatch is unexplained, most of it in theta_acc; it changes with theta_dot and force"),
        (replace(named(), location=made_location(channels={"x_acc": 0.9}, region={"x": (-1.1, -0.4)}, since=63.6)),
         "only where x in [-1.1, -0.4]; since t = 63.60 s"),
        (made_diagnosis(verdict="named", effects=(made_effect(),)), "diverged → diverged"),
        (partial(), "the log: the clock jitters by 0.4 ms"),
        (partial(), "one step ahead only 28 % of theta_acc is explained"),
        (partial(), "7 % of the mismatch is unexplained, most of it in theta_acc; it changes with theta_dot"),
        (named(), "the log: 3 samples of theta repeat the one before, theta is quantised to 0.001 rad and 12 samples"),
        (named(), "only cart_mass / force gain = 2.50 (2.40 to 2.60) is fixed; both may be scaled alike"),
        (OWN, "the log: it rained"),
        (OWN, "of cart_mass and force gain only their ratio is fixed; both scaled alike"),
        (replace(named(), effects=(named().effects[0], gain(role="slight"))), "the effects below explain"),
    ],
)  # fmt: skip
def test_what_was_found_where_and_what_is_left_is_in_the_terminals_account(found, words):
    assert words.removeprefix("; ") in said(found)


@pytest.mark.parametrize(
    ("found", "words"),
    [
        *(
            (make(), word) for make in RICH.values() for word in (" nats", "e-1", "p =")
        ),  # for statisticians alone
        (
            replace(named(), verdict="partial", effects=(friction(), gain(form="approximate"))),
            "approximately",
        ),
        (
            replace(unknown(), effects=(friction(),)),
            "friction",
        ),  # whatever a file of an earlier version holds
        (replace(named(), effects=(named().effects[0],)), "the effects below explain"),
    ],
)
def test_what_is_not_told(found, words):
    assert words not in said(found)


def test_the_statistics_are_told_below():
    below = page(partial(), {}, "cartpole").partition("<summary>Statistics")[2].partition("</details>")[0]
    assert "p = 8.7e-154" in below
    assert below.partition("Parameters, 90 %")[0].count("<tr>") == 5  # a head and four effects
    first, *_ = account_of(replace(partial(), remainder=made_remainder(structured=True))).left
    assert first == "7 % of the mismatch is unexplained"


def test_headline_effects_stand_by_importance_and_slight_ones_apart():
    account = account_of(named())
    assert [(row.effect, row.percent, row.certainty) for row in account.rows] == [
        ("Coulomb friction on x", "74 %", "sure"),
        ("viscous friction on x", "19 %", "120 to 1"),
    ]
    assert (
        account.slight == "small corrections, not claims: actuator gain on force (0.930 ± 0.012 times, 1 %)"
    )
    assert account.slight in said(named())
    redundant = replace(named(), effects=(friction(), gain(importance=Share(0.4, 0.2, 0.6))))
    assert account_of(redundant).slight.startswith("not claims, because other effects could replace them")
    nothing = replace(named(), effects=(viscous(importance=share(-0.02)), friction()))
    assert [row.percent for row in account_of(nothing).rows] == ["74 %", "-2 %"]


@pytest.mark.parametrize(
    ("effect", "part", "words"),
    [
        (friction(form="holds"), "law", "yes"),
        (friction(form="approximate"), "law", "approximately"),
        (friction(form="untested"), "law", "not tested"),
        (friction(odds=Odds(0.2, DRAG)), "certainty", "undecided"),
        (friction(odds=Odds(0.2, DRAG)), "instead", "cannot be told apart from quadratic drag on x"),
        (friction(odds=Odds(4.0, DRAG)), "certainty", "55 to 1"),
        (friction(odds=Odds(4.0, DRAG)), "instead", ""),
        (GATED, "gate", ""),  # which `where` says already
        (measured(), "sizes", (("", "-11.9 to 11.9 N"),)),
    ],
)
def test_a_row_says_whether_a_law_holds_how_sure_it_is_and_where_it_acts(effect, part, words):
    (row,) = account_of(replace(named(), effects=(effect,))).rows
    assert getattr(row, part) == words


def test_what_all_explanations_share_stands_apart_unless_it_is_slight():
    certain, undecided = account_of(ambiguous()).rivals
    assert certain.endswith(": viscous friction on x")
    assert undecided == (
        "either Coulomb friction on x and actuator gain on force (62 %) or actuator dead zone on force (38 %); "
        "the table shows the likeliest"
    )
    assert not account_of(replace(named(), alternatives=ambiguous().alternatives)).rivals
    found = ambiguous()
    rivals = tuple(replace(rival, effects=found.effects) for rival in found.alternatives)
    slight = tuple(replace(effect, role="slight") for effect in found.effects[1:])
    several = [(found.effects[0], *slight), found.effects[:1]]
    told = [account_of(replace(found, effects=effects, alternatives=rivals)).rivals for effects in several]
    assert told[0][0] == told[1][0]


@pytest.mark.parametrize(
    ("found", "said"),
    [
        (ambiguous(), TELL),
        (partial(), "record theta_dot over its whole range"),
        (named(), "optional: measure cart_mass or force gain on its own: motion alone fixes only a combination"),
        (SURE, "use it: no further recording would change this account"),
        (replace(SURE, effects=(friction(), VAGUE)), "optional: record motion with more influence of viscous friction on x: its size is"),
        (replace(SURE, effects=(HELD,)), "optional: record motion with more influence of Coulomb friction on x: its size is at the limit"),
        (replace(SURE, remainder=made_remainder(structured=True)), "use it"),
        (replace(SURE, verdict="partial", remainder=made_remainder(structured=True)), "record slow and fast sweeps of every command"),
        (replace(SURE, effects=(measured(visited=(-0.64, 0.5)),)), "optional: record x_dot beyond [-0.64, 0.5] m/s, "),
        (replace(SURE, verdict="ambiguous", effects=(HELD,)), "record motion with more influence of Coulomb friction on x"),
    ],
)  # fmt: skip
def test_the_next_recording_is_the_one_that_would_help_most(found, said):
    *use, last = account_of(found).next
    assert last.startswith(said)
    assert use == (["use it: no further recording is needed"] if last.startswith("optional") else [])
    text = " ".join(line.strip() for line in account_lines(account_of(found)))
    assert "optional" not in text or text.index("use it") < text.index("optional") < text.index(
        "gpsim train-gp-policy"
    )


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
    assert [c.said for c in one.changes] == ["9.2 → 0.11 m/s² (noise 0.099)", "13 → 2.0 rad/s² (noise 1.8)"]
    assert rollout.title == "after 1 s"
    assert rollout.changes[0].said == "0.62 → 0.010 m"
    assert account_of(RICH["none"]()).fit[1].changes[0].said == "0.62 m"
    assert account_of(unknown()).fit[1].changes[0].said == "0.62 → 0.056 m"  # by the Gaussian process


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


def test_a_measured_curve_is_told_by_where_it_goes():
    of = {"quantity": "force on q", "unit": "N", "input": "q_dot", "input_unit": "m/s", "freedom": 8.1}
    at, values = (-0.64, -0.36, 0.0, 0.5), (2.2, 3.07, 0.0, -2.94)
    curve = MeasuredCurve(**of, at=at, values=values, visited=(-0.64, 0.5))
    earlier = replace(curve, at=(-1.0, 1.0), values=(-0.5, 0.5, -1.0, 1.0))  # a map of two inputs
    effect = friction(family="force_curve", on="q", curve=curve)
    both = replace(partial(), effects=(effect, replace(effect, curve=earlier)))
    assert account_of(both).rivals == (
        "no catalogue law for force on q over q_dot; it goes from 2.2 N at q_dot = -0.64 m/s over 3.07 at -0.36 to "
        "-2.94 at 0.5",
        "no catalogue law for force on q over q_dot; it lies between -1 and 1 N",
    )
    assert [row.effect for row in account_of(both).rows] == ["measured force on q"] * 2


def arm(**changes):
    frictions = [
        friction(on=joint, parameters={"force": size(1.0 + i, 0.05, "N m")}, importance=share(0.1), **changes)
        for i, joint in enumerate(JOINTS)
    ]
    return made_diagnosis(verdict="named", effects=(*frictions, gain(role="headline")))


def test_the_same_effect_on_many_joints_is_one_row_with_a_size_each_unless_it_acts_in_a_place_only():
    group, other = account_of(arm()).rows
    assert group.effect == "Coulomb friction on 6 joints"
    assert [name for name, _ in group.members] == sorted(JOINTS, key=lambda n: int(n.rpartition("_")[2]))
    assert group.members[-1] == (JOINTS[0], "1.00 ± 0.05 N m")
    assert (group.percent, other.members) == ("60 %", ())
    rows = account_of(arm(region={"x": (0.0, 1.0)})).rows
    assert len(rows) == 7
    assert not any(row.members for row in rows)


@pytest.mark.parametrize("kind", RICH)
def test_every_kind_of_account_is_a_piece_of_a_notebook(kind):
    account = account_of(RICH[kind]())
    piece = check_fragment(account_fragment(account))
    assert f"Verdict: {account.verdict}." in piece.text
    for text in (account.where, *(row.effect for row in account.rows), *account.left, *account.next):
        assert text in piece.text


def test_odd_names_are_text_in_a_notebook():
    account = account_of(named())
    plain = check_fragment(account_fragment(account))
    row = replace(account.rows[0], effect=EVIL, whole=EVIL + "!", gate=EVIL, sizes=((EVIL, EVIL),))
    odd = replace(account, where=EVIL, rows=(row,), slight=EVIL, rivals=(EVIL,), left=(EVIL,), next=(EVIL,))
    piece = check_fragment(account_fragment(odd, [Picture(EVIL, EVIL, b"png")]))
    assert piece.tags - plain.tags <= {"img", "br"}
    assert piece.text.count(EVIL) >= 6
