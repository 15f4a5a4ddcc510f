"""Scoring of whole robots, with made diagnoses: rows, bodies, what is the same by another name, figures and goals."""

from types import SimpleNamespace

import pytest

from gpsim.reports.prove_page import miss_rows, record
from gpsim.reports.prove_sheets import goals_sheet, group_sheets, terminal_sheets
from gpsim.trials.judged import WholeListing
from gpsim.trials.robots import spec_of
from gpsim.trials.scoring_parts import score_whole
from gpsim.trials.summary import summarise

from .test_scoring import WORLD

pytest.importorskip("mujoco")
TRUE = [
    ("viscous_friction", "shoulder", {"damping": 0.2}, 0.2),
    ("coulomb_friction", "shoulder", {"force": 0.3}, 0.3),
    ("armature", "shoulder", {"inertia": 0.02}, 0.004),
    ("coulomb_friction", "elbow", {"force": 0.1}, 0.2),
    ("parameter_offset", "lower.mass", {"ratio": 1.3}, 0.2),
    ("constant_force", "elbow", {"force": 0.1}, 0.1),
    ("actuator_delay", "shoulder_servo", {"delay": 0.01}, None),
]


def answer(effects=TRUE):
    told = [
        {"family": f, "on": on, "parameters": k, "region": {}, "since": None, "outside": False, "share": s}
        for f, on, k, s in effects
    ]
    world = SimpleNamespace(system="planar_servos", noise={"shoulder": 1e-3, "elbow": 1e-3})
    return SimpleNamespace(
        content={"stratum": "whole", "effects": told},
        claims=[(f, on) for f, on, _, _ in effects],
        world=world,
    )


def report(effects, verdict="named", combinations=()):
    named = [{"of": list(of)} for of in combinations]
    return {"verdict": verdict, "effects": list(effects), "alternatives": [], "combinations": named}


def said(family, on, name, value, width=0.01, role="headline"):
    told = {name: {"value": value, "low": value - width, "high": value + width}}
    return {"family": family, "on": on, "parameters": told, "region": {}, "since": None, "role": role}


def all_of_it():
    return [said(f, on, *next(iter(k.items()))) for f, on, k, _ in TRUE]


def scored(effects, off=0.0, rollouts=1.1, **more):
    return score_whole(answer(), report(effects, **more), WholeListing({"shoulder": rollouts}, off))


def rows(found):
    return {(r["family"], r["on"]): r for r in found["rows"]}


def test_all_of_it_is_right_and_a_row_below_one_per_cent_does_not_count():
    found = scored(all_of_it())
    assert (found["right"], found["spurious"], found["verdict_right"]) == (True, 0, True)
    assert [r["counts"] for r in found["rows"]] == [True, True, False, True]
    assert scored([e for e in all_of_it() if e["family"] != "armature"])["right"]
    assert not scored([e for e in all_of_it() if e["on"] != "elbow"])["right"]


@pytest.mark.parametrize(
    ("value", "width", "right"), [(0.22, 0.001, True), (0.26, 0.001, False), (0.26, 0.07, True)]
)
def test_a_row_is_right_within_15_percent_or_its_interval(value, width, right):
    effects = [said("viscous_friction", "shoulder", "damping", value, width), *all_of_it()[1:]]
    assert rows(scored(effects))["viscous_friction", "shoulder"]["right"] is right


def test_a_servos_velocity_gain_is_viscous_friction_of_its_joint():
    kv = -float(spec_of("planar_servos").compile().actuator("shoulder_servo").biasprm[2])
    gain = said("parameter_offset", "shoulder_servo.kv", "ratio", 1.0 + 0.2 / kv, 0.001)
    found = scored([gain, *all_of_it()[1:]])
    assert rows(found)["viscous_friction", "shoulder"]["value"] == pytest.approx(0.2)
    assert (found["right"], found["spurious"]) == (True, 0)
    twice = scored([gain, *all_of_it()])  # and the joint's own beside it: twice of what there is
    assert not rows(twice)["viscous_friction", "shoulder"]["right"]


