"""Scoring of robots, with made diagnoses: few effects, whole robots, what floats or stands; names that are the same."""

from types import SimpleNamespace

import pytest

from gpsim.reports import prove_page, prove_sheets
from gpsim.trials.fits import Rival
from gpsim.trials.judged import WholeListing
from gpsim.trials.robots import spec_of
from gpsim.trials.scoring import score
from gpsim.trials.scoring_parts import score_afloat, score_whole
from gpsim.trials.summary import summarise

from .test_scoring import WORLD

pytest.importorskip("mujoco")
FEW = [("actuator_gain", "elbow_cmd", {"gain": 1.2}, 9.0)]
WHOLE = [
    ("viscous_friction", "shoulder", {"damping": 0.2}, 0.2),
    ("coulomb_friction", "shoulder", {"force": 0.3}, 0.3),
    ("armature", "shoulder", {"inertia": 0.02}, 0.004),
    ("coulomb_friction", "elbow", {"force": 0.1}, 0.2),
    ("parameter_offset", "lower.mass", {"ratio": 1.3}, 0.2),
    ("constant_force", "elbow", {"force": 0.1}, 0.1),
    ("actuator_delay", "shoulder_servo", {"delay": 0.01}, None),
]
AFLOAT = [
    ("viscous_friction", "base.surge", {"damping": 0.3}, 30.0),
    ("actuator_gain", "thrust_1", {"gain": 0.9}, 90.0),
    ("parameter_offset", "frame.mass", {"ratio": 1.1}, 50.0),
    ("quadratic_drag", "base.heave", {"drag": 0.02}, 2.0),
]


def answer(stratum, effects, system="", **more):
    """The answer to a world; how much of an effect shows is its share, or how far a rollout is off without it."""
    told = [
        {
            "family": f, "on": on, "parameters": k, "region": {}, "since": None, "outside": False, "share": seen,
            "rollout": seen,
        }
        for f, on, k, seen in effects
    ]  # fmt: skip
    return SimpleNamespace(
        content={"stratum": stratum, "effects": told, **more},
        claims=[(f, on) for f, on, _, _ in effects],
        world=SimpleNamespace(system=system, noise={"shoulder": 1e-3, "elbow": 1e-3}),
    )


def said(family, on, name, value, width=0.001, role="headline", since=None, **more):
    told = {n: {"value": v, "low": v - width, "high": v + width} for n, v in {name: value, **more}.items()}
    return {"family": family, "on": on, "parameters": told, "region": {}, "since": since, "role": role}


def all_of(effects):
    return [
        said(f, on, *next(iter(k.items())), width=0.01 if s is None or s < 1 else 0.001)
        for f, on, k, s in effects
    ]


def report(effects, verdict="named", combinations=()):
    named = [{"of": list(of)} for of in combinations]
    return {"verdict": verdict, "effects": list(effects), "alternatives": [], "combinations": named}


# One or two effects


def few(told, rivals=(), stratum="single", effects=FEW):
    return score(answer(stratum, effects, robot="acrobot.xml"), told, rivals)


GAIN = said("actuator_gain", "elbow_cmd", "gain", 1.21, 0.05)
BIAS = said("actuator_bias", "elbow_cmd", "bias", 0.1)


def test_the_true_name_is_right_another_only_if_it_is_an_equivalent_and_a_gate_never():
    claims = (("actuator_bias", "elbow_cmd"),)
    good = few(report([GAIN]))
    assert good["right"]
    assert (good["parameters"][0]["covered"], good["gated"]) == (True, False)
    assert good["parameters"][0]["relative_error"] == pytest.approx(0.01 / 1.2)
    assert not few(report([BIAS]))["right"]
    assert few(report([BIAS]), [Rival(claims, 2.0, False)])["right"]
    assert not few(report([BIAS]), [Rival(claims, 4.0, False)])["right"]
    assert not few(report([BIAS]), [Rival(claims, 1.0, True)])["right"]
    assert not few(report([GAIN | {"since": 12.0}]))["right"]
    assert not few(report([GAIN, BIAS]))["right"]


# Whole robots


def whole(effects, off=0.0, rollouts=1.1, **more):
    listing = WholeListing({"shoulder": rollouts}, off)
    return score_whole(answer("whole", WHOLE, "planar_servos"), report(effects, **more), listing)


def rows(found):
    return {(r["family"], r["on"]): r for r in found["rows"]}


def test_all_of_it_is_right_and_a_row_below_one_per_cent_does_not_count():
    found = whole(all_of(WHOLE))
    assert (found["right"], found["spurious"], found["verdict_right"]) == (True, 0, True)
    assert [r["counts"] for r in found["rows"]] == [True, True, False, True]
    assert whole([e for e in all_of(WHOLE) if e["family"] != "armature"])["right"]
    assert not whole([e for e in all_of(WHOLE) if e["on"] != "elbow"])["right"]


