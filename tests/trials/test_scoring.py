"""Scoring: what counts as right, written down as cases."""

import numpy as np
import pytest

from gpsim.reports.prove_sheets import proof_sheets
from gpsim.trials import drawing
from gpsim.trials.blinding import Answer
from gpsim.trials.claims import iou
from gpsim.trials.fits import Rival
from gpsim.trials.intervals import interval, median_interval, rate, share_interval
from gpsim.trials.scoring import held_out_fit, score
from gpsim.trials.summary import summarise
from gpsim.trials.worlds import TrueEffect, effect_json, world_json


def answer(stratum, effects, **more):
    """An answer to a slider's world, without having run it."""
    world = drawing.draw(1, 3)
    content = {
        "stratum": stratum,
        "visible": True,
        "long": False,
        "effects": [effect_json(e) for e in effects],
        "world": world_json(world) | {"system": "slider", "episodes": 4, "steps": 100, "dt": 0.02, "clock": "session"},
        "one_step": {"q_acc": {"base": 1.0, "own": 0.1}},
    } | more  # fmt: skip
    clean = [np.stack([np.linspace(-1, 1, 101), np.zeros(101)], axis=1)] * 4
    return Answer(content, clean, np.full((400, 1), 0.1), np.repeat(np.arange(4), 100))


def said(family, on="q", low=0.9, value=1.0, high=1.1, name="damping", probability=0.99, region=None, since=None, nats=9.0):  # fmt: skip
    return {
        "family": family, "on": on, "probability": probability, "region": region or {}, "since": since,
        "odds": {"nats": nats, "against": []},
        "parameters": {name: {"value": value, "low": low, "high": high}},
    }  # fmt: skip


def report(verdict, effects=(), alternatives=()):
    return {
        "verdict": verdict, "effects": list(effects), "alternatives": [{"effects": list(a)} for a in alternatives],
        "location": {"channels": {"q_acc": 0.9}, "region": {}, "since": None},
        "fit": {"held_out": ["3"], "one_step": {"q_acc": {"before": 1.0, "tuned": 0.5, "gp": 0.2, "after": 0.11}}},
    }  # fmt: skip


WORLD = {
    "long": False, "visible": True, "scored": True, "error": None, "rivals": [], "sindy": None, "seconds": 10.0,
    "system": "slider", "velocities": "measured", "noise_level": "clean", "noise_known": True, "engine": "rk4",
    "excitation": "sines", "strength": "plain", "gate": "everywhere", "defects": ["dropped"], "effects": [],
}  # fmt: skip
"""What the scores of all trials say of their worlds."""
DAMPED = [TrueEffect("viscous_friction", "q", {"damping": 1.05})]
TWIN = [Rival((("actuator_gain", "force"),), 0.2, False)]
NEAR = [Rival((("actuator_gain", "force"),), 3.5, False)]
RICHER = [Rival((("actuator_gain", "force"),), 0.0, True)]


def test_the_true_name_is_right_and_its_numbers_are_judged():
    found = score(answer("single", DAMPED), report("named", [said("viscous_friction")]), [])
    assert found["right"]
    assert found["location_right"]
    (parameter,) = found["parameters"]
    assert parameter["relative_error"] == pytest.approx(0.05 / 1.05)
    assert parameter["covered"]
    assert found["fit"]["q_acc"]["after"] == pytest.approx(1.1)
    assert found["fit"]["q_acc"]["gp"] == pytest.approx(2.0)


@pytest.mark.parametrize(("rivals", "right"), [(TWIN, True), (NEAR, False), (RICHER, False), ([], False)])
def test_another_name_is_right_only_when_it_was_listed(rivals, right):
    found = score(answer("single", DAMPED), report("named", [said("actuator_gain", "force")]), rivals)
    assert found["right"] is right