def test_bodies_are_right_by_name_in_a_combination_or_by_what_they_ask_for():
    rest = [e for e in all_of_it() if e["family"] != "parameter_offset"]
    load = said("payload", "lower", "mass", 0.2)
    how = {
        "own name": scored(all_of_it(), off=0.5),
        "alike": scored([*rest, load], off=0.1),
        "in a combination": scored(
            [*rest, load],
            off=0.5,
            combinations=[("parameter_offset on lower.mass: ratio", "payload on lower: mass")],
        ),
        "": scored([*rest, load], off=0.5),
    }
    assert {h: f["bodies"][0]["how"] for h, f in how.items()} == {h: h for h in how}
    assert {h: f["spurious"] for h, f in how.items()} == {
        "own name": 0,
        "alike": 0,
        "in a combination": 0,
        "": 1,
    }
    assert scored([*rest, load], off=0.5)["spurious_names"] == [["payload", "lower"]]
    far = [*rest, said("parameter_offset", "lower.mass", "ratio", 1.2)]  # a third of what is missing
    assert not scored(far, off=0.5)["bodies"][0]["right"]


def test_only_headlines_are_spurious_and_the_same_by_another_name_is_not():
    rest = [e for e in all_of_it() if e["family"] not in ("constant_force", "actuator_delay")]
    other = [said("joint_offset", "elbow", "offset", 0.01), said("sensor_delay", "shoulder", "delay", 0.01)]
    assert scored([*rest, *other])["spurious"] == 0
    assert scored([*all_of_it(), said("spring", "elbow", "stiffness", 1.0)])["spurious"] == 1
    assert scored([*all_of_it(), said("spring", "elbow", "stiffness", 1.0, role="slight")])["spurious"] == 0
    assert scored([*all_of_it(), said("joint_offset", "shoulder", "offset", 0.01)])["spurious"] == 1


def test_figures_of_whole_robots_stand_by_themselves_with_intervals_and_goals():
    good, poor = scored(all_of_it()), scored(all_of_it()[:1], off=0.9, rollouts=3.0, verdict="partial")
    failed = score_whole(answer(), None, None)
    world = WORLD | {"system": "planar_servos", "velocities": None, "strength": ""}
    scores = [{**s, **world, "trial": str(400_001 + i)} for i, s in enumerate((good, poor, failed))]
    found = summarise(scores)
    block = found["whole"]
    assert (block["n"], block["failed"], block["right"]) == (3, 1, 1)
    assert (block["rows_right_count"], block["rows_right_of"]) == (4, 9)
    assert block["interval_rows_right"][0] < block["rows_right"] < block["interval_rows_right"][1]
    assert (block["bodies_right"], block["rollouts_within"]) == (pytest.approx(1 / 3), pytest.approx(1 / 3))
    assert block["families"]["coulomb_friction"]["n"] == 6
    assert block["joints"]["planar: elbow"]["right"] == 1
    assert found["all"]["n"] == 0
    goal = found["goals"]["whole.rows_right"]
    assert goal["wanted"] == ">= 0.85"
    labels = {cells[0].text: cells[-1].text for cells in goals_sheet(found).rows}
    assert labels["whole robots: rows of friction and rotors right"] == "4/9"
    assert all(name.startswith("whole robots") for name in labels)
    titles = [sheet.title for sheet in group_sheets(found)]
    assert {"Whole robots", "Whole robots by driven by", "Whole robots by read"} <= set(titles)
    facts = {"seed": 3, "diagnosed_under": ["abc"], "undiagnosed": [], "every_miss": miss_rows(scores)}
    text = record(found | facts)
    assert "3 whole robots" in text
    assert "wrong: coulomb_friction on shoulder (not told)" in text
    assert any(sheet.title == "Whole robots" for sheet in terminal_sheets(found))