@pytest.mark.parametrize(
    ("value", "width", "right"), [(0.22, 0.001, True), (0.26, 0.001, False), (0.26, 0.07, True)]
)
def test_a_row_is_right_within_15_percent_or_its_interval(value, width, right):
    effects = [said("viscous_friction", "shoulder", "damping", value, width), *all_of(WHOLE)[1:]]
    assert rows(whole(effects))["viscous_friction", "shoulder"]["right"] is right


def test_a_servos_velocity_gain_is_viscous_friction_of_its_joint():
    kv = -float(spec_of("planar_servos").compile().actuator("shoulder_servo").biasprm[2])
    gain = said("parameter_offset", "shoulder_servo.kv", "ratio", 1.0 + 0.2 / kv)
    found = whole([gain, *all_of(WHOLE)[1:]])
    assert rows(found)["viscous_friction", "shoulder"]["value"] == pytest.approx(0.2)
    assert (found["right"], found["spurious"]) == (True, 0)
    twice = whole([gain, *all_of(WHOLE)])  # and the joint's own beside it: twice of what there is
    assert not rows(twice)["viscous_friction", "shoulder"]["right"]


def test_bodies_are_right_by_name_in_a_combination_or_by_what_they_ask_for():
    rest = [e for e in all_of(WHOLE) if e["family"] != "parameter_offset"]
    load = said("payload", "lower", "mass", 0.2)
    named = [("parameter_offset on lower.mass: ratio", "payload on lower: mass")]
    how = {
        "own name": whole(all_of(WHOLE), off=0.5),
        "alike": whole([*rest, load], off=0.1),
        "in a combination": whole([*rest, load], off=0.5, combinations=named),
        "": whole([*rest, load], off=0.5),
    }
    assert {h: f["bodies"][0]["how"] for h, f in how.items()} == {h: h for h in how}
    assert [f["spurious"] for f in how.values()] == [0, 0, 0, 1]
    far = [*rest, said("parameter_offset", "lower.mass", "ratio", 1.2)]  # a third of what is missing
    assert not whole(far, off=0.5)["bodies"][0]["right"]


def test_only_headlines_are_spurious_and_the_same_by_another_name_is_not():
    rest = [e for e in all_of(WHOLE) if e["family"] not in ("constant_force", "actuator_delay")]
    other = [said("joint_offset", "elbow", "offset", 0.01), said("sensor_delay", "shoulder", "delay", 0.01)]
    assert whole([*rest, *other])["spurious"] == 0
    assert whole([*all_of(WHOLE), said("spring", "elbow", "stiffness", 1.0)])["spurious"] == 1
    assert whole([*all_of(WHOLE), said("spring", "elbow", "stiffness", 1.0, role="slight")])["spurious"] == 0
    assert whole([*all_of(WHOLE), said("joint_offset", "shoulder", "offset", 0.01)])["spurious"] == 1


# What floats or stands


def afloat(effects, truth=AFLOAT, rollouts=1.1, **more):
    return score_afloat(answer("afloat", truth, "quadrotor"), report(effects, **more), {"base.x": rollouts})


def test_of_what_floats_what_does_not_show_does_not_count_and_slight_ones_may_be_told():
    drag, gain, mass, _ = all_of(AFLOAT)
    found = afloat([drag, gain, mass])
    assert (found["right"], found["spurious"], found["verdict_right"]) == (True, 0, True)
    assert [p["counts"] for p in found["parts"]] == [True, True, True, False]
    assert not afloat([gain, mass])["right"]
    assert afloat([drag | {"role": "slight"}, gain, mass])["right"]
    more = said("constant_force", "base.x", "force", 0.1)
    assert afloat([drag, gain, mass, more])["spurious_names"] == [["constant_force", "base.x"]]
    assert afloat([drag, gain, mass, more | {"role": "slight"}])["right"]


@pytest.mark.parametrize(
    ("value", "width", "right"), [(0.914, 0.001, True), (0.93, 0.001, False), (0.93, 0.031, True)]
)
def test_a_size_is_right_within_15_percent_of_what_it_changes_or_its_interval(value, width, right):
    drag, _, mass, _ = all_of(AFLOAT)
    assert afloat([drag, said("actuator_gain", "thrust_1", "gain", value, width), mass])["right"] is right


def test_a_payload_at_the_centre_is_more_mass_of_its_body_and_one_aside_is_not():
    rest = all_of(AFLOAT)[:2]
    load = said("payload", "frame", "mass", 0.0716, 0.005, x=0.0, y=0.001, z=0.0)
    assert afloat([*rest, load])["right"]
    aside = said("payload", "frame", "mass", 0.0716, 0.005, x=0.1, y=0.0, z=0.0)
    assert afloat([*rest, aside])["spurious_names"] == [["payload", "frame"]]