@pytest.mark.parametrize(("rivals", "right"), [(TWIN, True), (NEAR, False)])
def test_ambiguous_is_right_only_if_every_member_is_listed(rivals, right):
    told = report("ambiguous", [said("viscous_friction")], [[said("actuator_gain", "force")]])
    assert score(answer("single", DAMPED), told, rivals)["right"] is right


@pytest.mark.parametrize("verdict", ["named", "ambiguous", "unknown"])
def test_any_family_on_a_world_without_mismatch_is_a_false_alarm(verdict):
    found = score(answer("none", []), report(verdict, [said("spring")]), [])
    assert found["false_alarm"]
    assert not found["right"]
    quiet = score(answer("none", []), report("none"), [])
    assert quiet["right"]
    assert not quiet["false_alarm"]


STRANGE = [TrueEffect("cogging", "q", {"amplitude": 1.0}, out_of_catalogue=True)]


@pytest.mark.parametrize(
    ("nats", "probability", "wrong"),
    [(2.4, 0.5, True), (2.2, 0.99, False), (None, 0.99, True), (None, 0.6, False)],
)
def test_a_wrong_name_needs_odds_above_ten(nats, probability, wrong):
    told = report("named", [said("spring", nats=nats, probability=probability)])
    assert score(answer("unknown", STRANGE), told, [])["named_wrong"] is wrong
    assert score(answer("unknown", STRANGE), report("unknown"), [])["right"]


def test_a_gate_has_to_be_found_where_it_is():
    patch = [TrueEffect("local_friction_patch", "q", {"force": 1.0}, {"q": (0.0, 0.5)})]
    told = lambda region: report("named", [said("local_friction_patch", name="force", region=region)])  # noqa: E731
    near = score(answer("single", patch), told({"q": [0.05, 0.5]}), [])
    assert near["iou"] == pytest.approx(0.9)
    assert near["location_right"]
    assert not score(answer("single", patch), told({}), [])["location_right"]
    late = [TrueEffect("viscous_friction", "q", {"damping": 1.0}, since=4.0)]
    found = score(answer("single", late), report("named", [said("viscous_friction", since=4.2)]), [])
    assert found["onset_error"] == pytest.approx(0.2 / (3 * 3.0 + 2.0))
    assert found["location_right"]


GATED_PAIR = [
    TrueEffect("local_friction_patch", "q", {"force": 1.0}, {"q": (0.0, 0.5)}),
    TrueEffect("viscous_friction", "q", {"damping": 1.0}, since=4.0),
]


def named_pair(patch, viscous):
    return report(
        "named", [said("local_friction_patch", name="force", **patch), said("viscous_friction", **viscous)]
    )


def test_every_gate_belongs_to_its_own_effect():
    right = score(answer("pair", GATED_PAIR), named_pair({"region": {"q": [0.1, 0.5]}}, {"since": 4.2}), [])
    assert right["gate_right"]
    assert right["iou"] == pytest.approx(0.8)
    exchanged = named_pair({"since": 4.0}, {"region": {"q": [0.0, 0.5]}})
    found = score(answer("pair", GATED_PAIR), exchanged, [])
    assert not found["gate_right"]
    assert (found["iou"], found["onset_error"]) == (0.0, 1.0)
    one_more = named_pair({"region": {"q": [0.0, 0.5]}, "since": 4.0}, {"since": 4.0})
    assert not score(answer("pair", GATED_PAIR), one_more, [])["gate_right"]


def test_an_equivalent_carries_the_gate_of_the_effect_that_it_replaces():
    late = [TrueEffect("viscous_friction", "q", {"damping": 1.0}, since=4.0)]
    told = report("named", [said("actuator_gain", "force", since=4.2)])
    assert score(answer("single", late), told, TWIN)["location_right"]
    everywhere = report("named", [said("actuator_gain", "force")])
    assert not score(answer("single", late), everywhere, TWIN)["location_right"]
    # Two effects for one: both begin when it did.
    two = [Rival((("actuator_bias", "force"), ("actuator_gain", "force")), 0.2, False)]
    both = report("named", [said(f, "force", since=4.1) for f in ("actuator_gain", "actuator_bias")])
    assert score(answer("single", late), both, two)["location_right"]


