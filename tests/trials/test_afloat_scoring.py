"""Scoring of what floats or stands, with made diagnoses: sizes, names that are the same, false alarms, figures."""

from types import SimpleNamespace

import pytest

from gpsim.reports.prove_page import miss_rows, record
from gpsim.reports.prove_sheets import goals_sheet, group_sheets, terminal_sheets
from gpsim.trials.scoring_parts import score_afloat
from gpsim.trials.summary import summarise

from .test_scoring import WORLD

pytest.importorskip("mujoco")
TRUE = [
    ("viscous_friction", "base.surge", {"damping": 0.3}, 30.0),
    ("actuator_gain", "thrust_1", {"gain": 0.9}, 90.0),
    ("parameter_offset", "frame.mass", {"ratio": 1.1}, 50.0),
    ("quadratic_drag", "base.heave", {"drag": 0.02}, 2.0),
]


def answer(effects=TRUE):
    told = [
        {"family": f, "on": on, "parameters": k, "region": {}, "since": None, "outside": False, "rollout": r}
        for f, on, k, r in effects
    ]
    content = {"stratum": "afloat", "afloat": {"model": "quadrotor.xml", "falls": 0}, "effects": told}
    return SimpleNamespace(
        content=content,
        claims=[(f, on) for f, on, _, _ in effects],
        world=SimpleNamespace(system="quadrotor"),
    )


def said(family, on, name, value, width=0.001, role="headline", **more):
    told = {n: {"value": v, "low": v - width, "high": v + width} for n, v in {name: value, **more}.items()}
    return {"family": family, "on": on, "parameters": told, "region": {}, "since": None, "role": role}


def all_of_it():
    return [said(f, on, *next(iter(k.items()))) for f, on, k, _ in TRUE[:3]]


def scored(effects, truth=TRUE, verdict="named", combinations=(), rollouts=1.1):
    report = {"verdict": verdict, "effects": effects, "alternatives": []}
    report["combinations"] = [{"of": list(of)} for of in combinations]
    return score_afloat(answer(truth), report, {"base.x": rollouts})


def test_all_of_it_is_right_and_what_does_not_show_does_not_count():
    found = scored(all_of_it())
    assert (found["right"], found["spurious"], found["verdict_right"]) == (True, 0, True)
    assert [p["counts"] for p in found["parts"]] == [True, True, True, False]
    assert not scored(all_of_it()[1:])["right"]
    slight = [said("viscous_friction", "base.surge", "damping", 0.3, role="slight"), *all_of_it()[1:]]
    assert scored(slight)["right"]


@pytest.mark.parametrize(
    ("value", "width", "right"), [(0.914, 0.001, True), (0.93, 0.001, False), (0.93, 0.031, True)]
)
def test_a_size_is_right_within_15_percent_of_what_it_changes_or_its_interval(value, width, right):
    drag, _, mass = all_of_it()
    assert scored([drag, said("actuator_gain", "thrust_1", "gain", value, width), mass])["right"] is right


def test_a_headline_that_is_not_there_is_wrong_and_a_slight_one_is_not():
    more = said("constant_force", "base.x", "force", 0.1)
    assert scored([*all_of_it(), more])["spurious_names"] == [["constant_force", "base.x"]]
    assert not scored([*all_of_it(), more])["right"]
    assert scored([*all_of_it(), {**more, "role": "slight"}])["right"]


def test_a_payload_at_the_centre_is_more_mass_of_its_body_and_one_aside_is_not():
    rest = all_of_it()[:2]
    load = said("payload", "frame", "mass", 0.0716, 0.005, x=0.0, y=0.001, z=0.0)
    assert scored([*rest, load])["right"]
    aside = said("payload", "frame", "mass", 0.0716, 0.005, x=0.1, y=0.0, z=0.0)
    assert scored([*rest, aside])["spurious_names"] == [["payload", "frame"]]


def test_all_gains_of_what_floats_in_one_ratio_are_its_mass_inertia_and_forces():
    gains = [("actuator_gain", f"thrust_{i}", {"gain": 0.8}, 50.0) for i in range(1, 5)]
    truth = [*gains, ("viscous_friction", "base.surge", {"damping": 0.3}, 30.0)]
    masses = [said("parameter_offset", f"frame.{what}", "ratio", 1.25) for what in ("mass", "inertia")]
    drag = said("viscous_friction", "base.surge", "damping", 0.375)
    found = scored([*masses, drag], truth)
    assert (found["right"], found["spurious"], len(found["parts"])) == (True, 0, 3)
    assert not scored([masses[0], drag], truth)["right"]
    fewer = [("parameter_offset", "frame.mass", {"ratio": 1.25}, 50.0)]  # five numbers in place of one
    others = [said("actuator_gain", on, "gain", 0.8) for _, on, _, _ in gains]
    assert not scored([*others, said("parameter_offset", "frame.inertia", "ratio", 0.8)], fewer)["right"]


def test_any_verdict_but_none_is_a_false_alarm_where_nothing_is_missing():
    quiet, alarm = (scored([], (), verdict) for verdict in ("none", "unknown"))
    assert (quiet["right"], quiet["false_alarm"]) == (True, False)
    assert (alarm["right"], alarm["false_alarm"]) == (False, True)
    failed = score_afloat(answer(()), None, None)
    assert (failed["right"], failed["false_alarm"], failed["verdict"]) == (False, False, "failed")


def test_figures_stand_by_themselves_with_intervals_and_goals():
    kinds = [scored(all_of_it()), scored(all_of_it()[1:], rollouts=2.0), score_afloat(answer(), None, None)]
    kinds += [scored([], (), "none"), scored(all_of_it()[:1], ())]
    world = WORLD | {"system": "quadrotor", "velocities": None, "strength": ""}
    scores = [{**s, **world, "trial": str(600_001 + i)} for i, s in enumerate(kinds)]
    found = summarise(scores)
    block = found["afloat"]
    assert (block["n"], block["failed"], block["worlds_right_count"]) == (5, 1, 2)
    assert (block["false_alarms_count"], block["false_alarms_of"]) == (1, 2)
    assert (block["effects_right_count"], block["effects_right_of"]) == (5, 9)
    assert block["families"]["actuator_gain"] == {**block["families"]["actuator_gain"], "right": 2, "n": 3}
    assert block["spurious_families"] == {"quadrotor: viscous_friction on base.surge": 1}
    assert set(block["strata"]["effects"]) == {"0", "4"}
    assert found["all"]["n"] == 0
    labels = {cells[0].text: cells[-1].text for cells in goals_sheet(found).rows}
    assert labels["afloat: nothing missing, false alarms"] == "1/2"
    assert all(name.startswith("afloat") for name in labels)
    assert {"Afloat", "Afloat by read"} <= {sheet.title for sheet in group_sheets(found)}
    facts = {"seed": 3, "diagnosed_under": ["abc"], "undiagnosed": [], "every_miss": miss_rows(scores)}
    text = record(found | facts)
    assert "5 robots that float or stand" in text
    assert "wrong: viscous_friction on base.surge (not told)" in text
    assert any(sheet.title == "Afloat" for sheet in terminal_sheets(found))