def test_all_gains_of_what_floats_in_one_ratio_are_its_mass_inertia_and_forces():
    gains = [("actuator_gain", f"thrust_{i}", {"gain": 0.8}, 50.0) for i in range(1, 5)]
    truth = [*gains, ("viscous_friction", "base.surge", {"damping": 0.3}, 30.0)]
    masses = [said("parameter_offset", f"frame.{what}", "ratio", 1.25) for what in ("mass", "inertia")]
    drag = said("viscous_friction", "base.surge", "damping", 0.375)
    found = afloat([*masses, drag], truth)
    assert (found["right"], found["spurious"], len(found["parts"])) == (True, 0, 3)
    assert not afloat([masses[0], drag], truth)["right"]
    fewer = [("parameter_offset", "frame.mass", {"ratio": 1.25}, 50.0)]  # five numbers in place of one
    others = [said("actuator_gain", on, "gain", 0.8) for _, on, _, _ in gains]
    assert not afloat([*others, said("parameter_offset", "frame.inertia", "ratio", 0.8)], fewer)["right"]


def test_any_verdict_but_none_is_a_false_alarm_where_nothing_is_missing():
    quiet, alarm = (afloat([], (), verdict=verdict) for verdict in ("none", "unknown"))
    assert (quiet["right"], quiet["false_alarm"]) == (True, False)
    assert (alarm["right"], alarm["false_alarm"]) == (False, True)
    failed = score_afloat(answer("afloat", (), "quadrotor"), None, None)
    assert (failed["right"], failed["false_alarm"], failed["verdict"]) == (False, False, "failed")


# Figures


def summed(scores, **world):
    """The summary of scores, which stand by themselves, and the text to publish."""
    facts = WORLD | {"velocities": None, "strength": ""} | world
    scores = [{**s, **facts, "trial": str(400_001 + i)} for i, s in enumerate(scores)]
    found = summarise(scores) | {"seed": 3, "diagnosed_under": ["abc"], "undiagnosed": []}
    assert found["all"]["n"] == 0
    return found, prove_page.record(found | {"every_miss": prove_page.miss_rows(scores)})


def goals(found):
    return {cells[0].text: cells[-1].text for cells in prove_sheets.goals_sheet(found).rows}


def test_figures_of_robots_with_few_effects():
    nothing = (report([], "none"), report([GAIN], "named"))
    scores = [few(report([GAIN])), few(None), *(few(told, (), "none", ()) for told in nothing)]
    found, _ = summed(scores, system="arm")
    robots = found["mjcf"]
    assert (robots["single_right"], robots["false_alarms"], robots["failed"]) == (0.5, 0.5, 1)
    assert (robots["coverage_90"], robots["strata"]["robot"]["arm"]["n"]) == (1.0, 4)
    assert goals(found)["robots: one effect right"] == "1/2"
    assert all(name.startswith("robots") for name in goals(found)), "nothing was asked of other worlds"


def test_figures_of_whole_robots():
    failed = score_whole(answer("whole", WHOLE, "planar_servos"), None, None)
    poor = whole(all_of(WHOLE)[:1], off=0.9, rollouts=3.0, verdict="partial")
    found, text = summed([whole(all_of(WHOLE)), poor, failed], system="planar_servos")
    block = found["whole"]
    assert (block["n"], block["failed"], block["right"]) == (3, 1, 1)
    assert (block["rows_right_count"], block["rows_right_of"]) == (4, 9)
    assert block["interval_rows_right"][0] < block["rows_right"] < block["interval_rows_right"][1]
    assert (block["bodies_right"], block["rollouts_within"]) == (pytest.approx(1 / 3), pytest.approx(1 / 3))
    assert (block["families"]["coulomb_friction"]["n"], block["joints"]["planar: elbow"]["right"]) == (6, 1)
    assert goals(found)["whole robots: rows of friction and rotors right"] == "4/9"
    titles = {sheet.title for sheet in prove_sheets.group_sheets(found)}
    assert {"Whole robots", "Whole robots by driven by", "Whole robots by read"} <= titles
    assert "3 whole robots" in text
    assert "wrong: coulomb_friction on shoulder (not found)" in text
    assert any(sheet.title == "Whole robots" for sheet in prove_sheets.terminal_sheets(found))


def test_figures_of_what_floats_or_stands():
    told = all_of(AFLOAT)[:3]
    scores = [
        afloat(told),
        afloat(told[1:], rollouts=2.0),
        score_afloat(answer("afloat", AFLOAT, "quadrotor"), None, None),
    ]
    found, text = summed([*scores, afloat([], (), verdict="none"), afloat(told[:1], ())], system="quadrotor")
    block = found["afloat"]
    assert (block["n"], block["failed"], block["worlds_right_count"]) == (5, 1, 2)
    assert (block["false_alarms_count"], block["false_alarms_of"]) == (1, 2)
    assert (block["effects_right_count"], block["effects_right_of"]) == (5, 9)
    assert block["families"]["actuator_gain"]["right"] == 2
    assert block["spurious_families"] == {"quadrotor: viscous_friction on base.surge": 1}
    assert set(block["strata"]["effects"]) == {"0", "4"}
    assert goals(found)["afloat: nothing missing, false alarms"] == "1/2"
    assert "wrong: viscous_friction on base.surge (not found)" in text