def test_a_wrong_name_gets_no_credit_for_a_right_gate():
    late = [TrueEffect("spring", "q", {"stiffness": 1.0}, since=4.0)]
    told = report("named", [said("viscous_friction", since=4.0)])
    found = score(answer("single", late), told, [])
    assert found["onset_error"] == 1.0
    assert not found["location_right"]


def test_edges_beyond_what_was_visited_do_not_matter():
    patch = [TrueEffect("viscous_friction", "q", {"damping": 1.0}, {"q": (0.5, 9.0)})]
    found = score(
        answer("single", patch), report("named", [said("viscous_friction", region={"q": [0.5, 1.5]})]), []
    )
    assert found["iou"] == pytest.approx(1.0)


def test_a_failed_diagnosis_is_wrong():
    assert not score(answer("none", []), None, [])["right"]
    found = score(answer("pair", GATED_PAIR), None, [])
    assert (found["iou"], found["onset_error"]) == (0.0, 1.0)


def test_shares_of_which_less_is_better_do_not_gain_from_failures():
    wrong = report("named", [said("spring")])
    undecided = report("ambiguous", [said("spring")], [[said("gravity")]])
    found = summarise(
        scored(
            (answer("unknown", STRANGE), wrong),
            *[(answer("unknown", STRANGE), None)] * 3,
            (answer("single", DAMPED), undecided),
            *[(answer("single", DAMPED), None)] * 3,
        )
    )
    assert (found["unknown"]["n"], found["unknown"]["failed"]) == (4, 3)
    assert found["unknown"]["share_named_wrong"] == 1.0
    assert (found["undecided"]["n"], found["undecided"]["share"]) == (1, 1.0)
    assert proof_sheets(found | {"undiagnosed": []})
    assert (
        summarise(scored((answer("unknown", STRANGE), None)))["goals"]["unknown.share_named_wrong"]["reached"]
        is None
    )


def test_iou_and_wilson():
    assert iou(np.array([0.0, 2.0]), np.array([1.0, 3.0])) == pytest.approx(1 / 3)
    assert iou(np.array([0.0, 1.0]), np.array([2.0, 3.0])) == 0.0
    # Newcombe (1998), Statistics in Medicine 17, table I, method 3: 81 of 263 and 0 of 20.
    assert interval(81, 263) == pytest.approx([0.2553, 0.3662], abs=1e-4)
    assert interval(0, 20) == pytest.approx([0.0, 0.1611], abs=1e-4)


def test_a_medians_interval_is_that_of_its_order_statistics():
    values = np.random.default_rng(1).normal(size=400)
    low, high = median_interval([[v] for v in values])
    # The binomial interval of the median: ranks n/2 -+ 1.96 sqrt(n)/2.
    ranks = np.sort(values)[[180, 219]]
    assert [low, high] == pytest.approx(ranks, abs=0.04)
    assert median_interval([[v] for v in values]) == [low, high]
    # Ten values of one world are no more than one.
    together = median_interval([[v] * 10 for v in values])
    assert together == pytest.approx([low, high], abs=0.04)
    assert median_interval([[1.0], [np.inf], [np.inf]])[1] == np.inf
    assert median_interval([[], []]) is None


def test_values_of_one_world_make_no_share_surer():
    hits = np.random.default_rng(1).random(400) < 0.85
    alone = share_interval([[hit] for hit in hits])
    assert alone == pytest.approx(interval(int(hits.sum()), 400), abs=0.01)
    assert share_interval([[hit] * 4 for hit in hits]) == alone
    assert share_interval([[], []]) is None
    # No draw of worlds that agree differs from another.
    assert share_interval([[True, True]] * 20) == interval(20, 20)
    assert share_interval([[False]] * 20 + [[]]) == interval(0, 20)


