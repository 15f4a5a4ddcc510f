"""Scoring of whole machines, with made diagnoses: what is told, what stands for it, sizes, black boxes, figures."""

import math

import pytest

from gpsim.reports.prove_page import miss_rows
from gpsim.trials.judged import MachineListing, Seen
from gpsim.trials.scoring_parts import black_box, of_first, score_machine
from gpsim.trials.summary import summarise
from gpsim.trials.worlds import TrueEffect, effect_json

from .test_scoring import WORLD, answer, report, said

OWN = [
    TrueEffect("viscous_friction", "q", {"damping": 1.05}),
    TrueEffect("parameter_offset", "mass", {"ratio": 1.3}),
    TrueEffect("actuator_lag", "force", {"time_constant": 0.01}),
]
NUISANCE = TrueEffect("cogging", "q", {"amplitude": 0.1}, out_of_catalogue=True)
PLAIN, SLIGHT, UNSEEN = Seen(900.0, 0.4, 2.0), Seen(9.0, 0.003, 0.4), Seen(1.0, 0.2, 2.0)
DAMPING = said("viscous_friction")
MASS = said("parameter_offset", "mass", name="ratio", low=1.2, value=1.28, high=1.29)
GAIN = said("actuator_gain", "force", name="gain", low=0.7, value=0.77, high=0.8)
STOOD_FOR = {("actuator_gain", "force"): ("parameter_offset", "mass")}


def machine_answer(explained=0.95, late=None):
    made = answer(
        "machines",
        [*OWN, NUISANCE],
        machine={"explained": explained, "defects": [], "left": {}, "channels": ["q"]},
    )
    made.content["effects"] = [e | {"share": 0.2, "beyond": 3.0} for e in made.content["effects"]]
    session = {
        "excitation": "multisine", "posture": "", "episodes": 4, "steps": 100, "clock": 0.0, "zeros": {}, "changes": {},
    }  # fmt: skip
    rough = dict.fromkeys(("jitter", "drift", "dropped", "repeated", "swapped"), 0.0)
    made.content["world"] |= {
        "machine": {"kind": "axis", "positions_only": False, "sessions": [session]},
        "rough": rough | {"quantum": {}, "leap": {}, "late": late or {}},
        "noise": {"q": 0.1, "q_dot": 0.1},
    }
    return made


def listing(seen=(PLAIN, PLAIN, SLIGHT), stands=None, equivalent=(False,), rollouts=None, values=OWN):
    return MachineListing(
        tuple(seen), stands or {}, tuple(map(effect_json, values)), tuple(equivalent), rollouts or {"q": 1.1, "q_dot": 1.2}
    )  # fmt: skip


def told(verdict, effects, gp=0.9):
    made = report(verdict, effects)
    made["fit"]["rollout"] = {
        "horizon_s": 1.0,
        "q": {"gp": gp, "after": 0.1},
        "q_dot": {"gp": 0.1, "after": 0.1},
    }
    return made


def scored(verdict="named", effects=(DAMPING, MASS), found=None, **more):
    return score_machine(machine_answer(**more), told(verdict, effects), found or listing())


def test_effects_that_count_are_to_be_told_and_slight_ones_may_be():
    found = scored()
    assert (found["counting"], found["told"], found["spurious"], found["right"]) == (2, 2, 0, True)
    lag = said("actuator_lag", "force", name="time_constant")
    assert scored(effects=[DAMPING, MASS, lag])["spurious"] == 0
    assert scored(effects=[DAMPING])["told"] == 1
    assert not scored(effects=[DAMPING])["right"]
    unseen = scored(effects=[DAMPING], found=listing((PLAIN, UNSEEN, SLIGHT)))
    assert (unseen["counting"], unseen["right"]) == (1, True)
    beyond = scored(found=listing((PLAIN, PLAIN, Seen(9.0, 0.003, 1.4))))
    assert (beyond["counting"], beyond["told"]) == (3, 2)


def test_what_is_told_and_not_there_is_spurious_headline_or_slight():
    slight = said("spring", name="stiffness") | {"role": "slight"}
    found = scored(effects=[DAMPING, MASS, slight])
    assert (found["spurious"], found["spurious_headline"], found["right"]) == (1, 0, False)
    assert found["spurious_names"] == [["spring", "q"]]
    late = said("sensor_delay", name="delay")
    assert scored(effects=[DAMPING, MASS, late])["spurious"] == 1
    assert scored(effects=[DAMPING, MASS, late], late={"q": 0.01})["spurious"] == 0