def scored(*answers_and_reports):
    return [
        score(told, given, []) | WORLD | {"trial": f"{i:04d}", "seconds": 10.0 + i}
        for i, (told, given) in enumerate(answers_and_reports, start=1)
    ]


def test_the_summary_tells_the_parts_of_an_answer_apart():
    late = [TrueEffect("viscous_friction", "q", {"damping": 1.05}, since=4.0)]
    scores = scored(
        (answer("single", late), report("named", [said("viscous_friction", since=4.2)])),
        (answer("single", late), report("unknown", [said("viscous_friction")])),
    )
    found = summarise(scores)
    assert found["location"]["gate_right"]["right"] == 1
    assert found["location"]["place_right"]["right"] == 2
    assert found["location"]["rate_right"] == rate([True, True], "right")
    assert found["location"]["onset_error"]["n"] == 2
    assert found["location"]["onset_error"]["mean"] == pytest.approx((0.2 / 11.0 + 1.0) / 2)
    assert found["verdict_right"]["right"] == 1
    assert found["families_right"]["right"] == 2
    low, high = found["seconds"]["interval_median"]
    assert (low, high) == (11.0, 12.0)
    assert found["fit"]["interval_median"] == pytest.approx([1.1, 1.1])
    assert found["parameters"]["interval_median_relative_error"] == pytest.approx([0.05 / 1.05] * 2, abs=1e-6)
    sheets = {sheet.title: sheet for sheet in proof_sheets(found)}
    words = [[cell.text for cell in cells] for cells in sheets["Part by part, on the same worlds"].rows]
    assert ["location: gates right", "0.500", "0.095-0.905", "1/2"] in words
    assert sheets["Sizes of errors"].rows[0][0].text.startswith("onset")


def test_a_failed_diagnosis_is_no_quiet_world_and_an_infinite_error():
    scores = scored(
        (answer("none", []), report("none")),
        (answer("none", []), None),
        (answer("single", DAMPED), report("named", [said("viscous_friction")])),
        (answer("single", DAMPED), None),
    )
    found = summarise(scores)
    assert (found["none"]["n"], found["none"]["failed"], found["none"]["false_alarms"]) == (1, 1, 0)
    assert found["single"]["failed"] == 1
    assert found["rivals"]["gp"]["n"] == 2
    assert found["rivals"]["gp"]["share"] == 0.0  # 2.0 and infinite
    assert found["rivals"]["gp"]["interval_median"] == [pytest.approx(2.0), np.inf]
    nothing_but_failures = summarise(scored((answer("none", []), None)))
    assert nothing_but_failures["goals"]["none.share_false"]["reached"] is None
    assert proof_sheets(nothing_but_failures | {"undiagnosed": []})


def test_a_gains_error_is_also_told_relative_to_what_it_changes():
    weaker = [TrueEffect("actuator_gain", "force", {"gain": 0.9})]
    told = said("actuator_gain", "force", value=0.92, low=0.9, high=0.94, name="gain")
    (found,) = score(answer("single", weaker), report("named", [told]), [])["parameters"]
    assert found["relative_error"] == pytest.approx(0.02 / 0.9)
    assert found["error_of_effect"] == pytest.approx(0.2)
    (damping,) = score(answer("single", DAMPED), report("named", [said("viscous_friction")]), [])[
        "parameters"
    ]
    assert damping["error_of_effect"] == damping["relative_error"]


def test_held_out_errors_are_matched_by_the_name_of_the_rate():
    vehicle = answer("none", [])
    vehicle.content["world"] |= {"system": "unicycle"}
    own = np.tile([0.1, 0.2, 0.4], (400, 1))
    told = report("none")
    told["fit"]["one_step"] = {"w": {"after": 0.4}, "v": {"after": 0.1}}
    found = held_out_fit(Answer(vehicle.content, vehicle.clean, own, vehicle.episode), told)
    assert found == {"w": {"after": pytest.approx(1.0)}, "v": {"after": pytest.approx(1.0)}}