def test_what_explains_as_much_stands_for_an_effect_with_the_sizes_that_go_with_it():
    assert scored(effects=[DAMPING, GAIN])["spurious"] == 1
    instead = [
        TrueEffect("viscous_friction", "q", {"damping": 0.8}),
        TrueEffect("actuator_gain", "force", {"gain": 0.77}),
    ]
    found = scored("ambiguous", [DAMPING, GAIN], listing(stands=STOOD_FOR, values=instead))
    assert (found["told"], found["spurious"], found["verdict_right"], found["right"]) == (2, 0, True, True)
    (size,) = found["parameters"]  # of the friction, which was told by its own name
    assert (size["family"], size["sized"]) == ("viscous_friction", False)
    assert size["relative_error"] == pytest.approx(0.25)
    assert not scored("ambiguous")["verdict_right"]


def test_sizes_are_right_within_15_percent_of_what_they_change_or_inside_the_interval():
    sizes = {p["family"]: p for p in scored()["parameters"]}
    assert sizes["viscous_friction"]["sized"]
    assert sizes["viscous_friction"]["covered"]
    assert sizes["parameter_offset"]["sized"]  # 0.02 of 0.3
    assert not sizes["parameter_offset"]["covered"]
    off = said("parameter_offset", "mass", name="ratio", low=1.1, value=1.2, high=1.21)
    assert not {p["family"]: p["sized"] for p in scored(effects=[DAMPING, off])["parameters"]}[
        "parameter_offset"
    ]


@pytest.mark.parametrize(
    ("rollout", "ratio"),
    [
        ({"horizon_s": 1.0, "q": {"gp": 0.2, "after": 0.1}, "v": {"gp": 0.05, "after": 0.1}}, 1.0),
        ({"q": {"gp": 0.05, "after": 0.1}}, 0.5),
        ({"q": {"gp": None, "after": 0.1}}, math.inf),
        ({"horizon_s": 1.0}, None),
    ],
)
def test_a_black_box_is_compared_by_its_rollouts(rollout, ratio):
    assert black_box(rollout) == (None if ratio is None else pytest.approx(ratio))


def test_of_several_recordings_what_is_said_of_the_first_counts():
    made = told("named", [DAMPING, MASS | {"own": {"1": {"ratio": {"value": 1.3, "low": 1.2, "high": 1.4}}}}])
    made["effects"].append(said("spring", name="stiffness") | {"recordings": ["2"]})
    made["fit"]["held_out"] = ["1/6", "1/7", "2/6"]
    assert of_first(made) == made  # of one recording
    first = of_first(made | {"recordings": [{"name": "1"}, {"name": "2"}]})
    assert [e["family"] for e in first["effects"]] == ["viscous_friction", "parameter_offset"]
    assert first["effects"][1]["parameters"]["ratio"]["value"] == 1.3
    assert first["fit"]["held_out"] == ["6", "7"]
    assert score_machine(machine_answer(), first, listing())["right"]


@pytest.fixture
def content():
    found = [
        scored(),
        scored(effects=[DAMPING, said("spring", name="stiffness")], found=listing(rollouts={"q": 2.0})),
        scored("unknown", [], listing(rollouts={"q": math.inf})),
        scored(effects=[DAMPING, MASS]) | {"black_box": 0.5},
        score_machine(machine_answer(), None, listing()),
    ]
    trials = [s | WORLD | {"trial": f"30000{i}", "seconds": 60.0 + i} for i, s in enumerate(found)]
    facts = {"undiagnosed": [], "seed": 77, "diagnosed_under": ["x"], "git_commit": None}
    return facts | summarise(trials) | {"every_miss": miss_rows(trials), "scores": trials}


def test_the_figures_of_machines(content):
    machines = content["machines"]
    assert machines["n"] == 5
    assert machines["told"] == pytest.approx(5 / 10)
    assert machines["spurious"] == pytest.approx(1 / 4)
    assert machines["verdict_right"] == pytest.approx(3 / 5)
    assert machines["rollouts_within"] == pytest.approx(2 / 5)
    assert machines["black_box_better"] == pytest.approx(1 / 4)
    assert machines["coverage_90"] == pytest.approx(3 / 5)
    assert machines["sized"] == 1.0
    for figure in ("told", "spurious", "verdict_right", "rollouts_within", "black_box_better", "coverage_90"):
        low, high = machines[f"interval_{figure}"]
        assert low <= machines[figure] <= high
    assert machines["failed"] == 1
    assert machines["spurious_families"] == {"axis: spring on q": 1}
    assert machines["families"]["axis: viscous_friction on q"] == {
        "n": 5, "told": 3, "share": 0.6, "interval": machines["families"]["axis: viscous_friction on q"]["interval"],
    }  # fmt: skip
    assert machines["misses"] == ["300001", "300002", "300004"]
    assert content["n"] == content["all"]["n"] == 0
    assert content["goals"]["machines.told"]["reached"] is False
    assert content["goals"]["machines.spurious"]["reached"] is True
